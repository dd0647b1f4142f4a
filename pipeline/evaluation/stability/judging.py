"""What each way promises, what a cell comes to, and where Taylor dies and Chebyshev does not."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.diffraction import expansion
from pipeline.diffraction.dft_stack import Basis
from pipeline.errors import AccuracyError, BakeError
from pipeline.evaluation.stability import device_ways
from pipeline.evaluation.stability.cell import Cell, Precision, Way
from pipeline.evaluation.stability.device_ways import TAYLOR_TOLERANCE
from pipeline.evaluation.stability.reading import NO_DIGITS, Reading
from pipeline.evaluation.stability.series_way import in_memory
from pipeline.evaluation.stability.sweep import TALLEST_UM, TAYLOR_ENDS_UM
from pipeline.evaluation.stability.table_way import TABLE_DELTA_E, table_error
from pipeline.optics.coherence import folded_window
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

Verdict = Literal["ok", "refused", "wrong"]

# of the mean level: nodes darker than this are held to an absolute error
_DARK_SHARE = 1e-3
CHEBYSHEV_TOLERANCE = 1e-4
_REFERENCE_TOLERANCE = 1e-9
# means over two sets of a thousand directions differ by so much
_SAMPLING = 1.25

_READINGS: dict[tuple[Way, Basis, Precision], Callable[[Cell, HeightField], list[Reading]]] = {
    ("series", "taylor", "float32"): in_memory,
    ("series", "taylor", "float64"): in_memory,
    ("series", "chebyshev", "float32"): in_memory,
    ("series", "chebyshev", "float64"): in_memory,
    ("device", "taylor", "float32"): device_ways.taylor_tables,
    ("device", "chebyshev", "float32"): device_ways.polar_power,
    ("device", "chebyshev", "float64"): device_ways.reference,
}


@dataclass(frozen=True)
class Promise:
    """A way keeps |found - truth| / max(truth, floor) <= error; for a table, the mean CIELAB error."""

    error: float
    floor: float


@dataclass(frozen=True)
class Outcome:
    """What a cell came to.

    error: the worst found, as its promise measures; None where a refusal came first. promised: the most it may be.
    speckle: the worst error over max(truth, 1e-3 of the mean level); None of tables and where nothing was measured.
    message: a refusal's, or an internal fault's.
    """

    cell: Cell
    verdict: Verdict
    error: float | None
    promised: float
    speckle: float | None
    message: str


def mean_level(field: HeightField, sigma_um: float) -> float:
    """Mean of |P|^2 over the scan's band, sum g^2 / (sum g)^2 with g folded into the patch (Parseval; |p| = 1)."""
    (ny, nx), (px, py) = field.shape, field.pitch_um
    along = (np.abs(folded_window(n, pitch, sigma_um, 0.0)) for n, pitch in ((nx, px), (ny, py)))
    return float(np.prod([np.sum(g**2) / np.sum(g) ** 2 for g in along]))


def promise(cell: Cell, field: HeightField) -> Promise:
    """What a cell's way promises: the Taylor plan's, the reference's, float32 speckle's, or the table's budget."""
    if cell.way == "table":
        return Promise(_SAMPLING * TABLE_DELTA_E, 1.0)
    if cell.basis == "taylor":
        return Promise(TAYLOR_TOLERANCE, expansion.MIRROR_SHARE)
    if cell.precision == "float64":
        return Promise(_REFERENCE_TOLERANCE, 1.0)
    return Promise(CHEBYSHEV_TOLERANCE, _DARK_SHARE * mean_level(field, cell.sigma_um))


def judge(cell: Cell) -> Outcome:
    """Runs one cell. Raises DeviceError where no device works; every other fault is the cell's outcome."""
    field = cell.field()
    promised = promise(cell, field)
    error = speckle = None
    try:
        if cell.way == "table":
            error = table_error(cell, field)
        else:
            readings = _READINGS[cell.way, cell.basis, cell.precision](cell, field)
            error, speckle = (
                max(reading.worst(floor) for reading in readings)
                for floor in (promised.floor, _DARK_SHARE * mean_level(field, cell.sigma_um))
            )
            if cell.basis == "taylor":
                device_ways.plan_taylor(field)
    except AccuracyError as refusal:
        return Outcome(cell, "refused", error, promised.error, speckle, str(refusal))
    except BakeError:
        raise
    except Exception as fault:
        # a crash is no refusal: nobody is told what to do
        return Outcome(cell, "wrong", NO_DIGITS, promised.error, None, f"{type(fault).__name__}: {fault}")
    return Outcome(cell, "ok" if error <= promised.error else "wrong", error, promised.error, speckle, "")


def sweep(cells: Sequence[Cell], progress: Progress = silent) -> list[Outcome]:
    """All cells, one after the other."""
    outcomes = []
    for done, cell in enumerate(cells, 1):
        outcomes.append(judge(cell))
        progress("stress", done / len(cells))
    return outcomes


@dataclass(frozen=True)
class Criterion:
    """Errors over max(local value, 1e-3 of the mean level): Chebyshev float32 at 10 um, Taylor float64 at 2 um."""

    chebyshev_float32_at_10_um: float
    taylor_float64_at_2_um: float

    @property
    def met(self) -> bool:
        """Chebyshev in single precision holds where Taylor in double has long failed."""
        return self.chebyshev_float32_at_10_um <= CHEBYSHEV_TOLERANCE < self.taylor_float64_at_2_um


def criterion(outcomes: Sequence[Outcome]) -> Criterion:
    """The worst of the height family's cells, in memory and on the device."""

    def worst(basis: str, precision: str, height_um: float) -> float:
        return max(
            outcome.speckle
            for outcome in outcomes
            if outcome.speckle is not None
            and outcome.cell.family.startswith("height")
            and (outcome.cell.basis, outcome.cell.precision, outcome.cell.height_um) == (basis, precision, height_um)
        )

    return Criterion(worst("chebyshev", "float32", TALLEST_UM), worst("taylor", "float64", TAYLOR_ENDS_UM))
