"""|P|^2 as found beside the plain sum over samples, at random directions and where something vanishes or ends."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import power_direct
from pipeline.evaluation.stability.cell import LAMBDA_MAX_NM, LAMBDA_MIN_NM, SEED, Cell
from pipeline.optics import geometry
from pipeline.optics.random_directions import random_pairs
from pipeline.surface.heightfield import HeightField

# NaN, infinity and errors beyond this are told as this: no digit is left
NO_DIGITS = 1e6
# samples times directions that the plain sum may take for one cell
MOST_WORK = 3e7


@dataclass(frozen=True)
class Reading:
    """|P|^2 found and true (directions,); NaN where the truth lies beyond the scan's band."""

    found: Array
    truth: Array

    def worst(self, floor: float) -> float:
        """The largest |found - truth| / max(truth, floor); what is claimed beyond the band counts as no digits."""
        known = np.isfinite(self.truth)
        error = np.abs(self.found - self.truth)[known] / np.maximum(self.truth[known], floor)
        claimed = np.nan_to_num(self.found[~known]) != 0.0
        if np.any(claimed) or not np.all(np.isfinite(error)):
            return NO_DIGITS
        return float(np.clip(error.max(initial=0.0), 0.0, NO_DIGITS))


def directions(cell: Cell, lambda_nm: float) -> Array:
    """(u, v, w) (directions, 3): random ones, then those where something vanishes or ends."""
    samples = cell.shape[0] * cell.shape[1]
    wi, wr = random_pairs(None, int(np.clip(MOST_WORK / samples, 4, 24)), SEED)
    # on coefficients of the patch's DFT and midway between two of them
    du, dv = (1e-3 * lambda_nm / (n * pitch) for n, pitch in zip(cell.shape[::-1], cell.pitch_um, strict=True))
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


def _wavelengths(cell: Cell) -> tuple[float, ...]:
    """Both ends of the spectrum; where the plain sum is slow, the end where phases are largest."""
    large = cell.shape[0] * cell.shape[1] > MOST_WORK / 24
    return (LAMBDA_MIN_NM,) if large else (LAMBDA_MIN_NM, LAMBDA_MAX_NM)


def readings(cell: Cell, field: HeightField, power: Callable[[Array, float], Array]) -> list[Reading]:
    """`power(uvw, lambda_nm)` beside the plain sum."""
    found = []
    for nm in _wavelengths(cell):
        uvw = directions(cell, nm)
        found.append(Reading(power(uvw, nm), power_direct(field, cell.sigma_um, uvw, nm)))
    return found
