"""Radiance in XYZ for pairs of directions, from a table or from the exact reference."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.config.models import Config
from pipeline.optics import brdf, geometry
from pipeline.optics.geometry import Array
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress, silent
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.table import PolarTable
from pipeline.tables.taylor import table as taylor
from pipeline.tables.taylor.table import TaylorTable

# XYZ (directions, 3) under 1 RU for wi, wr (directions, 3)
Evaluator = Callable[[Array, Array], Array]
_AT_ONCE = 16384


def table_evaluator(table: PolarTable | TaylorTable, config: Config, progress: Progress = silent) -> Evaluator:
    """XYZ = C cos(ti) times what the table holds; NaN where the table's scene does not reach."""
    outside = _outside_factor(table, config)

    def evaluate(wi: Array, wr: Array) -> Array:
        factor = outside(wi, wr)
        uvw = geometry.uvw(wi, wr)
        out = np.empty((len(wr), 3))
        for first in range(0, len(wr), _AT_ONCE):
            part = np.s_[first : first + _AT_ONCE]
            out[part] = factor[part, None] * _look_up(table, uvw[part])
            progress("look-up", min(1.0, (first + _AT_ONCE) / len(wr)))
        return out

    return evaluate


def _outside_factor(table: PolarTable | TaylorTable, config: Config) -> Callable[[Array, Array], Array]:
    """C cos(ti), as far as the table does not hold it: polar tables hold a metal's reflectance at every angle."""
    if isinstance(table, PolarTable) and config.material.fresnel == "conductor":
        return partial(brdf.geometry_factor, config.material)
    return partial(brdf.direction_factor, config.material, trapezoid(config.light, config.mean_step_nm))


def _look_up(table: PolarTable | TaylorTable, uvw: Array) -> Array:
    return polar.look_up(table, uvw) if isinstance(table, PolarTable) else taylor.look_up(table, uvw)


def relative_unit(config: Config) -> float:
    """Y of 1 RU in a config's normalisation: what exposures are multiples of."""
    quadrature = trapezoid(config.light, config.mean_step_nm)
    return brdf.relative_unit(config.material, quadrature, config.coherence.sigma_um)


@dataclass(frozen=True)
class Map:
    """The views of a BRDF map ([D14] sec. 7): pixel centre (x, y) in [-1, 1]^2 is (sin t cos p, sin t sin p).

    +y is up: the first image row has y near +1. Pixels outside `radius` are no views and stay 0.
    """

    size: int
    radius: float = 1.0

    def _axes(self) -> tuple[Array, Array]:
        # in this order of steps opposite pixels are opposite to the last bit, so that one sum serves both
        centre = (2.0 * np.arange(self.size) + 1.0 - self.size) / self.size
        x, y = np.meshgrid(centre, -centre)
        return x, y

    @property
    def inside(self) -> np.ndarray:
        """bool (size, size): pixels that are views."""
        x, y = self._axes()
        return np.asarray(np.hypot(x, y) < self.radius)

    def views(self) -> Array:
        """Directions (views, 3) of the pixels inside, row by row."""
        x, y = (axis[self.inside] for axis in self._axes())
        return np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1)

    def image(self, values: Array) -> Array:
        """Values of the views (views, ...) as an image (size, size, ...), 0 outside."""
        out = np.zeros((self.size, self.size, *values.shape[1:]))
        out[self.inside] = values
        return out


def render_map(evaluate: Evaluator, light: Array, views: Map) -> Array:
    """XYZ image (size, size, 3) under 1 RU from one light, a direction (3,)."""
    wr = views.views()
    return views.image(evaluate(np.broadcast_to(light, wr.shape), wr))
