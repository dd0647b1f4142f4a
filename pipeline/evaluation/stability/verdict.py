"""Tolerance of each algorithm, verdict of each test case, and the Taylor / Chebyshev criterion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.diffraction import expansion
from pipeline.diffraction.dft_stack import Basis
from pipeline.errors import AccuracyError, BakeError
from pipeline.evaluation.check import Check, Relation
from pipeline.evaluation.stability import algorithms
from pipeline.evaluation.stability.algorithms import (
    NO_DIGITS,
    TABLE_DELTA_E,
    TAYLOR_TOLERANCE,
    Measurement,
    table_error,
)
from pipeline.evaluation.stability.sweep import TALLEST_UM, TAYLOR_FAILS_UM, Precision, StressCase
from pipeline.optics.coherence import folded_window
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

CHEBYSHEV_TOLERANCE = 1e-4
_REFERENCE_TOLERANCE = 1e-9
# of the mean level: darker nodes are compared in absolute terms
_DARK_SHARE = 1e-3
# ratio of means over two sets of a thousand directions
_SAMPLING = 1.25

_ON_DEVICE: dict[tuple[Basis, Precision], Callable[[StressCase, HeightField], list[Measurement]]] = {
    ("taylor", "float32"): algorithms.taylor_tables,
    ("chebyshev", "float32"): algorithms.polar_power,
    ("chebyshev", "float64"): algorithms.reference,
}


@dataclass(frozen=True)
class Tolerance:
    """The bound |found - truth| / max(truth, floor) <= error; for a table, of the mean CIELAB error."""

    error: float
    floor: float


@dataclass(frozen=True)
class Outcome:
    """The result of a case.

    check: the largest error as the tolerance measures it; without a bound where the case was refused, and without a
    value where a refusal came first. Its remark is the message of a refusal or of an internal fault. tolerance: the
    bound. speckle_error: the largest error over max(truth, 1e-3 of the mean level); None for tables and where nothing
    was measured.
    """

    case: StressCase
    check: Check
    tolerance: float
    speckle_error: float | None

    @property
    def verdict(self) -> str:
        """The check's verdict, or "refused"."""
        return self.check.verdict if self.check.bound is not None else "refused"


def mean_level(field: HeightField, sigma_um: float) -> float:
    """Return the mean of |P|^2 below Nyquist: sum g^2 / (sum g)^2, g folded into the patch (Parseval; |p| = 1)."""
    (ny, nx), (px, py) = field.shape, field.pitch_um
    along = (np.abs(folded_window(n, pitch, sigma_um, 0.0)) for n, pitch in ((nx, px), (ny, py)))
    return float(np.prod([np.sum(g**2) / np.sum(g) ** 2 for g in along]))


def tolerance_of(case: StressCase, field: HeightField) -> Tolerance:
    """Return the Taylor plan's tolerance, the reference's, float32 speckle's, or the table's budget."""
    if case.algorithm == "table":
        return Tolerance(_SAMPLING * TABLE_DELTA_E, 1.0)
    if case.basis == "taylor":
        return Tolerance(TAYLOR_TOLERANCE, expansion.MIRROR_SHARE)
    if case.precision == "float64":
        return Tolerance(_REFERENCE_TOLERANCE, 1.0)
    return Tolerance(CHEBYSHEV_TOLERANCE, _DARK_SHARE * mean_level(field, case.sigma_um))


def judge(case: StressCase) -> Outcome:
    """Run one case. Raises DeviceError where no device works; every other fault is the outcome of the case."""
    field = case.field()
    tolerance = tolerance_of(case, field)
    error = speckle_error = None
    refused, message = False, ""
    try:
        if case.algorithm == "table":
            error = table_error(case, field)
        else:
            in_memory = case.algorithm == "series"
            measure = algorithms.in_memory if in_memory else _ON_DEVICE[case.basis, case.precision]
            measured = measure(case, field)
            floors = (tolerance.floor, _DARK_SHARE * mean_level(field, case.sigma_um))
            error, speckle_error = (max(each.worst(floor) for each in measured) for floor in floors)
            if case.basis == "taylor":
                algorithms.plan_taylor(field)
    except AccuracyError as refusal:
        refused, message = True, str(refusal)
    except BakeError:
        raise
    except Exception as fault:
        # a crash is no refusal: its message does not say what to do
        error, speckle_error, message = NO_DIGITS, None, f"{type(fault).__name__}: {fault}"
    bound = None if refused else tolerance.error
    check = Check(f"stability.{case.id}", str(case), error, "<=", bound, source="tolerance", remark=message)
    return Outcome(case, check, tolerance.error, speckle_error)


def sweep(cases: Sequence[StressCase], progress: Progress = silent) -> list[Outcome]:
    """Run all cases, one after the other."""
    outcomes = []
    for done, case in enumerate(cases, 1):
        outcomes.append(judge(case))
        progress("stress", done / len(cases))
    return outcomes


def criterion(outcomes: Sequence[Outcome]) -> list[Check]:
    """Return the worst errors over max(|P|^2, 1e-3 of its mean) of white noise, in memory and on the device.

    Chebyshev in single precision must hold at 10 um where Taylor in double precision has failed at 2 um.
    """

    def worst(basis: Basis, precision: Precision, height_um: float) -> float:
        return max(
            outcome.speckle_error
            for outcome in outcomes
            if outcome.speckle_error is not None
            and outcome.case.family.startswith("height")
            and (outcome.case.basis, outcome.case.precision, outcome.case.height_um) == (basis, precision, height_um)
        )

    def check(basis: Basis, precision: Precision, height_um: float, relation: Relation, remark: str) -> Check:
        name = f"stability.{basis}_{precision}_at_{height_um:g}_um"
        what, error = f"{basis.capitalize()} {precision} at {height_um:g} um", worst(basis, precision, height_um)
        return Check(name, what, error, relation, CHEBYSHEV_TOLERANCE, source="criterion 5", remark=remark)

    return [
        check("chebyshev", "float32", TALLEST_UM, "<=", "worst error"),
        check("taylor", "float64", TAYLOR_FAILS_UM, ">", "worst error: the series has failed"),
    ]
