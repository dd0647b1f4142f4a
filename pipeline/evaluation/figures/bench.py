"""`bench figures`: the surfaces of the validation bench, its pages, and the files that hold them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.config.models import Config
from pipeline.errors import ConfigError, InputError
from pipeline.evaluation import results
from pipeline.evaluation.figures import html, pages
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.figures.pages import Made
from pipeline.evaluation.sources import as_published
from pipeline.progress import Progress
from pipeline.stages import run as stages
from pipeline.stages import surface
from pipeline.store.store import Store


@dataclass(frozen=True)
class FigureResults:
    """The pages of one run."""

    made: Sequence[Made]

    def document(self) -> dict[str, Any]:
        """Return all that was measured, for JSON."""
        return pages.document(self.made)

    def files(self) -> dict[str, str | bytes]:
        """Return index.html, a page for each figure and figures.json by name."""
        return {
            "index.html": html.index(self.made),
            **{f"{each.page.name}.html": html.page(each.page) for each in self.made},
            "figures.json": results.json_text(self.document()),
        }


def run(
    configs: Mapping[str, tuple[Config, str]],
    quick: bool,
    store: Store,
    progress: Progress,
    note: Callable[[str], None],
) -> FigureResults:
    """Make every page.

    configs: those of "elaphe" and "xenopeltis" that replace the synthetic surfaces, each with its file's name. quick:
    smaller maps and fewer points. note: called with each surface and page. Raises ConfigError for two surfaces of one
    name, which no page could tell apart, and for a laser line; InputError for a flat surface.
    """
    chosen = _configs(configs)
    surfaces = {role: _surface(role, config, store, progress, note) for role, config in chosen.items()}
    return FigureResults(list(pages.make_all(Bench(**surfaces, quick=quick), progress, note)))


def _configs(given: Mapping[str, tuple[Config, str]]) -> dict[str, Config]:
    """The config of every role, its own or the recipe of its name."""
    found: dict[str, Config] = {}
    for role in ("blazed", "elaphe", "xenopeltis"):
        recipe = Config.model_validate({"name": role, "surface": {"recipe": {"kind": role}}})
        config, file = given.get(role, (recipe, role))
        taken = next((other for other, each in found.items() if each.name == config.name), None)
        if taken is not None:
            fault = f"{config.name!r} is also the name of the surface for {taken}; give this one another"
            raise ConfigError(file, [("name", fault)])
        if config.light.is_line:
            fault = f"expected a range of wavelengths, whose colours are compared, got a laser line; see --{role}"
            raise ConfigError(file, [("spectrum.illuminant", fault)])
        found[role] = as_published(config)
    return found


def _surface(
    role: str, config: Config, store: Store, progress: Progress, note: Callable[[str], None]
) -> BenchSurface:
    note(f"{config.name}:")
    made = stages.execute(config, stages.plan(config, store, "surface"), store, progress)
    artifact = store.open("surface", made["surface"].key)
    for text in artifact.summary["warnings"]:
        note(f"warning: {config.name}: {text}")
    field = surface.load(artifact)
    if field.half_range_um == 0.0:
        raise InputError(f"{config.name}: expected a surface with a relief for --{role}, got a flat one")
    return BenchSurface(config, field, config.surface.recipe is None)
