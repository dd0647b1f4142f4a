"""Random pairs of light and view, over which errors are stated."""

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.optics.scene import Scene

# the horizon is omitted, where G grows like 1 / cos
_WIDEST_DEG = 88.0


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
