"""Faults of a scene that only its files and its rays show, found before any work starts."""

import numpy as np

from pipeline.scene import seen
from pipeline.scene.lights import Environment, Range
from pipeline.scene.model import Scene

# cells of a light, rad, that are looked for above the horizon
_SPACING = 0.1


def faults(scene: Scene) -> list[tuple[str, str]]:
    """Lists the faults of a scene as (path of the key below [scene], message)."""
    return _environments(scene) or (_flat(scene) if scene.cameras is None else _through_cameras(scene))


def _environments(scene: Scene) -> list[tuple[str, str]]:
    found = []
    for i, light in enumerate(scene.lights):
        if isinstance(light, Environment):
            try:
                _ = light.map
            except ValueError as error:
                found.append((f"lights.{i}.path", f"{light.path}: {error}"))
    return found


def _flat(scene: Scene) -> list[tuple[str, str]]:
    """Finds lights that are not above the horizon of a flat sample."""
    found = []
    for i, light in enumerate(scene.lights):
        if isinstance(light, Environment):
            if not np.any(light.lattice(_SPACING)[0][:, 2] > 0.0):
                found.append((f"lights.{i}.path", f"{light.path}: expected light above the horizon, got none"))
            continue
        theta = light.theta_deg[1] if isinstance(light, Range) else light.theta_deg
        if theta > 90.0 or (theta == 90.0 and not isinstance(light, Range)):
            text = f"expected a light above the horizon, less than 90 degrees from the normal, got {theta:g}"
            found.append((f"lights.{i}.theta_deg", text))
    return found


def _through_cameras(scene: Scene) -> list[tuple[str, str]]:
    """Finds a mesh that cannot be used, cameras that see nothing, and lights that reach nothing that is seen."""
    try:
        shown = seen.rasters(scene)
    except seen.UnseenError as error:
        return [(error.key, str(error))]
    except KeyError as error:
        return [("mesh.along", str(error.args[0]))]
    except ValueError as error:
        return [("mesh.path", str(error))]
    normals = np.concatenate([raster.seen.frame[raster.seen.met, 2] for raster in shown])
    text = "expected light on what the cameras see, but it is below the horizon there"
    return [
        (f"lights.{i}", text)
        for i, light in enumerate(scene.lights)
        if not any(np.max(normals @ one) > 0.0 for one in light.lattice(_SPACING)[0])
    ]
