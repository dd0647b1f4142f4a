"""Exact BRDF maps of the bench's surfaces, and how far others are from them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.figures.figure import Bench, Surface
from pipeline.optics import geometry
from pipeline.optics.colour import DISPLAY_GAMMA, delta_e, displayed_srgb
from pipeline.progress import Progress
from pipeline.surface.recipes.parameters import Blazed
from pipeline.tables.evaluate import Map

# [D14] sec. 7 shows its maps at 1500 RU; table 2 ends at 7500
SHOWN_RU, STRICT_RU = 1500.0, 7500.0
_SIZE, _QUICK_SIZE = 201, 61
# one of 255 steps of a channel, linear: below it a pixel is black
_LIT = (1.0 / 255.0) ** DISPLAY_GAMMA
# (theta, phi) in degrees
Light = tuple[float, float]
NORMAL: Light = (0.0, 0.0)


def views_of(bench: Bench) -> Map:
    """The views of every map of the bench: inside radius 0.98, as errors are stated."""
    return Map(_QUICK_SIZE if bench.quick else _SIZE, MAP_RADIUS)


def directions(views: Map, light: Light) -> tuple[Array, Array]:
    """wi and wr (views, 3) of a map under one light."""
    wr = views.views()
    wi = geometry.direction(np.radians(light[0]), np.radians(light[1]))
    return np.ascontiguousarray(np.broadcast_to(wi, wr.shape)), wr


def reference(surface: Surface, progress: Progress) -> Reference:
    """The exact reference of a surface under its config's window."""
    config = surface.config
    return Reference(surface.field, config.coherence.sigma_um, config.light.lambda_min_nm, progress)


def blazed_recipe(bench: Bench) -> Blazed:
    """What the bench's blazed grating is made of. Raises ValueError where it is another surface."""
    recipe = bench.blazed.config.surface.recipe
    if not isinstance(recipe, Blazed):
        raise ValueError(f"{bench.blazed.name}: expected a blazed recipe")
    return recipe


def mean_delta_e(config: Config, found: Array, exact: Array, exposure_ru: float) -> float:
    """Mean CIELAB error over the views of XYZ (views, 3)."""
    unit = config.radiometry.unit
    return float(np.mean(delta_e(found / unit, exact / unit, exposure_ru)))


def lit_views(xyz_ru: Array) -> NDArray[np.bool_]:
    """Which views (views,) of XYZ in RU (views, 3) are not black at 1500 RU: of a grating's map nearly all are."""
    return np.asarray(np.max(displayed_srgb(xyz_ru, SHOWN_RU), axis=-1) > _LIT)


def exact_maps(surface: Surface, views: Map, lights: Sequence[Light], progress: Progress) -> list[Array]:
    """XYZ (views, 3) by the exact reference, one map a light."""
    exact, config = reference(surface, progress), surface.config
    return [
        exact.xyz(config.light, config.material, *directions(views, light), progress=progress) for light in lights
    ]
