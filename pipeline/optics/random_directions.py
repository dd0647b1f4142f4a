"""Random pairs of light and view, over which errors are stated, anywhere or beside the mirror directions."""

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.optics.scene import Scene

# the horizon is omitted, where G grows like 1 / cos
_WIDEST_DEG = 88.0
# lights that graze more have mirror directions beyond the omitted horizon
_WIDEST_LIGHT_DEG = 85.0


def random_pairs(scene: Scene | None, count: int, seed: int) -> tuple[Array, Array]:
    """Draws pairs of light and view, uniform over the projected hemisphere or over a scene.

    scene: its lights and the cone of its views; None for the hemisphere. count: number of pairs. seed: of the draw.
    Returns unit vectors wi, wr, (count, 3) each.
    """
    rng = np.random.default_rng(seed)
    theta_max = 90.0 if scene is None else scene.views.theta_max_deg
    widest = np.sin(np.radians(min(theta_max, _WIDEST_DEG)))
    wr = geometry.direction(np.arcsin(widest * np.sqrt(rng.random(count))), 2 * np.pi * rng.random(count))
    if scene is None:
        wi = geometry.direction(np.arcsin(widest * np.sqrt(rng.random(count))), 2 * np.pi * rng.random(count))
    else:
        lights = [geometry.direction(*np.radians([s.theta_deg, s.phi_deg])) for s in scene.lights]
        wi = np.array(lights)[rng.integers(len(lights), size=count)]
    return wi, wr


def flank_pairs(scene: Scene | None, rho: Array, phi: Array, seed: int) -> tuple[Array, Array]:
    """Draws lights, and finds the views at given (u, v) from their mirror directions.

    Lights are uniform over the projected hemisphere up to 85 degrees, or over those of a scene.

    scene: its lights and the cone of its views; None for the hemisphere. rho, phi: polar coordinates of (u, v),
    (count,) each, radians. seed: of the draw.
    Returns unit vectors wi, wr, (count, 3) each. Pairs are NaN whose view is outside the cone or within 2 degrees of
    the horizon.
    """
    rng = np.random.default_rng(seed)
    theta_max = 90.0 if scene is None else scene.views.theta_max_deg
    if scene is None:
        widest = np.sin(np.radians(_WIDEST_LIGHT_DEG))
        wi = geometry.direction(np.arcsin(widest * np.sqrt(rng.random(len(rho)))), 2 * np.pi * rng.random(len(rho)))
    else:
        lights = [geometry.direction(*np.radians([s.theta_deg, s.phi_deg])) for s in scene.lights]
        wi = np.array(lights)[rng.integers(len(lights), size=len(rho))]
    # (u, v) = -(wi + wr)
    across = -wi[:, :2] - np.stack([rho * np.cos(phi), rho * np.sin(phi)], axis=-1)
    squared = np.sum(across**2, axis=1)
    seen = squared <= np.sin(np.radians(min(theta_max, _WIDEST_DEG))) ** 2
    up = np.sqrt(1.0 - np.where(seen, squared, 0.0))
    wr = np.concatenate([across, up[:, None]], axis=1)
    return np.where(seen[:, None], wi, np.nan), np.where(seen[:, None], wr, np.nan)
