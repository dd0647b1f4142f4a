"""Pairs of light and view, over which errors are stated: of a scene or anywhere, and beside the mirror directions.

All are unit vectors in the sample's own frame: x along the scan's +x, z the normal. Pairs of a scene are drawn with
the density of what it shows, so that each counts the same: a light by its power, a point of it by its radiance; a
view of a flat sample by its projected solid angle, and a pixel of a camera by its solid angle.
"""

from collections.abc import Callable

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.scene import seen
from pipeline.scene.model import WIDEST_DEG, Scene
from pipeline.scene.visited import CELLS, SAMPLES, cells, visited

# lights that graze more have mirror directions beyond the omitted horizon
_WIDEST_LIGHT_DEG = 85.0
# a draw is repeated until enough lights are above the horizon of what the pixels see
_MOST_DRAWS = 64
# pairs drawn for each that is wanted on the border; gaps between cells that are closed
_BORDER_DRAWS, _CLOSED = 250, 5


def random_pairs(scene: Scene | None, count: int, seed: int) -> tuple[Array, Array]:
    """Draws pairs of light and view, uniform over the projected hemisphere or over a scene.

    scene: its lights and views; None for the hemisphere. count: number of pairs. seed: of the draw.
    Returns unit vectors wi, wr, (count, 3) each. Raises seen.UnseenError where no pixel of a scene's cameras is lit.
    """
    rng = np.random.default_rng(seed)
    if scene is None:
        wr = _hemisphere(rng, count, WIDEST_DEG)
        return _hemisphere(rng, count, WIDEST_DEG), wr
    return _drawn(_views(scene, rng), lambda frame: _lights(scene, rng, frame), count)


def border_pairs(scene: Scene | None, count: int, seed: int) -> tuple[Array, Array]:
    """Draws pairs of a scene in the outermost cells of (u, v), 1/32 wide, that any of many pairs meet.

    Under lights of some extent pairs become rare towards the border: one in three hundred is in these cells.

    Returns unit vectors wi, wr, at most (count, 3) each; none without a scene, whose border is the horizon.
    """
    if scene is None:
        return np.empty((0, 3)), np.empty((0, 3))
    from scipy import ndimage

    wi, wr = random_pairs(scene, _BORDER_DRAWS * count, seed)
    cell, met = tuple(cells(geometry.uvw(wi, wr)).T), np.zeros((CELLS, CELLS), bool)
    met[cell] = True
    # cells that none of the pairs meets by chance are no border
    met = ndimage.binary_closing(met, np.ones((_CLOSED, _CLOSED)))
    # beyond |(u, v)| = 2 there is nothing to see
    inner = ndimage.binary_erosion(met, np.ones((3, 3)), border_value=1)
    outermost = np.flatnonzero(~inner[cell])[:count]
    return wi[outermost], wr[outermost]


def flank_pairs(scene: Scene | None, rho: Array, phi: Array, seed: int) -> tuple[Array, Array]:
    """Draws lights, and finds the views at given (u, v) from their mirror directions.

    Lights are uniform over the projected hemisphere up to 85 degrees, or over those of a scene. Under cameras they
    are those of the nearest direction that is visited.

    scene: its lights and views; None for the hemisphere. rho, phi: polar coordinates of (u, v), (count,) each,
    radians. seed: of the draw.
    Returns unit vectors wi, wr, (count, 3) each. Pairs are NaN whose view is not in the scene or within 2 degrees of
    the horizon.
    """
    rng, uv = np.random.default_rng(seed), np.stack([rho * np.cos(phi), rho * np.sin(phi)], axis=-1)
    if scene is None:
        wi = _hemisphere(rng, len(rho), _WIDEST_LIGHT_DEG)
    elif scene.cameras is None:
        wi = _lights(scene, rng, np.tile(np.eye(3), (len(rho), 1, 1)))
    else:
        wi = _nearest_lights(scene, uv)
    # (u, v) = -(wi + wr)
    across = -wi[:, :2] - uv
    squared = np.sum(across**2, axis=1)
    reached = (squared <= np.sin(np.radians(WIDEST_DEG)) ** 2) & (wi[:, 2] > 0.0)
    up = np.sqrt(1.0 - np.where(reached, squared, 0.0))
    wr = np.concatenate([across, up[:, None]], axis=1)
    if scene is not None and scene.cameras is None:
        reached[reached] = scene.views.patch.holds(wr[reached])
    return np.where(reached[:, None], wi, np.nan), np.where(reached[:, None], wr, np.nan)


def _nearest_lights(scene: Scene, uv: Array) -> Array:
    """Finds the lights (count, 3) of the visited directions within whose gap each (u, v) lies; NaN where none is."""
    from scipy.spatial import cKDTree

    found = visited(scene, SAMPLES)
    near = np.hypot(found.uvw[:, 0], found.uvw[:, 1]) <= np.linalg.norm(uv, axis=1).max() + found.gap
    if not near.any():
        return np.full((len(uv), 3), np.nan)
    distance, nearest = cKDTree(found.uvw[near, :2]).query(uv)
    return np.where((distance <= found.gap[near][nearest])[:, None], found.wi[near][nearest], np.nan)


def _hemisphere(rng: np.random.Generator, count: int, widest_deg: float) -> Array:
    """Draws unit vectors (count, 3), uniform over the projected hemisphere up to a polar angle."""
    widest = np.sin(np.radians(widest_deg))
    return geometry.direction(np.arcsin(widest * np.sqrt(rng.random(count))), 2 * np.pi * rng.random(count))


def _lights(scene: Scene, rng: np.random.Generator, frame: Array) -> Array:
    """Draws a light for each frame (n, 3, 3), by their powers; unit vectors (n, 3) in these frames."""
    which, world = rng.choice(len(scene.lights), len(frame), p=scene.shares), np.empty((len(frame), 3))
    for i, light in enumerate(scene.lights):
        world[which == i] = light.draw(rng, int(np.sum(which == i)))
    return np.asarray(np.einsum("nij,nj->ni", frame, world))


_Views = Callable[[int], tuple[Array, Array]]


def _views(scene: Scene, rng: np.random.Generator) -> _Views:
    """Returns a function that draws frames (n, 3, 3) and views (n, 3) of a scene; some may be NaN."""
    if scene.cameras is None:
        low, high = scene.views.theta_min_deg, min(scene.views.theta_max_deg, WIDEST_DEG)
        inner, outer = (np.sin(np.radians(angle)) ** 2 for angle in (low, high))
        start, end = np.radians(scene.views.phi_deg)

        def flat(count: int) -> tuple[Array, Array]:
            theta = np.arcsin(np.sqrt(inner + (outer - inner) * rng.random(count)))
            return np.tile(np.eye(3), (count, 1, 1)), geometry.direction(theta, rng.uniform(start, end, count))

        return flat
    shown = seen.rasters(scene)
    weights = np.concatenate([raster.weight for raster in shown])
    first = np.cumsum([0, *(len(raster.weight) for raster in shown)])

    def pixels(count: int) -> tuple[Array, Array]:
        index = rng.choice(len(weights), count, p=weights / weights.sum())
        frame, wr = np.empty((count, 3, 3)), np.empty((count, 3))
        for raster, start, end in zip(shown, first[:-1], first[1:], strict=True):
            here = (index >= start) & (index < end)
            met = raster.cast(scene, index[here] - start, rng.random((here.sum(), 2)))
            frame[here], wr[here] = met.frame, met.wr
        return frame, wr

    return pixels


def _drawn(views: _Views, lights: Callable[[Array], Array], count: int) -> tuple[Array, Array]:
    """Draws until `count` pairs are above the horizon."""
    lowest = np.cos(np.radians(WIDEST_DEG)) * (1.0 - 1e-12)
    found: list[tuple[Array, Array]] = []
    missing, size = count, count
    for _ in range(_MOST_DRAWS):
        frame, wr = views(size)
        wi = lights(frame)
        # NaN is not above; an explicit light may graze more than the views
        up = (wr[:, 2] >= lowest) & (wi[:, 2] > 0.0)
        kept = np.flatnonzero(up)[:missing]
        found.append((wi[kept], wr[kept]))
        missing -= len(kept)
        if not missing:
            wi, wr = (np.concatenate(both) for both in zip(*found, strict=True))
            return wi, wr
        size = int(np.clip(1.2 * missing * size / max(len(kept), 1), 256, 16 * count + 256))
    raise seen.UnseenError("lights", "expected light on what is seen, but no light is above the horizon there")
