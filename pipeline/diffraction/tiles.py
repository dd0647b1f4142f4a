"""Tiles of a polar grid: the blocks of rings and azimuths in which tables are baked, stored and published.

A band is RINGS consecutive rings, a sector is AZIMUTHS consecutive azimuths, and a tile is the texels of one band in
one sector. Near the mirror direction an arc of the grid is shorter than the speckle, so a band may keep every second
or fourth azimuth.

Speckle is lambda sigma_f wide at every rho, sigma_f that of the window's transform, and the arc between two of N
azimuths is 2 pi rho / N long. The error of a cubic spline grows with the fourth power of their ratio: a mean over
rings of p(rho) (rho / n)^4, n azimuths on a ring and p the share of directions there, is least for a given sum of n
where n ~ (p rho^4)^(1/5), nearly proportional to rho. Beyond _FULL directions become fewer, and the rings keep all.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction.polar_grid import PolarGrid

RINGS, AZIMUTHS = 16, 128
# rho beyond which rings keep all azimuths. Mean dE of a map of Xenopeltis, 160 rings and 2304 azimuths: 0.0486 on all
# 369 k texels, 0.0487 on 249 k at 0.8, 0.0503 on 221 k at 1, 0.088 on 194 k at 1.6
_FULL = 1.0
# azimuths of a thinned ring, at least. A blazed grating's 256 azimuths thinned to 64 erred by 4.8 at 1000 RU on the
# flank of the specular lobe, 128 that are kept by 0.5
_FEWEST = 128


@dataclass(frozen=True)
class Tiles:
    """The tiles of a grid that hold values.

    grid: the rings and azimuths. Where these are no multiple of AZIMUTHS, the last sector is narrower.
    covered: bool (bands, sectors).
    every: which azimuths each band keeps (bands,): 1 for all, 2 for every second, 4 for every fourth.
    """

    grid: PolarGrid
    covered: NDArray[np.bool_]
    every: tuple[int, ...]

    @cached_property
    def texels(self) -> int:
        """Number of texels of all covered tiles."""
        return int(np.sum(self.mask().sum(axis=1) // self.every_of_ring))

    @property
    def every_of_ring(self) -> NDArray[np.int32]:
        """Which azimuths each ring keeps (rings,), as its band does."""
        return np.repeat(np.array(self.every, np.int32), RINGS)[: self.grid.rings.count]

    def mask(self) -> NDArray[np.bool_]:
        """Marks the texels of covered tiles, (rings, azimuths)."""
        by_ring = np.repeat(self.covered, RINGS, axis=0)[: self.grid.rings.count]
        return np.repeat(by_ring, AZIMUTHS, axis=1)[:, : self.grid.azimuths.count]

    def covers(self, ring: Array, azimuth: Array) -> NDArray[np.bool_]:
        """Tells where all 4 x 4 coefficients of a cubic spline lie in covered tiles, (directions,).

        ring, azimuth: fractional indices (directions,) in [0, rings - 1] and [0, azimuths).
        """
        last, azimuths = self.grid.rings.count - 1, self.grid.azimuths.count
        found = np.ones(len(ring), bool)
        if self.covered.all():
            return found
        for row in np.floor(ring).astype(int) + np.arange(-1, 3)[:, None]:
            # beyond the origin the opposite half turn, mirrored at the last ring
            mirrored = last - np.abs(last - np.abs(row))
            every, opposite = self.every_of_ring[mirrored], np.where(row < 0, azimuths // 2, 0)
            knot = np.floor(azimuth / every).astype(int)
            # four columns lie in two tiles at most
            for column in (knot - 1, knot + 2):
                found &= self.covered[mirrored // RINGS, (column * every + opposite) % azimuths // AZIMUTHS]
        return found

    def covered_share(self) -> float:
        """Computes the share of the disc of (u, v) up to rho_max whose texels are in covered tiles."""
        area = self.grid.area()
        return float(np.sum(area[self.mask()]) / np.sum(area))


def bands(grid: PolarGrid) -> int:
    """Computes the number of bands; the last may have fewer rings."""
    return ceil(grid.rings.count / RINGS)


def sectors(grid: PolarGrid) -> int:
    """Computes the number of sectors."""
    return ceil(grid.azimuths.count / AZIMUTHS)


def whole(grid: PolarGrid) -> Tiles:
    """Returns all tiles of a grid, with all azimuths."""
    return Tiles(grid, _all(grid), (1,) * bands(grid))


def thinned(grid: PolarGrid) -> Tiles:
    """Returns all tiles of a grid, with a quarter of the azimuths near the mirror direction and half of them around.

    A band has the azimuths that its last ring needs: one in four up to a quarter of _FULL, or of the last ring of all
    where that is smaller, and one in two up to half of it, but at least _FEWEST. A grid with a narrower last sector
    keeps all.
    """
    if grid.azimuths.count % AZIMUTHS:
        return whole(grid)
    rho, full = grid.rings.rho(), min(_FULL, grid.rings.rho_max)
    outermost = np.minimum(RINGS * np.arange(1, bands(grid) + 1), len(rho)) - 1
    most = 4 if grid.azimuths.count >= 4 * _FEWEST else 2 if grid.azimuths.count >= 2 * _FEWEST else 1
    every = tuple(min(most, 4 if outer <= full / 4 else 2 if outer <= full / 2 else 1) for outer in rho[outermost])
    return Tiles(grid, _all(grid), every)


def _all(grid: PolarGrid) -> NDArray[np.bool_]:
    return np.ones((bands(grid), sectors(grid)), bool)
