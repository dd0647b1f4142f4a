"""The views of a map, which shows one light: as far as a scene's table reaches."""

import numpy as np

from pipeline.scene.lights import Direction, Parallel
from pipeline.scene.model import Scene, Views
from pipeline.scene.visited import rho_max

# the least cone of views that a scene may have
_LEAST_DEG = 0.1


def map_radius(scene: Scene | None, light: Direction) -> float:
    """Computes the radius of a light's map, sin(theta) of its outermost views: as far as the table reaches.

    That is the scene's theta_max on a flat sample, and what its largest |(u, v)| leaves where cameras see it.
    """
    if scene is None:
        return 1.0
    if scene.cameras is None:
        return float(np.sin(np.radians(scene.views.theta_max_deg)))
    return float(min(1.0, rho_max(scene) - np.sin(np.radians(light.theta_deg))))


def map_scene(scene: Scene, light: Direction) -> Scene:
    """Returns what a light's map shows of a scene, as a scene of its own."""
    widest = float(np.degrees(np.arcsin(max(map_radius(scene, light), 0.0))))
    towards = Parallel(theta_deg=light.theta_deg, phi_deg=light.phi_deg)
    return Scene(lights=[towards], views=Views(theta_max_deg=max(widest, _LEAST_DEG)))
