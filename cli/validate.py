"""`validate`: tables against the exact sum."""

from pathlib import Path

import click

from cli import console
from cli.batch import bake_all


@click.command("validate")
@click.argument("config_paths", metavar="CONFIG...", type=click.Path(path_type=Path), nargs=-1, required=True)
@console.out_option
@console.store_option
@console.memory_option
@console.json_option
def validate_command(config_paths: tuple[Path, ...], out: Path, store_root: Path | None, as_json: bool) -> None:
    """Measure CONFIGs' tables against the exact sum and write OUT/NAME/report.html.

    On random directions: the relative error of |P|^2 and CIELAB errors at 1, 1000 and 7500 RU; on the maps of the
    config's lights: CIELAB errors and pictures; and how the error depends on terms, wavelength step and grid.
    """
    bake_all(config_paths, out, store_root, as_json, until="validate")
