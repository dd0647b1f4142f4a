"""Half floats: scales that fit values into their range, and values that lose digits."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array

# scaled tables peak in [2^14, 2^15), an octave below the largest half float, which filters that add texels need
_PEAK_EXPONENT = 14
# smaller scales are subnormal in float32, in which a shader multiplies
_LEAST_EXPONENT = -126
_NORMAL = 2.0**-14


def scales(peak: Array) -> Array:
    """Computes scales, powers of two, by which tables are divided before they are stored in half floats.

    peak: largest magnitude of each table (...,).
    Returns the scales (...,); 1 for a peak of 0.
    """
    _, exponent = np.frexp(peak)  # peak = m 2^exponent, m in [1/2, 1)
    exponent = np.maximum(exponent - 1 - _PEAK_EXPONENT, _LEAST_EXPONENT)
    return np.where(peak > 0.0, np.ldexp(1.0, exponent), 1.0)


def subnormal(scaled: NDArray[Any]) -> NDArray[np.bool_]:
    """Marks values (...,) that a half float stores with fewer than 11 significant bits, or as 0."""
    size = np.abs(scaled)
    return np.asarray((size > 0.0) & (size < _NORMAL))
