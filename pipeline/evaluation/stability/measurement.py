"""|P|^2 of an algorithm and of the plain sum over samples, at random and at adversarial directions."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import power_direct
from pipeline.evaluation.stability.case import LAMBDA_MAX_NM, LAMBDA_MIN_NM, SEED, StressCase
from pipeline.optics import geometry
from pipeline.optics.random_directions import random_pairs
from pipeline.surface.heightfield import HeightField

# error reported for NaN, infinity and anything larger: no digit is correct
NO_DIGITS = 1e6
# samples times directions that the plain sum may take for one case
MOST_WORK = 3e7


@dataclass(frozen=True)
class Measurement:
    """|P|^2 found and true (directions,); NaN where the truth lies beyond the scan's Nyquist limits."""

    found: Array
    truth: Array

    def worst(self, floor: float) -> float:
        """Return the largest |found - truth| / max(truth, floor); a value beyond the Nyquist limits is NO_DIGITS."""
        known = np.isfinite(self.truth)
        error = np.abs(self.found - self.truth)[known] / np.maximum(self.truth[known], floor)
        claimed = np.nan_to_num(self.found[~known]) != 0.0
        if np.any(claimed) or not np.all(np.isfinite(error)):
            return NO_DIGITS
        return float(np.clip(error.max(initial=0.0), 0.0, NO_DIGITS))


def directions(case: StressCase, lambda_nm: float) -> Array:
    """Return (u, v, w) (directions, 3): random ones, then those where something vanishes or reaches its limit."""
    wi, wr = random_pairs(None, int(np.clip(MOST_WORK / case.samples, 4, 24)), SEED)
    # on coefficients of the patch's DFT and midway between two of them
    du, dv = (1e-3 * lambda_nm / (n * pitch) for n, pitch in zip(case.shape[::-1], case.pitch_um, strict=True))
    adversarial = [
        [0.0, 0.0, -2.0],
        [0.0, 0.0, -1e-9],
        [1e-12, -1e-12, -2.0],
        [-1e-300, 0.0, -1.0],
        [-2.0 * du, dv, -1.9],
        [0.5 * du, -1.5 * dv, -1.9],
        [-1.2, 0.4, -1e-12],
        [sqrt(2.0), -sqrt(2.0), -1e-9],
        [-2.0 + 1e-12, 0.0, -1e-6],
        [0.0, 2.0 - 1e-12, -1e-6],
    ]
    return np.concatenate([geometry.uvw(wi, wr), [d for d in adversarial if np.hypot(d[0], d[1]) <= 2.0]])


def measure(case: StressCase, field: HeightField, power: Callable[[Array, float], Array]) -> list[Measurement]:
    """Return `power(uvw, lambda_nm)` and the plain sum at both ends of the visible range.

    Where the plain sum is slow, only at the shortest wavelength, where phases are largest.
    """
    found = []
    for nm in (LAMBDA_MIN_NM,) if case.samples > MOST_WORK / 24 else (LAMBDA_MIN_NM, LAMBDA_MAX_NM):
        uvw = directions(case, nm)
        found.append(Measurement(power(uvw, nm), power_direct(field, case.sigma_um, uvw, nm)))
    return found
