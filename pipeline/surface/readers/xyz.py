"""Reads tables of x, y, z triples on a regular grid."""

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import check_shape, fault

# coordinates closer than this share of the field are one grid line, up to rounding errors
_SAME = 1e-5
# largest difference between the steps of a regular grid, relative to their mean
_EVEN = 0.01


def heights(file: str, table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arranges triples on their grid. Such files do not state the unit of x and y, so that the pitch is unknown.

    file: its name, for messages. table: x, y, z, (n, 3).
    Returns heights (ny, nx), y upwards, NaN where a point is missing.
    Raises InputError where the points do not lie on one regular grid.
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
    """Returns the index of each coordinate's grid line, ascending with the coordinate, and the number of lines."""
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
