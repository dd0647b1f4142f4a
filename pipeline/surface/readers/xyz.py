"""Tables of x, y, z triples that fill a regular grid."""

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import check_shape, fault

# coordinates closer than this share of the field are one grid line, written with rounding errors
_SAME = 1e-5
# a regular grid's steps differ by no more than this share
_EVEN = 0.01


def heights(file: str, table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights (ny, nx), y up with the coordinate, NaN where a point is missing; `table` is (n, 3).

    The unit of x and y is not stated in such files, so no pitch comes of them. Raises InputError where
    the points do not lie on one regular grid.
    """
    column, nx = _grid_lines(file, "x", table[:, 0])
    row, ny = _grid_lines(file, "y", table[:, 1])
    check_shape(file, (ny, nx))
    flat = row * nx + column
    if np.unique(flat).size != flat.size or 2 * flat.size < nx * ny:
        found = f"{flat.size} points for {ny} x {nx}"
        raise fault(file, "x y z triples, one for each grid point", found, "export a matrix")
    grid = np.full(ny * nx, np.nan)
    grid[flat] = table[:, 2]
    return grid.reshape(ny, nx)


def _grid_lines(file: str, axis: str, values: NDArray[np.float64]) -> tuple[NDArray[np.intp], int]:
    """For each value the number of its grid line, from the smallest on, and how many lines there are."""
    if not np.isfinite(values).all():
        raise fault(file, f"finite {axis} coordinates", "NaN or infinity", "export it again")
    distinct = np.unique(values)
    span = float(distinct[-1] - distinct[0])
    lines = distinct[np.concatenate(([True], np.diff(distinct) > _SAME * span))]
    steps = np.diff(lines)
    if steps.size and float(np.ptp(steps)) > _EVEN * float(steps.mean()):
        found = f"steps along {axis} from {steps.min():.4g} to {steps.max():.4g}"
        raise fault(file, "three columns that are points of a regular grid", found, "export a matrix")
    return np.searchsorted(lines, values, side="right") - 1, int(lines.size)
