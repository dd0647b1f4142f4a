"""`stress`: every way to |P|^2 over the whole span of surfaces, each cell with its digits or a refusal."""

import csv
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from cli import console


@click.command("stress")
@click.option("--quick", is_flag=True, help="A part of the sweep that takes seconds.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("out/stress"),
    show_default=True,
    help="Folder for stress.json, stress.csv and stress.png.",
)
@console.json_option
def stress_command(quick: bool, out: Path, as_json: bool) -> None:
    """Hold every method against plain sums over samples, from 1 nm to 10 um of height.

    Surfaces, pitches, sizes, windows and directions at their extremes, in float32 and float64, Taylor and Chebyshev.
    A cell is ok where its error is within what its method promises, or refused with a reason. Exit code 4 where
    any is neither.
    """
    from pipeline.errors import AccuracyError
    from pipeline.evaluation.plots import stress_plots
    from pipeline.evaluation.stability import judging, sweep
    from pipeline.store import scratch

    with console.showing_progress() as progress:
        outcomes = judging.sweep(sweep.cells(quick), progress)
    criterion = judging.criterion(outcomes)
    cells = [asdict(outcome) for outcome in outcomes]
    document = {"cells": cells, "criterion": asdict(criterion)}
    with scratch.replacing(out) as folder:
        (folder / "stress.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
        _write_csv(folder / "stress.csv", cells)
        (folder / "stress.png").write_bytes(stress_plots.error_by_height(outcomes))
    if as_json:
        console.print_json(document)
    else:
        _tell(outcomes, criterion, out)
    wrong = [outcome for outcome in outcomes if outcome.verdict == "wrong"]
    if wrong:
        raise AccuracyError("\n".join(_fault(outcome) for outcome in wrong))
    if not criterion.met:
        raise AccuracyError("Chebyshev float32 at 10 um was to hold where Taylor float64 has failed at 2 um")


def _write_csv(path: Path, cells: list[dict[str, Any]]) -> None:
    """One row a cell; pairs as `ny x nx` and `x x y`."""
    rows = [{**row.pop("cell"), **row} for row in (dict(cell) for cell in cells)]
    for row in rows:
        row.update({name: " x ".join(map(str, row[name])) for name in ("shape", "pitch_um")})
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _tell(outcomes: list[Any], criterion: Any, out: Path) -> None:
    """One row a family, and the sentence that the sweep is for."""
    rows = []
    for family in dict.fromkeys(outcome.cell.family for outcome in outcomes):
        here = [outcome for outcome in outcomes if outcome.cell.family == family]
        counts = [str(sum(outcome.verdict == verdict for outcome in here)) for verdict in ("ok", "refused", "wrong")]
        shares = [outcome.error / outcome.promised for outcome in here if outcome.verdict != "refused"]
        rows.append([family, *counts, f"{100.0 * max(shares):.2g} %" if shares else ""])
    console.print_table(["family", "ok", "refused", "wrong", "worst error, of what is promised"], rows)
    click.echo(
        f"Chebyshev float32 at 10 um: {criterion.chebyshev_float32_at_10_um:.1e}, Taylor float64 at 2 um: "
        f"{criterion.taylor_float64_at_2_um:.1e}\n"
        "(worst error of |P|^2 over the larger of it and a thousandth of its mean)"
    )
    click.echo(f"every cell: {out / 'stress.csv'}, picture: {out / 'stress.png'}")


def _fault(outcome: Any) -> str:
    """One line on a cell that is neither right nor refused."""
    cell = outcome.cell
    size, pitch = " x ".join(map(str, cell.shape)), " x ".join(map(str, cell.pitch_um))
    found = outcome.message or f"errs by {outcome.error:.1e}, promised {outcome.promised:.1e}"
    return (
        f"{cell.way}, {cell.basis} {cell.precision}, {cell.kind} of {cell.height_um:g} um, {size} samples of "
        f"{pitch} um, sigma {cell.sigma_um:g} um: {found}"
    )
