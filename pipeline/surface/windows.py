"""Where the coherence window stands on a scan that is larger than it: Stam's expectation of |P|^2, Welch's way.

Coherent light sees one window at a time, and which one is chance. A scan that holds several shows what all of them
look like: |P|^2 averaged over shifted windows is an estimate of its expectation ([S99], [D14] eq. 2), and its speckle
has less contrast than one window's. A scan about as large as the window has one place for it: the middle.
"""

from math import floor

import numpy as np

from pipeline.optics.coherence import Coherence
from pipeline.surface.heightfield import HeightField

# a window is four sigma wide ([D14] 4.2); windows half a width apart still add to each other
_WIDTH_SIGMAS, _STEP_SIGMAS = 4.0, 2.0
# a third along an axis wins less than the second; what a window costs stays the same
_MOST = 3


def places(field: HeightField, coherence: Coherence) -> list[HeightField]:
    """The field with each place of the window moved to its middle, the middle's own first."""
    along = [_offsets(size, coherence.sigma_um) if coherence.windows == "auto" else [0.0] for size in field.size_um]
    shifts = [(round(y / field.pitch_um[1]), round(x / field.pitch_um[0])) for y in along[1] for x in along[0]]
    # the smallest shift first, so that what is planned and checked on one window is so on the middle's
    shifts.sort(key=lambda shift: (abs(shift[0]) + abs(shift[1]), shift))
    return [HeightField(np.roll(field.heights_um, (-y, -x), axis=(0, 1)), field.pitch_um) for y, x in shifts]


def _offsets(size_um: float, sigma_um: float) -> list[float]:
    """Centres of windows along one axis, um from the middle; none reaches over the scan's edge."""
    room = size_um - _WIDTH_SIGMAS * sigma_um
    count = min(_MOST, 1 + floor(room / (_STEP_SIGMAS * sigma_um))) if room > 0 else 1
    return [float(x) for x in np.linspace(-room / 2.0, room / 2.0, count)] if count > 1 else [0.0]
