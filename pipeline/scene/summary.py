"""What a scene visits, as numbers for people and programs."""

from typing import Any

import numpy as np

from pipeline.scene import seen
from pipeline.scene.lights import Environment
from pipeline.scene.model import Scene
from pipeline.scene.visited import CELLS, SAMPLES, cells, rho_max, visited


def summary(scene: Scene) -> dict[str, Any]:
    """Summarises the directions that a scene visits.

    Returns the largest |(u, v)|; least and largest |w|; the share of the disc |(u, v)| <= 2 in cells of 1/32 that
    hold a sample; gaps of the samples; bright directions of environments with their shares of the map's power; and of
    each camera the share of its pixels that meet the sample and the solid angle of the middle pixel, sr.
    """
    found = visited(scene, SAMPLES)
    width = np.abs(found.uvw[:, 2])
    maps = [light.map.bright for light in scene.lights if isinstance(light, Environment)]
    rasters = [] if scene.cameras is None else seen.rasters(scene)
    return {
        "rho_max": rho_max(scene),
        "w": [float(width.min()), float(width.max())],
        "disc_share": float(len(np.unique(cells(found.uvw), axis=0)) / (np.pi * (CELLS / 2) ** 2)),
        "samples": len(found.uvw),
        "gap": {"median": float(np.median(found.gap)), "largest": float(found.gap.max())},
        "bright": [{"direction": part.centre.tolist(), "power": part.power} for bright in maps for part in bright],
        "cameras": [
            {"met_share": float(raster.seen.met.mean()), "pixel_sr": raster.camera.pixel_sr} for raster in rasters
        ],
    }
