"""`bench figures`: the surfaces of the validation bench, its pages in order, and the files that hold them."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any

from pipeline.config.models import Config
from pipeline.errors import BakeError, ConfigError, InputError
from pipeline.evaluation import results
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.page import Bench, BenchSurface, Page
from pipeline.evaluation.sources import SOURCES, as_published
from pipeline.evaluation.speed.timing import timed
from pipeline.progress import Progress
from pipeline.report import template
from pipeline.stages import provenance, surface
from pipeline.stages import run as stages
from pipeline.store.store import Store

# modules of this package, each with a `make`; imported when their turn comes
PAGES = (
    "viewing_angles",
    "screen",
    "brdf_maps",
    "grids",
    "terms",
    "coherence_length",
    "wavelength_step",
    "methods_sheet",
    "order_efficiencies",
    "energy",
    "validity",
    "costs",
)


@dataclass(frozen=True)
class Made:
    """A page and the seconds it took."""

    page: Page
    seconds: float


@dataclass(frozen=True)
class FigureResults:
    """The pages of one run."""

    made: Sequence[Made]

    def document(self) -> dict[str, Any]:
        """Return all that was measured, for JSON."""
        return {
            "versions": provenance.versions(),
            "device": provenance.device(),
            "pages": [{**each.page.document(), "seconds": each.seconds} for each in self.made],
        }

    def files(self) -> dict[str, str | bytes]:
        """Return index.html with every verdict, a page for each figure and figures.json by name."""
        verdicts = Counter(check.verdict for each in self.made for check in each.page.checks)
        subtitle = (
            f"{verdicts['holds']} of {verdicts['holds'] + verdicts['misses']} judged statements hold, "
            f"{verdicts['reported']} more are reported and not judged. "
            f"{sum(each.seconds for each in self.made):.0f} s in all."
        )
        index = {"title": "Validation bench", "subtitle": subtitle, "pages": self.made, "sources": SOURCES}
        pages = [each.page for each in self.made]
        return {
            "index.html": template.html(__package__, "index.html.in", **index),
            **{
                f"{page.name}.html": template.html(
                    __package__, "figure.html.in", title=page.title, subtitle=page.source, page=page
                )
                for page in pages
            },
            "figures.json": results.json_text(self.document()),
        }


def run(
    configs: Mapping[str, tuple[Config, str]],
    quick: bool,
    store: Store,
    progress: Progress,
    note: Callable[[str], None],
) -> FigureResults:
    """Make every page, one after the other.

    configs: those of "elaphe" and "xenopeltis" that replace the synthetic surfaces, each with its file's name. quick:
    smaller maps and fewer points. note: called with a line about each surface and page. Raises ConfigError for two
    surfaces of one name, which no page could tell apart, and for a laser line; InputError for a flat surface.
    """
    surfaces = {role: _surface(role, config, store, progress, note) for role, config in _configs(configs).items()}
    bench, made = Bench(**surfaces, quick=quick), []
    for name in PAGES:
        made.append(Made(*timed(partial(_page, name, bench, progress))))
        note(f"  {name:<20} {made[-1].seconds:5.1f} s")
    return FigureResults(made)


def _page(name: str, bench: Bench, progress: Progress) -> Page:
    """A page that these surfaces do not allow states the reason, and the other pages are made."""
    try:
        page: Page = import_module(f"{__package__}.{name}").make(bench, progress)
    except BakeError as error:
        check = Check("made", f"page of these surfaces ({' '.join(str(error).split())})", 0, ">=", 1)
        page = Page(name, f"{name.replace('_', ' ').capitalize()}: not made", "", "", [check])
    return page


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
