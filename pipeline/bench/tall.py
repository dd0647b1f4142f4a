"""Which series outlives a tall surface: two cells of the stress sweep, white noise."""

from pipeline.stack import Basis
from pipeline.stress import sweep
from pipeline.stress.cell import Precision
from pipeline.stress.judging import judge

HEIGHT_UM, TAYLOR_HEIGHT_UM = 10.0, 2.0


def chebyshev_error() -> float | None:
    """Of E in float32, of heights of HEIGHT_UM."""
    return _error("height", "chebyshev", "float32", HEIGHT_UM)


def taylor_error() -> float | None:
    """Of Taylor's series in float64, of heights of TAYLOR_HEIGHT_UM."""
    return _error("height, series", "taylor", "float64", TAYLOR_HEIGHT_UM)


def _error(family: str, basis: Basis, precision: Precision, height_um: float) -> float | None:
    """The worst over max(truth, 1e-3 of the mean level); None where the cell came to none."""
    asked = family, basis, precision, height_um
    cells = sweep.cells(quick=True)
    return judge(next(c for c in cells if (c.family, c.basis, c.precision, c.height_um) == asked)).speckle
