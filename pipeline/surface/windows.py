"""Positions of the coherence window on a scan that is larger than the window (Welch's method).

Coherent light illuminates one window, whose position is random. The mean of |P|^2 over several positions estimates
the expectation of |P|^2 ([S99], [D14] eq. 2), and its speckle has a lower contrast than that of a single window. On a
scan about as large as the window, the only position is the middle.
"""

from dataclasses import dataclass
from math import floor

import numpy as np

from pipeline.optics.coherence import Coherence
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField

# a window is four sigma wide ([D14] sec. 4.2); windows half a width apart still reduce the speckle
WIDTH_SIGMAS, _STEP_SIGMAS = 4.0, 2.0
# windows per axis: each one costs the same, and each reduces the variance less than the one before
_MOST = 3


@dataclass(frozen=True)
class Places:
    """Positions of the window: every distance along x with every distance along y.

    x, y: distances from the middle of the patch, samples. Each list holds the opposite of all its entries.
    """

    x: tuple[int, ...] = (0,)
    y: tuple[int, ...] = (0,)

    @property
    def count(self) -> int:
        """Number of positions."""
        return len(self.x) * len(self.y)

    def pairs(self) -> list[tuple[int, int]]:
        """Lists the positions as (x, y)."""
        return [(x, y) for y in self.y for x in self.x]


MIDDLE = Places()


def places(extent: Extent, coherence: Coherence) -> Places:
    """Chooses the positions of the window.

    extent: of the whole scan. coherence: width of the window, and whether several are wanted.
    """
    if coherence.windows != "auto":
        return MIDDLE
    x, y = (
        tuple(round(offset / pitch) for offset in _offsets(size, coherence.sigma_um))
        for size, pitch in zip(extent.size_um, extent.pitch_um, strict=True)
    )
    return Places(x, y)


def around(field: HeightField, place: tuple[int, int], shape: tuple[int, int]) -> HeightField:
    """Cuts the samples about a position out of the patch, which repeats periodically.

    place: distance (x, y) of the position from the middle of the patch, samples. shape: samples (ny, nx) of the part.
    Returns the part, whose middle is the position.
    """
    rows, columns = (
        (np.arange(part) - part // 2 + whole // 2 + shift) % whole
        for part, whole, shift in zip(shape, field.shape, place[::-1], strict=True)
    )
    return HeightField(field.heights_um[np.ix_(rows, columns)], field.pitch_um)


def _offsets(size_um: float, sigma_um: float) -> list[float]:
    """Computes the centres of windows along one axis, um from the middle, for windows that lie within the scan."""
    room = size_um - WIDTH_SIGMAS * sigma_um
    count = min(_MOST, 1 + floor(room / (_STEP_SIGMAS * sigma_um))) if room > 0 else 1
    return [float(x) for x in np.linspace(-room / 2.0, room / 2.0, count)] if count > 1 else [0.0]
