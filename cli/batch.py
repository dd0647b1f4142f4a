"""Bakes of one config or several, and their results for people and machines."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cli import console, explain, sources

if TYPE_CHECKING:
    from pipeline.batch.turns import Turn
    from pipeline.config.models import Config
    from pipeline.stages.run import Step

_SUMMARY = ("config", "verdict", "mean dE", "seconds", "made", "cached", "result")


def bake_all(
    paths: tuple[Path, ...], out: Path, store_root: Path | None, as_json: bool, until: str, *, explains: bool = False
) -> None:
    """Bakes configs up to a stage, and prints the errors and files of one config or the summary of several.

    out: folder for the results of the stages "validate" and "bundle"; earlier stages have none. explains: whether
    predicted cost is shown beside the actual one.
    Raises the error of a single config. Of several, errors are printed and all configs are baked; raises
    click.exceptions.Exit with the code of the first path that failed. A missed error budget is a failure, although
    the results are written.
    """
    from pipeline.batch.turns import turns
    from pipeline.errors import AccuracyError
    from pipeline.store import scratch

    store = console.open_store(store_root)
    planned = plan_all(paths, store, until)
    if until in ("validate", "bundle"):
        for config, _ in planned:
            scratch.require_folder(out / config.name)
    baked = {turn.config.name: _bake(turn, out, store, until, explains=explains) for turn in turns(planned, store)}
    results = [baked[config.name] for config, _ in planned]
    if explains and not as_json:
        for result in results:
            explain.show(result)
    if as_json:
        console.print_json(results)
    elif len(results) > 1:
        console.print_table(_SUMMARY, [_row(result) for result in results])
    else:
        _print_result(results[0])
    errors = [result["error"] for result in results if result["error"] is not None]
    if errors and len(results) == 1:
        # of a single config, all other errors were raised
        raise AccuracyError(*errors[0]["lines"])
    if errors:
        raise click.exceptions.Exit(errors[0]["code"])


def plan_all(paths: tuple[Path, ...], store: Any, until: str) -> "list[tuple[Config, list[Step]]]":
    """Loads configs and plans their bakes, and checks those of which a stage is to do before any work starts.

    store: where artifacts are looked for. until: name of the last stage.
    Raises ConfigError for faults, and for two configs of one name, which would share a folder.
    """
    from pipeline.config import read
    from pipeline.errors import ConfigError
    from pipeline.stages import run

    seen: dict[str, tuple[Config, Path]] = {}
    for path in paths:
        config = read.load(path)
        if config.name in seen:
            raise ConfigError(str(path), [("name", f"{config.name!r} is also the name of {seen[config.name][1]}")])
        seen[config.name] = config, path
    planned = [(config, run.plan(config, store, until)) for config, _ in seen.values()]
    for config, steps in planned:
        if not all(step.cached for step in steps):
            sources.check(config, seen[config.name][1])
    return planned


def _bake(turn: "Turn", out: Path, store: Any, until: str, *, explains: bool) -> dict[str, Any]:
    """Bakes a config; returns its result as JSON, with the error in it where the config is one of several."""
    from cli import faults
    from pipeline.errors import AccuracyError

    config, is_alone, started = turn.config, turn.count == 1, time.perf_counter()
    result: dict[str, Any] = {"name": config.name, "stages": {}, "files": [], "bundle": None, "error": None}
    console.note(f"{config.name}:" if is_alone else f"{config.name} ({turn.number} of {turn.count}):")
    try:
        missed = _make(turn, out, store, until, result, explains=explains)
        if missed is not None:
            result["error"] = {"code": AccuracyError.exit_code, "lines": [missed]}
    except Exception as error:
        if is_alone or faults.is_of_output(error):
            raise
        code, lines = faults.explained(error)
        result["error"] = {"code": code, "lines": lines}
    if result["error"] is not None and not is_alone:
        for line in result["error"]["lines"]:
            console.note(f"error: {config.name}: {_unnamed(line, config.name)}")
    result["seconds"] = round(time.perf_counter() - started, 3)
    return result


def _make(turn: "Turn", out: Path, store: Any, until: str, result: dict[str, Any], *, explains: bool) -> str | None:
    """Makes the stages of a config and writes them to its result; returns a message where it missed its budget."""
    from pipeline.stages import bake, run

    config, report = turn.config, console.step_reporter(turn.config, store)
    explained = explain.Explained(turn, store) if explains else None

    def on_step(step: Any, seconds: float | None) -> None:
        report(step, seconds)
        summary = store.describe(step.stage.name, step.key).summary
        stage = {"key": step.key, "cached": seconds is None, "summary": summary}
        if explained is not None:
            explained.add(step, seconds, stage)
        result["stages"][step.stage.name] = stage

    with console.showing_progress() as progress:
        if until == "bundle":
            made, bundle = bake.make(config, turn.steps, store, out / config.name, progress, on_step, turn.session)
            result["bundle"] = str(bundle)
        elif until == "validate":
            made = bake.validate(config, turn.steps, store, out / config.name, progress, on_step, turn.session)
        else:
            run.execute(config, turn.steps, store, progress, on_step, turn.session)
            return None
    result["files"] = [str(path) for path in made.files]
    return made.missed_budget


def _print_result(result: dict[str, Any]) -> None:
    """Prints the errors and the files of a config, or its certificate where it was not validated."""
    from pipeline.stages.validation_report import ERROR_COLUMNS, error_rows

    if "validate" in result["stages"]:
        console.say(f"{result['name']}: CIELAB error of the bundle's tables against the exact sum")
        console.print_table(ERROR_COLUMNS, error_rows(result["stages"]["validate"]["summary"]))
        for path in (*result["files"], result["bundle"]):
            if path is not None:
                console.say(path)
        return
    certificate = _certificate(result)
    if certificate is not None:
        console.say(
            f"{result['name']}: mean CIELAB error {certificate['measured']:.3f} at {certificate['exposure_ru']:g} RU "
            f"on {certificate['random']['directions']} random directions"
            + ("" if certificate["delta_e"] is None else f", {certificate['delta_e']:g} allowed")
            + _flank(certificate["flank"])
        )


def _flank(flank: dict[str, Any] | None) -> str:
    """The largest error beside the mirror directions, and whether it is within its limit."""
    if flank is None:
        return ""
    from pipeline.optics.coherence import FLANK_DELTA_E

    error = flank["colour"]
    verdict = "" if flank["kept"] else f", above the limit of {FLANK_DELTA_E:g}"
    return f"; beside mirror directions at most {error['maximum']:.2g} at {error['exposure_ru']:g} RU{verdict}"


def _row(result: dict[str, Any]) -> list[str]:
    """Returns the line of a config in the summary of several."""
    certificate, error, stages = _certificate(result), result["error"], result["stages"].values()
    made = sum(not stage["cached"] for stage in stages)
    if error is None:
        # the report is the last of the files
        verdict, shown = "ok", result["bundle"] or (result["files"] or ["-"])[-1]
    else:
        verdict = "missed" if result["files"] else "failed"
        shown = f"exit code {error['code']}: {_unnamed(error['lines'][0], result['name'])}"
    return [
        result["name"],
        verdict,
        "-" if certificate is None else f"{certificate['measured']:.3f}",
        f"{result['seconds']:.1f}",
        str(made),
        str(len(stages) - made),
        shown,
    ]


def _certificate(result: dict[str, Any]) -> dict[str, Any] | None:
    """Returns the certificate of what a bundle holds, else of the table; None where neither is made."""
    found = [stage["summary"].get("certificate") for stage in result["stages"].values()]
    certificates: list[dict[str, Any]] = [certificate for certificate in found if certificate is not None]
    return certificates[-1] if certificates else None


def _unnamed(line: str, name: str) -> str:
    """Returns a message without the config's name, with which some begin."""
    return line.removeprefix(f"{name}: ")
