"""The texels of a polar grid that a scene visits, and the tiles that must be baked for them.

A pair of light and view asks for one (u, v, w). Its look-up reads the four rings and azimuths about (u, v), whose
spline coefficients depend on samples further away: the filter's impulse response falls by 0.268 from texel to texel.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles, bands, sectors, thinned
from pipeline.scene.model import Scene
from pipeline.scene.visited import SAMPLES, visited

# knots from the texels beside a direction to those of its spline
_TAPS = 2
# knots between a look-up and the end of the samples: of the second difference there, 0.268^6 = 4e-4 remains
MARGIN = 6


@dataclass(frozen=True)
class Reach:
    """What a scene visits of a grid.

    texels: bool (rings, azimuths), those from which look-ups of visited directions interpolate.
    """

    grid: PolarGrid
    texels: NDArray[np.bool_]

    @property
    def share(self) -> float:
        """Share of the grid's texels that are visited."""
        return float(self.texels.mean())

    def tiles(self) -> Tiles:
        """Returns the tiles that hold all visited texels and those on which their coefficients depend."""
        all_tiles = thinned(self.grid)
        needed = _grown(self.texels, MARGIN, all_tiles.every_of_ring)
        by_band = np.logical_or.reduceat(needed, RINGS * np.arange(bands(self.grid)), axis=0)
        covered = np.logical_or.reduceat(by_band, AZIMUTHS * np.arange(sectors(self.grid)), axis=1)
        return replace(all_tiles, covered=covered)


def reach(scene: Scene | None, grid: PolarGrid) -> Reach:
    """Finds what a scene visits of a grid; without a scene, all of it. Raises the errors of `visited`."""
    if scene is None:
        return Reach(grid, np.ones((grid.rings.count, grid.azimuths.count), bool))
    found = visited(scene, SAMPLES)
    return of_directions(grid, found.uvw, found.gap)


def of_directions(grid: PolarGrid, uvw: Array, gap: Array | float = 0.0) -> Reach:
    """Finds what sampled directions visit of a grid.

    uvw: (u, v, w) of pairs of light and view (samples, 3). gap: how far from each sample directions are visited
    (samples,), as a distance in (u, v).
    """
    beside = _beside(grid, uvw[:, :2], np.broadcast_to(gap, len(uvw)))
    if beside[0].any():
        # the first ring is one point
        beside[0] = True
    return Reach(grid, _grown(beside, _TAPS, thinned(grid).every_of_ring))


def _beside(grid: PolarGrid, uv: Array, gap: Array) -> NDArray[np.bool_]:
    """Marks the texels (rings, azimuths) beside all directions of discs about `uv` (samples, 2), of radius `gap`."""
    rho, phi = np.hypot(uv[:, 0], uv[:, 1]), np.arctan2(uv[:, 1], uv[:, 0])
    rings, azimuths = grid.rings.count, grid.azimuths.count
    low = np.floor(grid.rings.ring_from_rho(np.maximum(rho - gap, 0.0))).astype(int).clip(max=rings - 1)
    high = np.ceil(grid.rings.ring_from_rho(rho + gap)).astype(int).clip(max=rings - 1)
    # the angle of half a disc as the origin sees it; every angle if it holds the origin
    half = np.arcsin(np.divide(gap, rho, out=np.ones_like(rho), where=gap < rho))
    start, end = (grid.azimuths.azimuth_from_uv(_unit(angle)) for angle in (phi - half, phi + half))
    first = start.astype(int)
    last = np.where(gap < rho, np.ceil(start + (end - start) % azimuths).astype(int), first + azimuths - 1)
    last = np.minimum(last, first + azimuths - 1)
    # how many rectangles a texel is in, on two turns: the sum of their corners before it
    corners = np.zeros((rings + 1, 2 * azimuths + 1), np.int32)
    for ring, sign in ((low, 1), (high + 1, -1)):
        np.add.at(corners, (ring, first), sign)
        np.add.at(corners, (ring, last + 1), -sign)
    inside = corners.cumsum(axis=0).cumsum(axis=1)[:rings, : 2 * azimuths] > 0
    return np.asarray(inside[:, :azimuths] | inside[:, azimuths:])


def known_cells(tiles: Tiles) -> NDArray[np.bool_]:
    """Marks the cells (rings, azimuths) in which a look-up is as good as with all tiles.

    Cell (i, j) lies between the rings i and i + 1 and the azimuths j and j + 1. Its look-up reads the four texels
    along each axis about it, none of which is within MARGIN knots of a tile that is missing.
    """
    return ~_grown(~tiles.mask(), MARGIN + 2, tiles.every_of_ring)


def w_of(wi: Array, uv: Array) -> Array:
    """Computes |w| = cos(ti) + cos(tr) (...,) of the view that sees (u, v) (..., 2) under one light.

    wi: unit vector towards the light (3,). cos(tr) is 0 beyond the horizon.
    """
    return np.asarray(wi[2] + np.sqrt(np.maximum(_squared_cosine(wi, uv), 0.0)))


def smooth_w_of(wi: Array, uv: Array, step: float) -> Array:
    """Computes |w| as `w_of` does, continued along its tangent where cos(tr)^2 is below `step`.

    At the horizon the slope of cos(tr) over (u, v) is infinite, which no spline follows. With the distance of the
    rings as the step, the mean dE of *Elaphe* and *Xenopeltis* under a normal light is 0.064 and 0.088; without,
    0.079 and 0.112.
    """
    squared, root = _squared_cosine(wi, uv), np.sqrt(step)
    tangent = root + 0.5 * (np.maximum(squared, -step) - step) / root
    return np.asarray(wi[2] + np.where(squared > step, np.sqrt(np.maximum(squared, step)), tangent))


def _squared_cosine(wi: Array, uv: Array) -> Array:
    """Computes cos(tr)^2 (...,) of the views that see (u, v) (..., 2); negative beyond the horizon."""
    return np.asarray(1.0 - np.sum((wi[:2] + uv) ** 2, axis=-1))


def _unit(phi: Array) -> Array:
    return np.stack([np.cos(phi), np.sin(phi)], axis=-1)


def _grown(mask: NDArray[np.bool_], by: int, every: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Adds to a mask (rings, azimuths) what is within `by` knots of it, also across the first ring.

    every: azimuths from knot to knot of each ring (rings,).
    """
    from scipy.ndimage import maximum_filter1d

    by_ring = min(by, len(mask) - 1)
    opposite = np.roll(mask[by_ring:0:-1], mask.shape[1] // 2, axis=1)
    grown = np.concatenate([opposite, mask]).astype(np.uint8)
    maximum_filter1d(grown, 2 * by + 1, axis=0, mode="nearest", output=grown)
    grown = grown[by_ring:]
    for step in np.unique(every):
        rows = every == step
        grown[rows] = maximum_filter1d(grown[rows], 2 * by * int(step) + 1, axis=1, mode="wrap")
    return np.asarray(grown, bool)
