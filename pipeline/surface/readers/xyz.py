"""Reads tables of x, y, z triples on a regular grid."""

from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.surface.readers.common import check_shape, fault

# coordinates closer than this share of the field are one grid line, up to rounding errors
_SAME = 1e-5
# largest distance of a coordinate from its regular grid, relative to the step, beyond the rounding of the print
_EVEN = 0.01
# largest share of the step that rounding may take where lines are found by their coordinates
_HIDES = 0.3
# fewest significant digits of coordinates that were rounded in print
_ROUNDED_DIGITS = 3
# of coordinates that a sensor measured: largest rms distance from the grid, and of a single point, in steps. A height
# that is taken for that of its grid point errs by slope times distance
_MOST_OFF, _FARTHEST = 0.05, 0.25
# gaps between the grid lines of such coordinates, in the widest gap
_GAP = 0.25
_MATRIX = "export a matrix"
# distinct coordinates that are looked at to find how many digits were printed
_LOOKED_AT = 10000


@dataclass(frozen=True)
class Grid:
    """Triples on their grid.

    heights: (ny, nx), y upwards, NaN where a point is missing. steps: distance of grid lines along (x, y), in the
    file's unit. y_down: whether the file's y grows downwards. warnings: sentences for the user.
    """

    heights: NDArray[np.float64]
    steps: tuple[float, float]
    y_down: bool
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Axis:
    """The index of each point's grid line, ascending with the coordinate, the number of lines and their distance.

    off: distance of each point from its line, in steps; None where it is rounding.
    """

    index: NDArray[np.intp]
    count: int
    step: float
    off: NDArray[np.float64] | None = None


def grid(file: str, table: NDArray[np.float64], gwyddion: bool) -> Grid:
    """Arranges triples on their grid.

    Gwyddion writes its rows from the top, with y growing downwards from row to row; all other triples have y upwards.
    Coordinates may be rounded in print: a regular grid of rounded coordinates is regular. Those that a sensor
    measured lie beside their grid, and are taken as its points where their distance is small, with a warning.

    file: its name, for messages. table: x, y, z, (n, 3). gwyddion: whether the text has the form that Gwyddion
        writes; its points must also follow each other row by row with y ascending.
    Raises InputError where the points do not lie on one regular grid.
    """
    for column, axis in enumerate("xy"):
        if not np.isfinite(table[:, column]).all():
            raise fault(file, f"finite {axis} coordinates", "NaN or infinity", "export it again")
    try:
        x, y, y_down = _regular(file, table, gwyddion)
    except InputError:
        measured = _measured_grid(file, table)
        if measured is None:
            raise
        x, y, y_down = *measured, False
    check_shape(file, (y.count, x.count))
    flat = y.index * x.count + x.index
    if np.unique(flat).size != flat.size or 2 * flat.size < x.count * y.count:
        found = f"{flat.size} points for {y.count} x {x.count}"
        raise fault(file, "x y z triples, one for each grid point", found, _MATRIX)
    points = np.full(y.count * x.count, np.nan)
    points[flat] = table[:, 2]
    heights = points.reshape(y.count, x.count)
    warnings = _warnings(heights, x, y)
    heights = np.ascontiguousarray(heights[::-1]) if y_down else heights
    return Grid(heights, (x.step, y.step), y_down, warnings)


def _regular(file: str, table: NDArray[np.float64], gwyddion: bool) -> tuple[_Axis, _Axis, bool]:
    """Finds the grid of coordinates that lie on one, and whether y grows downwards."""
    row_length = _row_length(table)
    if row_length is None:
        return _axis_of_points(file, "x", table[:, 0]), _axis_of_points(file, "y", table[:, 1]), False
    x = _axis_of_rows(file, "x", table[:row_length, 0])
    y = _axis_of_rows(file, "y", table[::row_length, 1])
    y_down = bool(gwyddion and y.index[0] == 0)
    return (
        _Axis(np.tile(x.index, y.count), x.count, x.step),
        _Axis(np.repeat(y.index, x.count), y.count, y.step),
        y_down,
    )


def _measured_grid(file: str, table: NDArray[np.float64]) -> tuple[_Axis, _Axis] | None:
    """Finds the grid of coordinates that a sensor measured; None where they are no such ones.

    Raises InputError where they are, and lie too far from their grid.
    """
    x, y = (_measured_axis(table[:, column]) for column in (0, 1))
    if x is None or y is None:
        return None
    rms, largest = _off(x, y)
    if rms <= _MOST_OFF and largest <= _FARTHEST:
        return x, y
    # coordinates that were computed repeat
    if 4 * np.unique(table[:, 0]).size <= 3 * len(table):
        return None
    raise fault(
        file,
        f"points of a regular grid, to {100 * _MOST_OFF:g} % of its step (rms)",
        f"some off by {100 * rms:.2g} % rms, {100 * largest:.2g} % at most",
        "interpolate them to a grid (in Gwyddion: XYZ data, Rasterize) and export a matrix",
    )


def _measured_axis(values: NDArray[np.float64]) -> _Axis | None:
    """Finds the grid lines of coordinates that a sensor measured, by the gaps between them; None without gaps."""
    order = np.argsort(values)
    gaps = np.diff(values[order])
    wide = gaps > _GAP * gaps.max()
    line = np.concatenate(([0], np.cumsum(wide)))
    means = np.bincount(line, values[order]) / np.bincount(line)
    # each line holds many points, and none is missing, or there are no lines
    steps = np.diff(means)
    if means.size < 2 or 2 * means.size > values.size or steps.max() > 1.5 * steps.min():
        return None
    index = np.arange(means.size) - 0.5 * (means.size - 1)
    step = float(index @ means / (index @ index))
    origin = float(means.mean()) + step * float(index[0])
    of_point = np.empty(values.size, np.intp)
    of_point[order] = line
    return _Axis(of_point, means.size, step, (values - origin) / step - of_point)


def _off(x: _Axis, y: _Axis) -> tuple[float, float]:
    """Returns rms and largest distance from the grid, of the axis where it is larger, in steps."""
    off = [axis.off for axis in (x, y) if axis.off is not None]
    if not off:
        return 0.0, 0.0
    return max(float(np.sqrt(np.mean(each**2))) for each in off), max(float(np.abs(each).max()) for each in off)


def _warnings(heights: NDArray[np.float64], x: _Axis, y: _Axis) -> tuple[str, ...]:
    """Tells how far measured points lie from the grid, and what taking them as its points does to the heights."""
    if x.off is None or y.off is None:
        return ()
    rms, largest = _off(x, y)
    slope_y, slope_x = np.asarray(np.gradient(heights))
    error = slope_x[y.index, x.index] * x.off + slope_y[y.index, x.index] * y.off
    share = float(np.sqrt(np.nanmean(error**2)) / np.nanstd(heights)) if np.nanstd(heights) > 0 else 0.0
    told = f"points lie beside their grid by {100 * rms:.2g} % of its step (rms; at most {100 * largest:.2g} %)"
    return (f"{told} and are taken as its points, which changes heights by {100 * share:.2g} % of their rms",)


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
        raise fault(file, "three columns that are points of a regular grid", found, _MATRIX)
    return step


def _rounding(lines: NDArray[np.float64]) -> float:
    """Returns the unit of the last digit printed of the largest coordinate; 0 where coordinates are not rounded."""
    looked_at = lines[:: max(1, lines.size // _LOOKED_AT)]
    printed = [Decimal(repr(float(value))).normalize().as_tuple() for value in looked_at if value]
    digits = max((len(number.digits) for number in printed), default=0)
    leading = max((len(number.digits) + int(number.exponent) for number in printed), default=0)
    # integers, and numbers of one or two digits, are exact
    return 10.0 ** (leading - digits) if digits >= _ROUNDED_DIGITS and digits > leading else 0.0
