"""The (u, v, w) that a scene visits, on a lattice of its lights and views."""

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.optics.geometry import RHO_MAX
from pipeline.scene import seen
from pipeline.scene.model import Scene

# samples of a scene's directions, and cells along the range of u and v, -2 to 2, in which they are counted
SAMPLES, CELLS = 200_000, 128
# the finest lattice, rad: half the distance of neighbouring texels of a usual table
_FINEST = 4e-3
# samples for the largest |(u, v)|
_OF_RADIUS = 100_000
# cells of lights, rad, in bounds of what a flat sample reaches
_OF_DISCS = 0.1
# a tenth of a degree, as the least of views
_LEAST_RHO = 1.7e-3


class Visited(NamedTuple):
    """Samples of the directions that a scene visits.

    uvw: (n, 3). weight: (n,), of sum 1: power of the light times projected solid angle of the view, or times solid
    angle of the pixel. gap: (n,); every (u, v, w) that the scene visits is within the gap of some sample. wi: unit
    vectors towards the lights in the sample's frame (n, 3).
    """

    uvw: Array
    weight: Array
    gap: Array
    wi: Array


def visited(scene: Scene, count: int) -> Visited:
    """Samples the directions that a scene visits: every cell of its lights with every view or pixel.

    The distance of the samples follows from `count`. Cells of lights and views with sides of h, radians, are within
    h / sqrt(2) of their middles, so with (u, v, w) = -wi - wr the gap is the sum of both. Between adjacent pixels
    that meet one sheet of a surface, (u, v, w) is taken for linear, and the gap is the largest difference from a
    sample to its neighbours, added to that of the light.

    scene: its lights and views. count: about how many samples; a camera's pixels are samples of their own, at least.
    Raises seen.UnseenError, ValueError and KeyError as `seen.rasters` does.
    """
    found = _flat(scene, count) if scene.cameras is None else _through_cameras(scene, count)
    if not len(found.uvw):
        raise seen.UnseenError("lights", "expected light on what is seen, but no light is above the horizon there")
    return found._replace(weight=found.weight / found.weight.sum())


def cells(uvw: Array) -> np.ndarray:
    """Finds the cells of u and v, two indices from 0 to CELLS - 1, in which directions (n, 3) lie, (n, 2)."""
    index = np.floor((uvw[:, :2] + RHO_MAX) * (CELLS / (2.0 * RHO_MAX))).astype(int)
    return np.asarray(np.clip(index, 0, CELLS - 1))


def rho_max(scene: Scene | None) -> float:
    """Computes a bound of |(u, v)| in a scene; 2 without one.

    On a flat sample it is the largest sin(theta_i) + sin(theta_r), under cameras that of the visited directions.
    """
    if scene is None:
        return RHO_MAX
    if scene.cameras is not None:
        found = visited(scene, _OF_RADIUS)
        return float(np.clip(np.max(np.hypot(found.uvw[:, 0], found.uvw[:, 1]) + found.gap), _LEAST_RHO, RHO_MAX))
    view = np.sin(np.radians(scene.views.theta_max_deg))
    return float(min(RHO_MAX, max(light.largest_sine for light in scene.lights) + view))


def discs(scene: Scene | None) -> list[tuple[tuple[float, float], float]]:
    """Lists discs in (u, v) that hold all that a scene reaches, as (centre, radius).

    Under a fixed light, (u, v) lies within sin(theta_max) of -wi. A light of some extent is one disc for each cell of
    0.1 rad. Under cameras, and without a scene, there is one disc.
    """
    if scene is None or scene.cameras is not None:
        return [((0.0, 0.0), rho_max(scene))]
    reach, found = float(np.sin(np.radians(scene.views.theta_max_deg))), []
    for light in scene.lights:
        gap = _OF_DISCS / np.sqrt(2.0) if light.solid_angle else 0.0
        found += [((-float(wi[0]), -float(wi[1])), reach + gap) for wi in light.lattice(_OF_DISCS)[0]]
    return found


def _flat(scene: Scene, count: int) -> Visited:
    views, each = scene.views.patch, count / len(scene.lights)
    parts = []
    for light, share in zip(scene.lights, scene.shares, strict=True):
        of_views, of_pairs = views.solid_angle / each, views.solid_angle * light.solid_angle / each
        spacing = max(_FINEST, of_views**0.5, of_pairs**0.25)
        wr, areas = views.lattice(spacing)
        wi, powers = light.lattice(spacing)
        above, gap = wi[:, 2] > 0.0, spacing / np.sqrt(2.0)
        wi, powers = wi[above], powers[above]
        uvw = geometry.uvw(wi[:, None], wr[None]).reshape(-1, 3)
        weight = share * np.outer(powers / light.power, areas * wr[:, 2]).ravel()
        gaps = np.full(len(uvw), gap + (gap if light.solid_angle else 0.0))
        parts.append(Visited(uvw, weight, gaps, np.repeat(wi, len(wr), axis=0)))
    return _joined(parts)


def _through_cameras(scene: Scene, count: int) -> Visited:
    parts = []
    for raster in seen.rasters(scene):
        pixels = int(raster.seen.met.sum())
        for light, share in zip(scene.lights, scene.shares, strict=True):
            each = max(1.0, count / (len(scene.lights) * pixels))
            spacing = max(_FINEST, np.sqrt(light.solid_angle / each))
            gap = spacing / np.sqrt(2.0) if light.solid_angle else 0.0
            for world, power in zip(*light.lattice(spacing), strict=True):
                parts.append(_of_raster(raster, world, share * power / light.power, gap))
    return _joined(parts)


def _of_raster(raster: seen.Raster, light: Array, power: float, gap: float) -> Visited:
    """Samples the pixels of a raster under parallel light (3,)."""
    wi = raster.seen.frame @ light
    uvw = geometry.uvw(wi, raster.seen.wr)
    gaps = np.zeros(len(uvw))
    for one, two in raster.neighbours:
        apart = np.linalg.norm(uvw[one] - uvw[two], axis=1)
        np.maximum.at(gaps, one, apart)
        np.maximum.at(gaps, two, apart)
    # a pixel whose neighbours are on other sheets is as wide as the pixels are on average
    gaps = np.where(gaps > 0.0, gaps, np.mean(gaps[gaps > 0.0]) if gaps.any() else RHO_MAX) + gap
    # NaN, of what is not met, is not above
    above = wi[:, 2] > 0.0
    return Visited(uvw[above], power * raster.weight[above], gaps[above], wi[above])


def _joined(parts: list[Visited]) -> Visited:
    return Visited(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
