"""Positions of the coherence window on a scan that is larger than the window (Welch's method).

Coherent light illuminates one window, whose position is random. The mean of |P|^2 over several positions estimates
the expectation of |P|^2 ([S99], [D14] eq. 2), and its speckle has a lower contrast than that of a single window. On a
scan about as large as the window, the only position is the middle.
"""

from math import floor

import numpy as np

from pipeline.optics.coherence import Coherence
from pipeline.surface.heightfield import HeightField

# a window is four sigma wide ([D14] sec. 4.2); windows half a width apart still reduce the speckle
_WIDTH_SIGMAS, _STEP_SIGMAS = 4.0, 2.0
# windows per axis: each one costs the same, and each reduces the variance less than the one before
_MOST = 3


def places(field: HeightField, coherence: Coherence) -> list[HeightField]:
    """Shifts the field so that each position of the window comes to the middle of the patch.

    field: the whole scan. coherence: width of the window, and whether several are wanted.
    Returns one field per position, that of the middle first.
    """
    along = _along(field.size_um, coherence)
    shifts = [(round(y / field.pitch_um[1]), round(x / field.pitch_um[0])) for y in along[1] for x in along[0]]
    # the smallest shift first: planning and checks on a single window use that of the middle
    shifts.sort(key=lambda shift: (abs(shift[0]) + abs(shift[1]), shift))
    return [HeightField(np.roll(field.heights_um, (-y, -x), axis=(0, 1)), field.pitch_um) for y, x in shifts]


def count(size_um: tuple[float, float], coherence: Coherence) -> int:
    """Computes how many positions a patch of this size (x, y), um, has."""
    along_x, along_y = _along(size_um, coherence)
    return len(along_x) * len(along_y)


def _along(size_um: tuple[float, float], coherence: Coherence) -> list[list[float]]:
    return [_offsets(size, coherence.sigma_um) if coherence.windows == "auto" else [0.0] for size in size_um]


def _offsets(size_um: float, sigma_um: float) -> list[float]:
    """Computes the centres of windows along one axis, um from the middle, for windows that lie within the scan."""
    room = size_um - _WIDTH_SIGMAS * sigma_um
    count = min(_MOST, 1 + floor(room / (_STEP_SIGMAS * sigma_um))) if room > 0 else 1
    return [float(x) for x in np.linspace(-room / 2.0, room / 2.0, count)] if count > 1 else [0.0]
