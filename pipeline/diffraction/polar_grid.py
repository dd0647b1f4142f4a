"""The polar grid of (u, v): rings and azimuths, and where a direction lies among them.

Spectral integration blurs along the radius (f = rho / lambda) and not along the azimuth, so rings may be few and
azimuths many. Ring i has rho = r0 sinh(i dx): even near the mirror direction, by ratios beyond. Azimuths are even in
the angle of (u, v) stretched along the axis where the surface diffracts least, so that they lie closer where it
diffracts most: with (u', v') turned by `axis`, azimuth j has atan2(v', stretch u') = 2 pi j / count. A turn by half
maps azimuth j to j + count / 2 for every stretch.

In a texture azimuth j is the centre of texel column j and ring i that of row i: texture coordinates
((j + 1/2) / azimuths, (i + 1/2) / rings), periodic along the first.
"""

from dataclasses import dataclass
from math import asinh, pi

import numpy as np

from pipeline.arrays import Array

RHO_MAX = 2.0  # |(u, v)| of grazing light seen from the light's own side
TILE = 32  # azimuths come in whole vectors for either half turn


@dataclass(frozen=True)
class Azimuths:
    """`count` azimuths (a multiple of 32), closest about `axis_rad` where `stretch` < 1."""

    count: int
    stretch: float = 1.0
    axis_rad: float = 0.0

    def angles(self) -> Array:
        """phi of every azimuth, radians."""
        even = 2.0 * pi * np.arange(self.count) / self.count
        return np.asarray(np.arctan2(self.stretch * np.sin(even), np.cos(even)) + self.axis_rad)

    def index(self, uv: Array) -> Array:
        """Fractional azimuth (...,) in [0, count) of (u, v) (..., 2)."""
        cosine, sine = np.cos(self.axis_rad), np.sin(self.axis_rad)
        along, across = (
            cosine * uv[..., 0] + sine * uv[..., 1],
            cosine * uv[..., 1] - sine * uv[..., 0],
        )
        turns = np.arctan2(across, self.stretch * along) / (2.0 * pi)
        # a hair below 0 rounds up to 1
        return np.asarray((turns % 1.0) * self.count % self.count)


@dataclass(frozen=True)
class Rings:
    """`count` rings from 0 to `rho_max`, even below `r0` and by ratios beyond."""

    count: int
    r0: float
    rho_max: float = RHO_MAX

    @property
    def step(self) -> float:
        """dx of rho = r0 sinh(i dx)."""
        return asinh(self.rho_max / self.r0) / (self.count - 1)

    def rho(self) -> Array:
        """rho of every ring."""
        found = self.r0 * np.sinh(np.arange(self.count) * self.step)
        found[-1] = self.rho_max
        return np.asarray(found)

    def index(self, rho: Array) -> Array:
        """Fractional ring (...,) of rho; beyond count - 1 outside the grid."""
        return np.asarray(np.arcsinh(rho / self.r0) / self.step)


@dataclass(frozen=True)
class PolarGrid:
    """Where the texels of a polar table lie."""

    rings: Rings
    azimuths: Azimuths

    @property
    def texels(self) -> int:
        return self.rings.count * self.azimuths.count
