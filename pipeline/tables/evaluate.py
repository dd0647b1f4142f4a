"""Radiance in XYZ for pairs of directions, from a table or from the exact reference."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.optics.brdf import Radiometry
from pipeline.progress import Progress, silent

# XYZ (directions, 3) under 1 RU for wi, wr (directions, 3)
Evaluator = Callable[[Array, Array], Array]
_AT_ONCE = 16384


class Table(Protocol):
    """A table of any layout, as it is looked up."""

    def look_up(self, uvw: Array) -> Array:
        """XYZ / (C cos ti) (directions, 3) at `uvw` (directions, 3); NaN where the table does not reach."""

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """C cos(ti) (directions,): the factors of the radiance that the table leaves out."""


def table_evaluator(table: Table, radiometry: Radiometry, progress: Progress = silent) -> Evaluator:
    """XYZ = C cos(ti) times the table's value; NaN where the table's scene does not reach."""

    def evaluate(wi: Array, wr: Array) -> Array:
        factor = table.direction_factor(radiometry, wi, wr)
        uvw = geometry.uvw(wi, wr)
        out = np.empty((len(wr), 3))
        for first in range(0, len(wr), _AT_ONCE):
            part = np.s_[first : first + _AT_ONCE]
            out[part] = factor[part, None] * table.look_up(uvw[part])
            progress("look-up", min(1.0, (first + _AT_ONCE) / len(wr)))
        return out

    return evaluate


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
