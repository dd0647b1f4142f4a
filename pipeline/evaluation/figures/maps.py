"""Exact BRDF maps of the bench's surfaces, and the errors of other maps against them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.plots import map_plots
from pipeline.evaluation.plots.map_plots import Panel
from pipeline.optics import geometry
from pipeline.optics.colour import delta_e, displayed_srgb, pixels
from pipeline.progress import Progress
from pipeline.surface.recipes.parameters import Blazed
from pipeline.tables.evaluate import Map

# [D14] sec. 7 shows its maps at 1500 RU; table 2 ends at 7500
SHOWN_RU, STRICT_RU = EXPOSURES_RU = 1500.0, 7500.0
ERROR_COLUMNS = tuple(f"mean ΔE, {ru:g} RU" for ru in EXPOSURES_RU)
# one just noticeable difference ([D14] sec. 6.3)
NOTICEABLE = 1.0
# |(u, v)| of Xenopeltis' first order along its fingers, 1.5 um apart, in visible light
XENOPELTIS_RHO = (0.25, 0.5)
_SIZE, _QUICK_SIZE = 201, 61
# one of 255 steps of a channel, linear: below it a pixel is black
_LIT = (1.0 / 255.0) ** 2.2
# (theta, phi) in degrees
Light = tuple[float, float]
NORMAL: Light = (0.0, 0.0)


def views_of(bench: Bench) -> Map:
    """Return the views of every map of the bench: inside radius 0.98, as errors are stated."""
    return Map(_QUICK_SIZE if bench.quick else _SIZE, MAP_RADIUS)


def directions(views: Map, light: Light) -> tuple[Array, Array]:
    """Return wi and wr (views, 3) of a map under one light."""
    wr = views.views()
    wi = geometry.direction(np.radians(light[0]), np.radians(light[1]))
    return np.ascontiguousarray(np.broadcast_to(wi, wr.shape)), wr


def blazed_recipe(bench: Bench) -> Blazed:
    """Return the recipe of the bench's blazed grating. Raises ValueError where it is another surface."""
    recipe = bench.blazed.config.surface.recipe
    if not isinstance(recipe, Blazed):
        raise ValueError(f"{bench.blazed.name}: expected a blazed recipe")
    return recipe


def mean_delta_e(surface: BenchSurface, found: Array, exact: Array, exposure_ru: float) -> float:
    """Return the mean CIELAB error over the views of XYZ (views, 3)."""
    return float(np.mean(delta_e(found / surface.unit, exact / surface.unit, exposure_ru)))


def lit_views(xyz_ru: Array) -> NDArray[np.bool_]:
    """Return the views (views,) of XYZ in RU (views, 3) that are not black at 1500 RU: few of a grating's map are."""
    return np.asarray(np.max(displayed_srgb(xyz_ru, SHOWN_RU), axis=-1) > _LIT)


def exact_maps(surface: BenchSurface, views: Map, lights: Sequence[Light], progress: Progress) -> list[Array]:
    """Compute XYZ (views, 3) by the exact reference, one map a light."""
    exact, config = surface.reference(progress), surface.config
    return [
        exact.xyz(config.light, config.material, *directions(views, light), progress=progress) for light in lights
    ]


def panel(views: Map, xyz_ru: Array, title: str, note: str = "") -> Panel:
    """Return a map of XYZ in RU (views, 3) at 1500 RU, for a sheet of maps."""
    return Panel(pixels(views.image(xyz_ru), SHOWN_RU), title, note)


def sheet(rows: Sequence[Sequence[Panel]], heading: str, row_names: Sequence[str] = ()) -> bytes:
    """Draw maps in rows under a heading that names their exposure, PNG."""
    return map_plots.sheet(rows, f"{heading}, {SHOWN_RU:g} RU, sRGB", row_names)
