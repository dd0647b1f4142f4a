"""Tiles of a polar grid: the blocks of rings and azimuths in which tables are baked, stored and published.

A band is RINGS consecutive rings, a sector is AZIMUTHS consecutive azimuths, and a tile is the texels of one band in
one sector. Near the mirror direction an arc of the grid is shorter than the speckle, so a band may keep every second
or fourth azimuth.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray

from pipeline.diffraction.polar_grid import PolarGrid

RINGS, AZIMUTHS = 16, 128


@dataclass(frozen=True)
class Tiles:
    """The tiles of a grid that hold values.

    grid: whose azimuths are a multiple of AZIMUTHS.
    covered: bool (bands, sectors).
    every: which azimuths each band keeps (bands,): 1 for all, 2 for every second, 4 for every fourth.
    """

    grid: PolarGrid
    covered: NDArray[np.bool_]
    every: tuple[int, ...]

    @cached_property
    def texels(self) -> int:
        """Number of texels of all covered tiles."""
        rings = np.minimum(RINGS, self.grid.rings.count - RINGS * np.arange(len(self.every)))
        return int(np.sum(self.covered.sum(axis=1) * rings * (AZIMUTHS // np.array(self.every))))

    def mask(self) -> NDArray[np.bool_]:
        """Marks the texels of covered tiles, (rings, azimuths)."""
        by_ring = np.repeat(self.covered, RINGS, axis=0)[: self.grid.rings.count]
        return np.repeat(by_ring, AZIMUTHS, axis=1)


def bands(grid: PolarGrid) -> int:
    """Computes the number of bands; the last may have fewer rings."""
    return ceil(grid.rings.count / RINGS)


def sectors(grid: PolarGrid) -> int:
    """Computes the number of sectors."""
    return grid.azimuths.count // AZIMUTHS


def whole(grid: PolarGrid) -> Tiles:
    """Returns all tiles of a grid, with all azimuths."""
    return Tiles(grid, np.ones((bands(grid), sectors(grid)), bool), (1,) * bands(grid))
