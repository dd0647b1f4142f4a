"""The texels of a polar grid that a scene visits, and the tiles that must be baked for them.

A pair of light and view asks for one (u, v, w). Its look-up reads the four rings and azimuths about (u, v), whose
spline coefficients depend on samples further away: the filter's impulse response falls by 0.268 from texel to texel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles, bands, sectors
from pipeline.optics import geometry
from pipeline.optics.scene import Direction, Scene

# from a sample of the visited directions to the texels of its spline, which lie up to 2 away, and 1 for directions
# between samples
_TAPS = 3
# texels between a look-up and the end of the samples: of the second difference there, 0.268^6 = 4e-4 remains
MARGIN = 6


@dataclass(frozen=True)
class Reach:
    """What a scene visits of a grid.

    texels: bool (rings, azimuths), those from which look-ups of visited directions interpolate.
    w: the least and the largest |w| of the visited directions beside every ring, (rings, 2); NaN where there are
        none.
    """

    grid: PolarGrid
    texels: NDArray[np.bool_]
    w: Array

    @property
    def share(self) -> float:
        """Share of the grid's texels that are visited."""
        return float(self.texels.mean())

    def tiles(self) -> Tiles:
        """Returns the tiles that hold all visited texels and those on which their coefficients depend."""
        needed = _grown(self.texels, MARGIN)
        by_sector = needed.reshape(len(needed), sectors(self.grid), AZIMUTHS).any(axis=2)
        firsts = RINGS * np.arange(bands(self.grid))
        covered = np.maximum.reduceat(by_sector.astype(np.uint8), firsts, axis=0).astype(bool)
        return Tiles(self.grid, covered, (1,) * bands(self.grid))


def reach(scene: Scene | None, grid: PolarGrid) -> Reach:
    """Finds what the lights and the cone of views of a scene visit of a grid; without a scene, all of it."""
    if scene is None:
        top = np.sqrt(np.maximum(4.0 - grid.rings.rho() ** 2, 0.0))
        everything = np.ones((grid.rings.count, grid.azimuths.count), bool)
        return Reach(grid, everything, np.stack([np.zeros_like(top), top], axis=1))
    widest = np.sin(np.radians(scene.views.theta_max_deg))
    uv, found = _texels_uv(grid), []
    for light in scene.lights:
        wi = unit_vector(light)
        seen = uv[np.sum((wi[:2] + uv) ** 2, axis=1) <= widest**2]
        # a narrow cone may lie between texels
        uvs = np.concatenate([seen, -wi[None, :2]])
        found.append(np.concatenate([uvs, -w_of(wi, uvs)[:, None]], axis=1))
    return of_directions(grid, np.concatenate(found))


def of_directions(grid: PolarGrid, uvw: Array) -> Reach:
    """Finds what sampled directions visit of a grid.

    uvw: (u, v, w) of pairs of light and view (samples, 3), at most about a texel apart.
    """
    rho = np.hypot(uvw[:, 0], uvw[:, 1])
    rings, azimuths = grid.rings.count, grid.azimuths.count
    ring = np.clip(np.rint(grid.rings.ring_from_rho(rho)).astype(int), 0, rings - 1)
    azimuth = np.rint(grid.azimuths.azimuth_from_uv(uvw[:, :2])).astype(int) % azimuths
    visited = np.zeros((rings, azimuths), bool)
    visited[ring, azimuth] = True
    if visited[0].any():
        # the first ring is one point
        visited[0] = True
    low, high = np.full(rings, np.inf), np.full(rings, -np.inf)
    np.minimum.at(low, ring, np.abs(uvw[:, 2]))
    np.maximum.at(high, ring, np.abs(uvw[:, 2]))
    w = np.where(np.isfinite(low)[:, None], np.stack([low, high], axis=1), np.nan)
    return Reach(grid, _grown(visited, _TAPS), w)


def known_cells(tiles: Tiles) -> NDArray[np.bool_]:
    """Marks the cells (rings, azimuths) in which a look-up is as good as with all tiles.

    Cell (i, j) lies between the rings i and i + 1 and the azimuths j and j + 1. Its look-up reads the four texels
    along each axis about it, none of which is within MARGIN of a tile that is missing.
    """
    return ~_grown(~tiles.mask(), MARGIN + 2)


def unit_vector(light: Direction) -> Array:
    """Returns the unit vector (3,) towards a light."""
    return geometry.direction(*np.radians([light.theta_deg, light.phi_deg]))


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


def _texels_uv(grid: PolarGrid) -> Array:
    """Computes (u, v) of all texels, (rings azimuths, 2)."""
    phi, rho = grid.azimuths.phi(), grid.rings.rho()
    return np.stack([np.outer(rho, np.cos(phi)), np.outer(rho, np.sin(phi))], axis=-1).reshape(-1, 2)


def _grown(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """Adds to a mask (rings, azimuths) what is within `by` texels of it, also across the first ring."""
    from scipy.ndimage import maximum_filter1d

    by_ring = min(by, len(mask) - 1)
    opposite = np.roll(mask[by_ring:0:-1], mask.shape[1] // 2, axis=1)
    grown = np.concatenate([opposite, mask]).astype(np.uint8)
    maximum_filter1d(grown, 2 * by + 1, axis=1, mode="wrap", output=grown)
    maximum_filter1d(grown, 2 * by + 1, axis=0, mode="nearest", output=grown)
    return np.asarray(grown[by_ring:], bool)
