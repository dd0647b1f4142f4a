"""Reads tables of x, y, z triples on a regular grid."""

from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import check_shape, fault

# coordinates closer than this share of the field are one grid line, up to rounding errors
_SAME = 1e-5
# largest distance of a coordinate from its regular grid, relative to the step, beyond the rounding of the print
_EVEN = 0.01
# largest share of the step that rounding may take where lines are found by their coordinates
_HIDES = 0.3
# fewest significant digits of coordinates that were rounded in print
_ROUNDED_DIGITS = 3
# distinct coordinates that are looked at to find how many digits were printed
_LOOKED_AT = 10000


@dataclass(frozen=True)
class Grid:
    """Triples on their grid.

    heights: (ny, nx), y upwards, NaN where a point is missing. steps: distance of grid lines along (x, y), in the
    file's unit. y_down: whether the file's y grows downwards.
    """

    heights: NDArray[np.float64]
    steps: tuple[float, float]
    y_down: bool


@dataclass(frozen=True)
class _Axis:
    """The index of each point's grid line, ascending with the coordinate, the number of lines and their distance."""

    index: NDArray[np.intp]
    count: int
    step: float


def grid(file: str, table: NDArray[np.float64], gwyddion: bool) -> Grid:
    """Arranges triples on their grid.

    Gwyddion writes its rows from the top, with y growing downwards from row to row; all other triples have y upwards.
    Coordinates may be rounded in print: a regular grid of rounded coordinates is regular.

    file: its name, for messages. table: x, y, z, (n, 3). gwyddion: whether the text has the form that Gwyddion
        writes; its points must also follow each other row by row with y ascending.
    Raises InputError where the points do not lie on one regular grid.
    """
    for column, axis in enumerate("xy"):
        if not np.isfinite(table[:, column]).all():
            raise fault(file, f"finite {axis} coordinates", "NaN or infinity", "export it again")
    row_length = _row_length(table)
    if row_length is not None:
        x = _axis_of_rows(file, "x", table[:row_length, 0])
        y = _axis_of_rows(file, "y", table[::row_length, 1])
        x_index = np.tile(x.index, y.count)
        y_index = np.repeat(y.index, x.count)
        y_down = gwyddion and y.index[0] == 0
    else:
        x, y = _axis_of_points(file, "x", table[:, 0]), _axis_of_points(file, "y", table[:, 1])
        x_index, y_index, y_down = x.index, y.index, False
    check_shape(file, (y.count, x.count))
    flat = y_index * x.count + x_index
    if np.unique(flat).size != flat.size or 2 * flat.size < x.count * y.count:
        found = f"{flat.size} points for {y.count} x {x.count}"
        raise fault(file, "x y z triples, one for each grid point", found, "export a matrix")
    points = np.full(y.count * x.count, np.nan)
    points[flat] = table[:, 2]
    heights = points.reshape(y.count, x.count)
    return Grid(np.ascontiguousarray(heights[::-1]) if y_down else heights, (x.step, y.step), y_down)


def _row_length(table: NDArray[np.float64]) -> int | None:
    """Returns the length of the rows where complete rows follow each other, x ascending; else None."""
    falls = np.flatnonzero(np.diff(table[:, 0]) < 0)
    n = int(falls[0]) + 1 if falls.size else 0
    if n < 2 or table.shape[0] % n or table.shape[0] // n < 2:
        return None
    x, y = table[:, 0].reshape(-1, n), table[:, 1].reshape(-1, n)
    # a coordinate that is printed once and again is the same number
    return n if (x == x[0]).all() and (y == y[:, :1]).all() else None


def _axis_of_rows(file: str, axis: str, lines: NDArray[np.float64]) -> _Axis:
    """Takes the grid lines in their order; neighbours may be printed alike, where few digits were printed."""
    order = np.arange(lines.size)
    descending = bool(lines[-1] < lines[0])
    ascending = lines[::-1] if descending else lines
    step = _step(file, axis, ascending, _rounding(ascending))
    return _Axis(order[::-1] if descending else order, lines.size, step)


def _axis_of_points(file: str, axis: str, values: NDArray[np.float64]) -> _Axis:
    """Finds the grid lines of points in any order."""
    distinct = np.unique(values)
    span = float(distinct[-1] - distinct[0])
    lines = distinct[np.concatenate(([True], np.diff(distinct) > _SAME * span))]
    # a rounding near the step would hide a missing line
    rounding = _rounding(lines)
    rounding = rounding if rounding * lines.size < _HIDES * span else 0.0
    step = _step(file, axis, lines, rounding)
    return _Axis(np.searchsorted(lines, values, side="right") - 1, int(lines.size), step)


def _step(file: str, axis: str, lines: NDArray[np.float64], rounding: float) -> float:
    """Returns the distance of regular grid lines, fitted; raises InputError where they are not regular."""
    if lines.size < 2:
        return 0.0
    index = np.arange(lines.size) - 0.5 * (lines.size - 1)
    middle = float(lines.mean())
    step = float(index @ (lines - middle) / (index @ index))
    off = float(np.abs(lines - middle - step * index).max())
    if step <= 0 or off > _EVEN * step + 0.75 * rounding:
        steps = np.diff(lines)
        found = f"steps along {axis} from {steps.min():.4g} to {steps.max():.4g}"
        raise fault(file, "three columns that are points of a regular grid", found, "export a matrix")
    return step


def _rounding(lines: NDArray[np.float64]) -> float:
    """Returns the unit of the last digit printed of the largest coordinate; 0 where coordinates are not rounded."""
    looked_at = lines[:: max(1, lines.size // _LOOKED_AT)]
    printed = [Decimal(repr(float(value))).normalize().as_tuple() for value in looked_at if value]
    digits = max((len(number.digits) for number in printed), default=0)
    leading = max((len(number.digits) + int(number.exponent) for number in printed), default=0)
    # integers, and numbers of one or two digits, are exact
    return 10.0 ** (leading - digits) if digits >= _ROUNDED_DIGITS and digits > leading else 0.0
