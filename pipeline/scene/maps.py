"""The views of a map, which shows one light: as far as a scene's table reaches."""

from collections.abc import Sequence

import numpy as np

from pipeline.scene.lights import MOST_LIGHTS, Direction, Parallel, SceneLight
from pipeline.scene.model import LEAST_DEG, Scene, Views
from pipeline.scene.visited import rho_max


def map_radius(scene: Scene | None, light: Direction) -> float:
    """Computes the radius of a light's map, sin(theta) of its outermost views: as far as the table reaches.

    That is the scene's theta_max on a flat sample, and what its largest |(u, v)| leaves where cameras see it.
    """
    if scene is None:
        return 1.0
    if scene.cameras is None:
        return float(np.sin(np.radians(scene.views.theta_max_deg)))
    return float(min(1.0, rho_max(scene) - np.sin(np.radians(light.theta_deg))))


def map_scenes(scene: Scene, lights: Sequence[Direction]) -> list[Scene]:
    """Returns what the maps of some lights show of a scene, as scenes of as many lights as one may have."""
    by_radius: dict[float, list[SceneLight]] = {}
    for light in lights:
        towards = Parallel(theta_deg=light.theta_deg, phi_deg=light.phi_deg)
        by_radius.setdefault(map_radius(scene, light), []).append(towards)
    return [
        Scene(lights=parallel[first : first + MOST_LIGHTS], views=_views(radius))
        for radius, parallel in by_radius.items()
        for first in range(0, len(parallel), MOST_LIGHTS)
    ]


def _views(radius: float) -> Views:
    widest = float(np.degrees(np.arcsin(max(radius, 0.0))))
    return Views(theta_max_deg=max(widest, LEAST_DEG))
