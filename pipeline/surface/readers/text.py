"""Reads text files: rows of numbers, the first row at the top, with or without a header that states units."""

import codecs
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers import xyz
from pipeline.surface.readers.common import (
    check_shape,
    fault,
    library_version,
    micrometres,
    one_line,
    pick_channel,
    third_party,
)
from pipeline.surface.scan import Scan

_NUMBER = re.compile(r"[-+]?(\d|\.\d|nan\b|inf)", re.IGNORECASE)
_QUANTITY = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*)")
_KEY_VALUE = re.compile(r"([^:=]+)[:=](.*)")
_PIXEL_UNITS = ("", "px", "pixel", "pixels")

# header keys, lower case: Gwyddion's ASCII export, and the export with 'Real Width' and 'Image Width'
_WIDTH = ("width", "real width")
_HEIGHT = ("height", "real height")
_COLUMNS = ("image width",)
_ROWS = ("image height",)
_VALUE_UNIT = ("value units", "z unit")
_NAME = ("channel", "name")


@dataclass(frozen=True)
class _Lines:
    """The header of a text file, by key in lower case, and its rows of numbers as text."""

    header: dict[str, str]
    rows: list[str]

    def first(self, keys: tuple[str, ...]) -> str | None:
        """Returns the value of the first of these keys that the header has."""
        return next((self.header[key] for key in keys if key in self.header), None)


def read(path: Path, channel: str | None) -> Scan:
    """Reads a matrix, a flat list with the image's width and height in the header, or complete x y z triples.

    Matrices and lists are flipped, because their first row is the top. Raises InputError for anything but numbers,
    for rows of different lengths, and for a single column or row without a width.
    """
    lines = _split(path, _decode(path.read_bytes()))
    separator, rows = _separated(path, lines.rows)
    with third_party(path.name, "rows of equally many numbers", "numpy"):
        table = np.loadtxt(rows, dtype=np.float64, delimiter=separator, comments=None, ndmin=2)
    if table.shape[1] == 3 and table.shape[0] > 3:
        heights = xyz.heights(path.name, table)
    else:
        heights = np.ascontiguousarray(_matrix(path, lines, table)[::-1])
    check_shape(path.name, heights.shape)
    name = lines.first(_NAME) or "data"
    pick_channel(path.name, [name], channel)
    form = "text with a header" if lines.header else "text"
    unit, pitch = _value_unit(path, lines), _pitch(path, lines, heights.shape)
    return Scan(heights, unit, pitch, None, name, (name,), form, library_version("numpy"))


def _decode(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # instruments on Windows write the micro sign in one byte
        return data.decode("latin-1")


def _split(path: Path, content: str) -> _Lines:
    header: dict[str, str] = {}
    rows: list[str] = []
    for number, line in enumerate(content.splitlines(), start=1):
        stripped = line.strip()
        if not stripped:
            continue
        if _NUMBER.match(stripped):
            rows.append(stripped.rstrip(",;"))
            continue
        entry = _KEY_VALUE.match(stripped.lstrip("# "))
        if not stripped.startswith("#") and (rows or entry is None):
            found = f"{one_line(stripped, 40)!r} in line {number}"
            raise fault(path.name, "numbers", found, "remove that line, or begin it with '#'")
        if entry is not None:
            header.setdefault(entry[1].strip().lower(), entry[2].strip())
    if not rows:
        raise fault(path.name, "a matrix of heights", "no numbers", "export the height data again")
    return _Lines(header, rows)


def _separated(path: Path, rows: list[str]) -> tuple[str | None, list[str]]:
    """Returns the separator of the numbers (None: white space), and the rows with decimal points."""
    separator, decimal_comma = _separator(path, rows[0])
    return separator, [row.replace(",", ".") for row in rows] if decimal_comma else rows


def _separator(path: Path, row: str) -> tuple[str | None, bool]:
    """Returns the separator of a row's numbers (None: white space), and whether a comma is the decimal point."""
    if ";" in row:
        return ";", True
    if "\t" in row:
        return None, True
    if "," not in row:
        return None, False
    if re.search(r"\d,\d", row) and re.search(r"\d\s+[-+.\d]", row):
        # '1,5 2,5' is two numbers to some and three to others
        found = f"both in {one_line(row, 40)!r}"
        raise fault(path.name, "numbers separated by commas or by blanks", found, "write decimal points")
    return ",", False


def _matrix(path: Path, lines: _Lines, table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the numbers in the shape of the image, top row first."""
    columns, rows = _count(lines, _COLUMNS), _count(lines, _ROWS)
    if columns is None or rows is None:
        if 1 in table.shape:
            form = "row" if table.shape[0] == 1 else "column"
            raise fault(
                path.name,
                "a matrix, or a list with 'Image Width' and 'Image Height' in its header",
                f"a single {form} of {table.size} numbers and no width",
                "add these two lines, or export a matrix",
            )
        return table
    if table.size != rows * columns or (1 not in table.shape and table.shape != (rows, columns)):
        found = f"{table.shape[0]} x {table.shape[1]} numbers"
        raise fault(path.name, f"{rows} x {columns} numbers, as its header says", found, "export it again")
    return table.reshape(rows, columns)


def _count(lines: _Lines, keys: tuple[str, ...]) -> int | None:
    value = lines.first(keys)
    return int(value) if value is not None and value.isdecimal() else None


def _value_unit(path: Path, lines: _Lines) -> float | None:
    unit = lines.first(_VALUE_UNIT)
    if not unit:
        return None
    scale = micrometres(unit)
    if scale is None:
        raise fault(path.name, "heights in a unit of length", f"values in {unit!r}", "export the height channel")
    return scale


def _pitch(path: Path, lines: _Lines, shape: tuple[int, ...]) -> tuple[float, float] | None:
    """Computes the pitch along (x, y), um, from the size of the field; None where the header does not state it."""
    width, height = _length(path, lines, _WIDTH), _length(path, lines, _HEIGHT)
    if width is None or height is None:
        return None
    return width / shape[1], height / shape[0]


def _length(path: Path, lines: _Lines, keys: tuple[str, ...]) -> float | None:
    value = lines.first(keys)
    quantity = _QUANTITY.fullmatch(value) if value is not None else None
    if quantity is None or quantity[2] in _PIXEL_UNITS:
        return None
    scale = micrometres(quantity[2])
    if scale is None:
        raise fault(path.name, "a field in a unit of length", f"'{keys[0]}: {value}'", "correct the header")
    return float(quantity[1]) * scale
