"""`validate`: tables against the exact sum, or every method against what the literature and theory say."""

from pathlib import Path
from typing import Any

import click

from cli import console, sources
from cli.bake import bake_all


@click.command("validate")
@click.argument("config_paths", metavar="[CONFIG]...", type=click.Path(path_type=Path), nargs=-1)
@click.option("--bench", is_flag=True, help="The validation bench instead: pages beside the literature's figures.")
@click.option("--quick", is_flag=True, help="Of --bench: smaller maps, fewer points.")
@click.option(
    "--elaphe", type=click.Path(path_type=Path), help="Of --bench: a config to stand for Elaphe [default: synthetic]."
)
@click.option(
    "--xenopeltis",
    type=click.Path(path_type=Path),
    help="Of --bench: a config to stand for Xenopeltis [default: synthetic].",
)
@console.out_option
@console.store_option
@console.json_option
def validate_command(
    config_paths: tuple[Path, ...],
    bench: bool,
    quick: bool,
    elaphe: Path | None,
    xenopeltis: Path | None,
    out: Path,
    store_root: Path | None,
    as_json: bool,
) -> None:
    """Measure CONFIGs' tables against the exact sum and write OUT/NAME/report.html.

    On random directions: the relative error of |P|^2 and CIELAB errors at 1, 1000 and 7500 RU; on the maps of the
    config's lights: CIELAB errors and pictures; and how the error depends on terms, wavelength step and grid.

    With --bench and no CONFIG: every method of the literature side by side, a page for each of its figures and tables
    with what was expected, what was measured and the verdict, in OUT/validation/index.html. It needs no file: snakes
    are synthetic where no config of a scan is given.
    """
    if bench:
        if config_paths:
            raise click.UsageError("--bench takes no CONFIG; name scans by --elaphe and --xenopeltis")
        _bench({"elaphe": elaphe, "xenopeltis": xenopeltis}, quick, out / "validation", store_root, as_json)
        return
    if quick or elaphe or xenopeltis:
        raise click.UsageError("--quick, --elaphe and --xenopeltis belong to --bench")
    if not config_paths:
        raise click.UsageError("Missing argument '[CONFIG]...'; or --bench for the validation bench")
    bake_all(config_paths, out, store_root, as_json, until="validate")


def _bench(roles: dict[str, Path | None], quick: bool, folder: Path, store_root: Path | None, as_json: bool) -> None:
    from pipeline.evaluation.figures import pages
    from pipeline.evaluation.figures.page import Bench
    from pipeline.store import scratch

    scratch.require_folder(folder)
    store = console.open_store(store_root)
    configs = _configs({"blazed": None, **roles})
    bench = Bench(**{role: _surface(role, config, store) for role, config in configs.items()}, quick=quick)
    with console.showing_progress() as progress:
        made = list(pages.make_all(bench, progress, console.note))
    written = _write(made, folder)
    if as_json:
        console.print_json({**pages.document(made), "files": [str(path) for path in written]})
        return
    _tell(made)
    click.echo(str(folder / "index.html"))


def _tell(made: list[Any]) -> None:
    """A row a page, then every statement that does not hold."""
    verdicts = [[check.verdict for check in each.page.checks] for each in made]
    console.print_table(
        ["page", "holds", "misses", "reported", "time"],
        [
            [
                each.page.name,
                *(str(found.count(word)) for word in ("holds", "misses", "reported")),
                f"{each.seconds:.0f} s",
            ]
            for each, found in zip(made, verdicts, strict=True)
        ],
    )
    for each in made:
        for check in each.page.checks:
            if check.verdict == "misses":
                click.echo(f"{each.page.name}: {check.what}: expected {check.expected}, measured {check.measured}")


def _configs(roles: dict[str, Path | None]) -> dict[str, Any]:
    """Every role's config, its own or the recipe of its name, all read before anything is computed.

    Raises ConfigError for two of one name, which no page could tell apart, and for a laser line.
    """
    from pipeline.config.models import Config
    from pipeline.errors import ConfigError

    found: dict[str, Config] = {}
    for role, path in roles.items():
        recipe = {"name": role, "surface": {"recipe": {"kind": role}}}
        config = Config.model_validate(recipe) if path is None else sources.load(path)
        taken = next((other for other, each in found.items() if each.name == config.name), None)
        if taken is not None:
            fault = f"{config.name!r} is also the name of what stands for {taken}; give this one another"
            raise ConfigError(str(path or role), [("name", fault)])
        if config.light.is_line:
            fault = f"expected a range of wavelengths, whose colours --bench compares, got a laser line; see --{role}"
            raise ConfigError(str(path), [("spectrum.illuminant", fault)])
        found[role] = config
    return found


def _surface(role: str, config: Any, store: Any) -> Any:
    """A surface of the bench. Raises InputError for a flat one."""
    from pipeline.errors import InputError
    from pipeline.evaluation.figures.page import BenchSurface
    from pipeline.stages import run, surface

    console.note(f"{config.name}:")
    with console.showing_progress() as progress:
        told = console.step_reporter(config, store)
        made = run.execute(config, run.plan(config, store, "surface"), store, progress, told)
    field = surface.load(store.open("surface", made["surface"].key))
    if field.half_range_um == 0.0:
        raise InputError(f"{config.name}: expected a surface with a relief for --{role}, got a flat one")
    return BenchSurface(config, field, config.surface.recipe is None)


def _write(made: list[Any], folder: Path) -> list[Path]:
    """index.html, a page each and validation.json, each taking its place whole."""
    import json

    from pipeline.evaluation.figures import html as figure_pages
    from pipeline.evaluation.figures import pages
    from pipeline.store import scratch
    from pipeline.store.store import writing

    contents = {
        "index.html": figure_pages.index(made),
        **{f"{each.page.name}.html": figure_pages.page(each.page) for each in made},
        "validation.json": json.dumps(pages.document(made), indent=1) + "\n",
    }
    with writing(folder), scratch.replacing(folder) as beside:
        for name, text in contents.items():
            (beside / name).write_text(text, encoding="utf-8")
    return [folder / name for name in contents]
