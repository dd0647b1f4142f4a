"""`run` and `plan`: bake configs, and list what a bake would compute."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cli import console, explain
from cli.batch import bake_all, plan_all

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
@click.option("--explain", "explains", is_flag=True, help="Show predicted beside actual cost, and learn from it.")
@console.out_option
@console.store_option
@console.memory_option
@console.json_option
def run_command(
    config_paths: tuple[Path, ...],
    until: str | None,
    explains: bool,
    out: Path,
    store_root: Path | None,
    as_json: bool,
) -> None:
    """Bake CONFIGs: surface, power spectrum, table, maps, validation, bundle.

    Results are written to OUT/NAME: BRDF maps (EXR, PNG), report.html and the bundle. Stages whose inputs have not
    changed are taken from the store. All configs are checked before the first one is baked.

    Several configs are baked in an order in which those of one surface follow each other. One that fails does not
    stop the others. A table of all ends the run, with the exit code of the first CONFIG that failed.
    """
    bake_all(config_paths, out, store_root, as_json, until or "bundle", explains=explains)


@click.command("plan")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@console.store_option
@console.memory_option
@console.json_option
def plan_command(config_paths: tuple[Path, ...], store_root: Path | None, as_json: bool) -> None:
    """List what `run` would do: each stage, cached or to do, with predicted time, memory, bytes and error.

    Computes nothing of it. A first call measures the speed of this machine, in less than a second, and keeps it in
    the store; `run --explain` corrects it. The peak is that of the whole process; that of a table whose grid is still
    to be searched for may grow. Where `run` would refuse a stage for its memory, so does this, with exit code 4.
    """
    from pipeline.stages import run

    store = console.open_store(store_root)
    planned = plan_all(config_paths, store, "bundle")
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
        rows = [
            [
                s["stage"],
                s["state"],
                explain.seconds(s["seconds"]),
                explain.size(s["peak_bytes"]),
                explain.size(s["bytes"]),
                s["work"],
            ]
            for s in steps
        ]
        console.print_table(["stage", "state", "time", "peak", "bytes", "work"], rows)
        for step in steps:
            if step["state"] == "to do":
                console.say(f"{step['stage']}: {step['reason']}")
        _print_total([step for step in steps if step["state"] == "to do"])


def _print_total(steps: list[dict[str, Any]]) -> None:
    """Prints the predicted time of all that is to do, and the error of the table that is to be made."""
    if not steps or any(step["seconds"] is None for step in steps):
        return
    errors = [step["delta_e"] for step in steps if step["delta_e"] is not None]
    error = f", mean CIELAB error about {errors[0]:.2g}" if errors else ""
    console.say(f"in all: about {explain.seconds(sum(step['seconds'] for step in steps))}{error}")


def _explained(config: "Config", steps: "list[Step]", store: Any) -> list[dict[str, Any]]:
    """Lists every stage of a plan."""
    from pipeline.stages import run

    return [
        {
            "stage": step.stage.name,
            "key": step.key,
            "state": "cached" if step.cached else "to do",
            "reason": explanation.reason,
            "work": explanation.work,
            **explain.as_json(explanation),
        }
        for step, explanation in zip(steps, run.explain(config, steps, store), strict=True)
    ]
