"""`eval`: radiance for pairs of directions."""

import sys
from pathlib import Path
from typing import Any

import click

from cli import console, sources


@click.command("eval")
@click.argument("source", type=click.Path(path_type=Path, exists=True))
@click.option(
    "--directions",
    type=click.Path(path_type=Path, allow_dash=True),
    required=True,
    help="CSV with rows of theta_i,phi_i,theta_r,phi_r in degrees; '-' reads stdin.",
)
@click.option("--exact", is_flag=True, help="Use the exact reference instead of the table (configs only).")
@click.option(
    "--wavelengths",
    help='In nm, as 450,550,650: print |P|^2 at each instead of X,Y,Z (configs whose table.form is "spectral").',
)
@console.store_option
@console.memory_option
@console.json_option
def eval_command(
    source: Path, directions: Path, exact: bool, wavelengths: str | None, store_root: Path | None, as_json: bool
) -> None:
    """Print X,Y,Z for rows of directions, from SOURCE: a bundle's folder or a config.

    They are a BRDF times cos(theta_i) in 1/sr, or in RU where material.normalisation is "relative".

    Directions point away from the surface; theta is measured from its normal, phi from +x. At and below the horizon,
    theta >= 90, nothing is reflected.
    """
    import numpy as np

    asked = None if wavelengths is None else _read_wavelengths(wavelengths)
    wi, wr = _unit_vectors(_read_directions(directions))
    with console.showing_progress() as progress:
        if asked is None:
            columns = ["X", "Y", "Z"]
            values = sources.evaluator(source, exact, store_root, progress)(wi, wr)
        else:
            columns = [f"I_{nm:g}" for nm in asked]
            values = sources.spectral_evaluator(source, exact, store_root, progress)(wi, wr, np.array(asked))
    sources.refuse_unreached(values, str(directions), str(source))
    if asked is None:
        values = sources.without_negative(values, f"rows of {directions}")
    if as_json:
        console.print_json([dict(zip(columns, map(float, row), strict=True)) for row in values])
        return
    console.say(",".join(columns))
    for row in values:
        console.say(",".join(f"{value:.12g}" for value in row))


def _read_wavelengths(text: str) -> list[float]:
    from pipeline.optics.light import LONGEST_NM, SHORTEST_NM

    try:
        found = [float(cell) for cell in text.split(",")]
    except ValueError:
        found = [0.0]
    if not all(SHORTEST_NM <= nm <= LONGEST_NM for nm in found):
        limits = f"{SHORTEST_NM:g}..{LONGEST_NM:g}"
        raise click.UsageError(f"--wavelengths: expected nm within {limits}, as 450,550, got {text!r}")
    return found


def _read_directions(path: Path) -> Any:
    """Reads rows of four angles in degrees (directions, 4), as a bundle's evaluate.py does; "-" is stdin.

    Raises InputError, which names the offending line.
    """
    from pipeline.bundle.evaluator import read_directions
    from pipeline.errors import InputError

    try:
        text = sys.stdin.read().removeprefix("\ufeff") if str(path) == "-" else path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text ({error})") from None
    try:
        return read_directions(text)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _unit_vectors(rows: Any) -> tuple[Any, Any]:
    from pipeline.bundle.evaluator import direction

    return direction(rows[:, 0], rows[:, 1]), direction(rows[:, 2], rows[:, 3])
