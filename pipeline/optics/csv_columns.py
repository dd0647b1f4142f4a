"""CSV files of numbers over wavelength: a user's, and those in data/, each of which states its source."""

from importlib.resources import files

import numpy as np

from pipeline.arrays import Array
from pipeline.errors import InputError


def read_columns(data: bytes, columns: int, name: str) -> Array:
    """Parses a CSV of numbers; '#' starts a comment, and one header line may come first.

    data: the file's bytes, UTF-8. columns: how many it must have. name: of the file, for messages.
    Returns (rows, columns), the first column ascending.
    Raises InputError, which names the offending line.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{name}: expected a CSV of {columns} columns in UTF-8, got other bytes") from None
    rows: list[list[float]] = []
    header = False
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.split("#")[0].strip()
        if not content:
            continue
        try:
            row = [float(cell) for cell in content.replace(";", ",").split(",")]
        except ValueError:
            if rows or header:
                raise InputError(f"{name}: line {number}: expected {columns} numbers, got {content!r}") from None
            header = True
            continue
        if len(row) != columns or not np.all(np.isfinite(row)):
            raise InputError(f"{name}: line {number}: expected {columns} finite numbers, got {content!r}")
        rows.append(row)
    table = np.array(rows)
    if len(rows) < 2 or np.any(np.diff(table[:, 0]) <= 0):
        raise InputError(f"{name}: expected at least two rows with ascending wavelengths in the first column")
    return table


def shipped(file: str, columns: int) -> Array:
    """Reads a file of data/, (rows, columns)."""
    return read_columns(files("pipeline.optics").joinpath("data", file).read_bytes(), columns, file)
