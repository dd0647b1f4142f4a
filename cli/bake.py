"""`run`, `validate` and `plan`: what a config needs, and doing it."""

import shutil
import time
from pathlib import Path
from typing import Any

import click

from cli import console
from pipeline import config as configs
from pipeline.config import Config


@click.command("run")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@console.out_option
@console.store_option
@console.json_option
def run_command(config_paths: tuple[Path, ...], out: Path, store_root: Path | None, as_json: bool) -> None:
    """Do all that CONFIGs ask: surface, stack, table, maps, validation, bundle.

    Results land in OUT/NAME: BRDF maps (EXR, PNG), report.html and the bundle. Stages whose inputs have not
    changed are taken from the store. All configs are checked before the first one is baked.
    """
    _bake_all(config_paths, out, store_root, as_json, with_bundle=True)


@click.command("validate")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@console.out_option
@console.store_option
@console.json_option
def validate_command(config_paths: tuple[Path, ...], out: Path, store_root: Path | None, as_json: bool) -> None:
    """Measure CONFIGs' tables against the exact sum and write OUT/NAME/report.html.

    On random directions: the relative error of |P|^2 and CIELAB errors at 1, 1000 and 7500 RU; on the maps of the
    config's lights: CIELAB errors and pictures; and how the error depends on terms, wavelength step and grid.
    """
    _bake_all(config_paths, out, store_root, as_json, with_bundle=False)


def _bake_all(
    paths: tuple[Path, ...], out: Path, store_root: Path | None, as_json: bool, *, with_bundle: bool
) -> None:
    loaded = [configs.load(path) for path in paths]
    _refuse_same_names(loaded, paths)
    results = [_bake(config, out, store_root, with_bundle) for config in loaded]
    if as_json:
        console.print_json(results)
    else:
        for result in results:
            _tell(result)
    _refuse_missed_budgets([result["stages"]["validate"]["summary"]["budget"] | result for result in results])


def _refuse_missed_budgets(results: list[dict[str, Any]]) -> None:
    """Everything was baked and written, but a budget that was asked for and not met is a failure."""
    from pipeline.errors import AccuracyError

    lines = [
        f"{r['name']}: accuracy.delta_e asks for {r['delta_e']:g} at {r['exposure_ru']:g} RU, measured "
        f"{r['measured']:.3g}. Raise table.resolution, lower table.step_nm or raise the budget."
        for r in results
        if r["met"] is False
    ]
    if lines:
        raise AccuracyError("\n".join(lines))


def _refuse_same_names(loaded: list[Config], paths: tuple[Path, ...]) -> None:
    """Two configs of one name would write into one folder."""
    from pipeline.errors import ConfigError

    seen: dict[str, Path] = {}
    for config, path in zip(loaded, paths, strict=True):
        if config.name in seen:
            raise ConfigError(str(path), [("name", f"{config.name!r} is also the name of {seen[config.name]}")])
        seen[config.name] = path


def _bake(config: Config, out: Path, store_root: Path | None, with_bundle: bool) -> dict[str, Any]:
    from pipeline import run

    store = console.open_store(store_root)
    console.note(f"{config.name}:")

    def tell(step: run.Step, seconds: float | None) -> None:
        console.note(f"  {step.stage.name:<9} " + ("cached" if seconds is None else f"{seconds:.1f} s"))
        if step.stage.name == "surface":
            for text in store.describe("surface", step.key).summary["warnings"]:
                console.warn(f"{config.name}: {text}")

    with console.showing_progress() as progress:
        artifacts = run.execute(config, run.plan(config, store), store, progress, tell)
        files = _lay_out(store, artifacts, out / config.name)
        bundle = publish_bundle(config, store, artifacts, out / config.name, progress) if with_bundle else None
    return {
        "name": config.name,
        "stages": {name: {"key": a.key, "summary": a.summary} for name, a in artifacts.items()},
        "files": [str(path) for path in files],
        "bundle": None if bundle is None else str(bundle),
    }


def _lay_out(store: Any, artifacts: dict[str, Any], folder: Path) -> list[Path]:
    """Copies what people look at out of the store; what is there and the same stays."""
    from pipeline.store import writing

    made = []
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("render", "validate"):
            artifact = store.open(name, artifacts[name].key)
            for file in sorted(artifact.record["files"]):
                if name == "validate" and file != "report.html":
                    continue
                target = folder / file
                beside = target.with_name(f".{target.name}.part")
                shutil.copyfile(artifact.folder / file, beside)
                beside.replace(target)
                made.append(target)
    return made


def publish_bundle(config: Config, store: Any, artifacts: dict[str, Any], folder: Path, progress: Any) -> Path:
    from pipeline.bundle.publish import publish, published

    standing = published(config, {name: a.key for name, a in artifacts.items()}, folder)
    if standing is not None:
        console.note("  bundle    cached")
        return standing
    started = time.perf_counter()
    opened = {name: store.open(name, artifact.key) for name, artifact in artifacts.items()}
    bundle = publish(config, opened, folder, progress)
    console.note(f"  bundle    {time.perf_counter() - started:.1f} s")
    return bundle


def _tell(result: dict[str, Any]) -> None:
    summary = result["stages"]["validate"]["summary"]
    places = [(f"map {m['theta_deg']:g}°, {m['phi_deg']:g}°", m["colour"]) for m in summary["maps"]]
    places.append(("random directions", summary["random"]["colour"]))
    rows = [
        [place, f"{e['exposure_ru']:g}", *(f"{e[key]:.3f}" for key in ("mean", "percentile_99", "maximum"))]
        for place, errors in places
        for e in errors
    ]
    click.echo(f"{result['name']}: CIELAB error of the table against the exact sum")
    console.print_table(["where", "RU", "mean", "99th %", "max"], rows)
    for path in (*result["files"], result["bundle"]):
        if path is not None:
            click.echo(path)


@click.command("plan")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@console.store_option
@console.json_option
def plan_command(config_paths: tuple[Path, ...], store_root: Path | None, as_json: bool) -> None:
    """Say what `run` would do: every stage cached or to do, why, and its cost. Computes nothing."""
    from pipeline import run

    store = console.open_store(store_root)
    plans = {}
    for path in config_paths:
        config = configs.load(path)
        plans[config.name] = [
            {
                "stage": step.stage.name,
                "key": step.key,
                "state": "cached" if step.cached else "to do",
                "reason": step.reason,
                "cost": step.cost,
            }
            for step in run.plan(config, store)
        ]
    if as_json:
        console.print_json(plans)
        return
    for name, steps in plans.items():
        click.echo(f"{name}:")
        rows = [[s["stage"], s["state"], s["cost"], s["reason"]] for s in steps]
        console.print_table(["stage", "state", "cost", "why"], rows)
