"""Half floats: scales that fit them, and what falls below their digits."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array

# a scaled table peaks in [2^14, 2^15): one octave below half's largest number is left to filters that sum
_PEAK_EXPONENT = 14
# smaller scales are no normal float32, which is what a shader multiplies by
_LEAST_EXPONENT = -126
_NORMAL = 2.0**-14


def scales(peak: Array) -> Array:
    """Powers of two that bring peaks (...,) near half's largest number; 1 for a peak of 0."""
    _, exponent = np.frexp(peak)  # peak = m 2^exponent, m in [1/2, 1)
    exponent = np.maximum(exponent - 1 - _PEAK_EXPONENT, _LEAST_EXPONENT)
    return np.where(peak > 0.0, np.ldexp(1.0, exponent), 1.0)


def subnormal(scaled: NDArray[Any]) -> NDArray[np.bool_]:
    """Which values (...,) half keeps with fewer than 11 bits or none."""
    size = np.abs(scaled)
    return np.asarray((size > 0.0) & (size < _NORMAL))
