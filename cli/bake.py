"""`run` and `plan`: bake configs, and list what a bake would compute."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cli import console, sources

if TYPE_CHECKING:
    from pipeline.config.models import Config
    from pipeline.stages.run import Step


@click.command("run")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option(
    "--until",
    type=click.Choice(["surface", "table", "render"]),
    help="Stop after this stage, without results in OUT [default: all stages, and the bundle].",
)
@console.out_option
@console.store_option
@console.memory_option
@console.json_option
def run_command(
    config_paths: tuple[Path, ...], until: str | None, out: Path, store_root: Path | None, as_json: bool
) -> None:
    """Bake CONFIGs: surface, power spectrum, table, maps, validation, bundle.

    Results are written to OUT/NAME: BRDF maps (EXR, PNG), report.html and the bundle. Stages whose inputs have not
    changed are taken from the store. All configs are checked before the first one is baked.
    """
    if until is not None:
        _bake_until(load_all(config_paths, store_root, until), until, store_root, as_json)
        return
    bake_all(config_paths, out, store_root, as_json, until="bundle")


def bake_all(paths: tuple[Path, ...], out: Path, store_root: Path | None, as_json: bool, until: str) -> None:
    """Bakes configs up to a stage, writes their results to `out`, and prints the errors and the files.

    Raises AccuracyError where maps miss their error budget; the results are written nevertheless.
    """
    from pipeline.errors import AccuracyError
    from pipeline.store import scratch

    loaded = load_all(paths, store_root, until)
    for config in loaded:
        scratch.require_folder(out / config.name)
    baked = [_bake(config, out, store_root, until) for config in loaded]
    results = [result for result, _ in baked]
    if as_json:
        console.print_json(results)
    else:
        for result in results:
            _print_result(result)
    # everything is baked and written, but a missed error budget is a failure
    missed = [line for _, line in baked if line is not None]
    if missed:
        raise AccuracyError(*missed)


def _bake_until(loaded: "list[Config]", until: str, store_root: Path | None, as_json: bool) -> None:
    """Runs the stages up to one and prints their summaries or certificates, without results in OUT."""
    from pipeline.stages import run

    results: list[dict[str, Any]] = []
    for config in loaded:
        store = console.open_store(store_root)
        console.note(f"{config.name}:")
        with console.showing_progress() as progress:
            steps = run.plan(config, store, until)
            made = run.execute(config, steps, store, progress, console.step_reporter(config, store))
        stages = {name: {"key": a.key, "summary": a.summary} for name, a in made.items()}
        results.append({"name": config.name, "stages": stages})
    if as_json:
        console.print_json(results)
        return
    for result in results:
        found = [stage["summary"].get("certificate") for stage in result["stages"].values()]
        certificates = [certificate for certificate in found if certificate is not None]
        if certificates:
            # the last one is of what a bundle holds
            console.say(f"{result['name']}: {_certified(certificates[-1])}")


def _certified(certificate: dict[str, Any]) -> str:
    return (
        f"mean CIELAB error {certificate['measured']:.3f} at {certificate['exposure_ru']:g} RU on "
        f"{certificate['random']['directions']} random directions"
        + ("" if certificate["delta_e"] is None else f", {certificate['delta_e']:g} allowed")
        + _flank(certificate["flank"])
    )


def _flank(flank: dict[str, Any] | None) -> str:
    """The largest error beside the mirror directions, and whether it is within its limit."""
    if flank is None:
        return ""
    error = flank["colour"]
    verdict = "" if flank["kept"] else ", above the limit of 5"
    return f"; beside mirror directions at most {error['maximum']:.2g} at {error['exposure_ru']:g} RU{verdict}"


def load_all(paths: tuple[Path, ...], store_root: Path | None, until: str) -> "list[Config]":
    """Loads configs, and checks those of which a stage is to do before any work starts.

    until: name of the last stage.
    Raises ConfigError for faults, and for two configs of one name, which would share a folder.
    """
    from pipeline.config import read
    from pipeline.errors import ConfigError
    from pipeline.stages import run

    store = console.open_store(store_root)
    seen: dict[str, tuple[Config, Path]] = {}
    for path in paths:
        config = read.load(path)
        if config.name in seen:
            raise ConfigError(str(path), [("name", f"{config.name!r} is also the name of {seen[config.name][1]}")])
        seen[config.name] = config, path
    for config, path in seen.values():
        if not all(step.cached for step in run.plan(config, store, until)):
            sources.check(config, path)
    return [config for config, _ in seen.values()]


def _bake(config: "Config", out: Path, store_root: Path | None, until: str) -> tuple[dict[str, Any], str | None]:
    """Bakes a config; returns its result as JSON, and a message where it missed its error budget."""
    from pipeline.stages import bake

    store = console.open_store(store_root)
    console.note(f"{config.name}:")
    bundle = None
    with console.showing_progress() as progress:
        given = config, store, out / config.name, progress, console.step_reporter(config, store)
        if until == "bundle":
            made, bundle = bake.make(*given)
        else:
            made = bake.validate(*given)
    result = {
        "name": config.name,
        "stages": {name: {"key": a.key, "summary": a.summary} for name, a in made.artifacts.items()},
        "files": [str(path) for path in made.files],
        "bundle": None if bundle is None else str(bundle),
    }
    return result, made.missed_budget


def _print_result(result: dict[str, Any]) -> None:
    from pipeline.stages.validation_report import ERROR_COLUMNS, error_rows

    console.say(f"{result['name']}: CIELAB error of the bundle's tables against the exact sum")
    console.print_table(ERROR_COLUMNS, error_rows(result["stages"]["validate"]["summary"]))
    for path in (*result["files"], result["bundle"]):
        if path is not None:
            console.say(path)


@click.command("plan")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@console.store_option
@console.memory_option
@console.json_option
def plan_command(config_paths: tuple[Path, ...], store_root: Path | None, as_json: bool) -> None:
    """List what `run` would do: each stage, cached or to do, the reason, its memory and its cost. Computes nothing.

    The peak is that of the whole process; that of a table whose grid is still to be searched for may grow. Where
    `run` would refuse a stage for its memory, so does this, with exit code 4.
    """
    from pipeline.stages import run

    store = console.open_store(store_root)
    planned = [(config, run.plan(config, store)) for config in load_all(config_paths, store_root, "bundle")]
    plans = {config.name: _explained(config, steps, store) for config, steps in planned}
    if as_json:
        console.print_json(plans)
    else:
        _print_plans(plans)
    for config, steps in planned:
        run.require_memory(config, steps, store)


def _print_plans(plans: dict[str, list[dict[str, Any]]]) -> None:
    for name, steps in plans.items():
        console.say(f"{name}:")
        rows = [[s["stage"], s["state"], _size(s["peak_bytes"]), s["cost"]] for s in steps]
        console.print_table(["stage", "state", "peak", "cost"], rows)
        for step in steps:
            if step["state"] == "to do":
                console.say(f"{step['stage']}: {step['reason']}")


def _size(bytes_: int | None) -> str:
    from pipeline.resources import in_words

    return "unknown" if bytes_ is None else in_words(bytes_)


def _explained(config: "Config", steps: "list[Step]", store: Any) -> list[dict[str, Any]]:
    """Lists every stage of a plan."""
    from pipeline.stages import run

    return [
        {
            "stage": step.stage.name,
            "key": step.key,
            "state": "cached" if step.cached else "to do",
            "reason": explanation.reason,
            "cost": explanation.cost,
            "peak_bytes": None if explanation.need is None else explanation.need.bytes,
            "seconds": None if explanation.need is None else explanation.need.seconds,
        }
        for step, explanation in zip(steps, run.explain(config, steps, store), strict=True)
    ]
