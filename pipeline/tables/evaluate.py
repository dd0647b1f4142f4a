"""Radiance in XYZ for pairs of directions, from a table or from the exact reference; BRDF maps."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.optics.brdf import Radiometry
from pipeline.optics.material import Material
from pipeline.progress import Progress, silent

# computes XYZ (directions, 3) for unit vectors wi, wr (directions, 3), in the unit of the material's normalisation
Evaluator = Callable[[Array, Array], Array]
_AT_ONCE = 16384


class Table(Protocol):
    """The look-up that tables of all layouts provide."""

    def look_up(self, uvw: Array) -> Array:
        """Computes XYZ / (C cos ti) (directions, 3) at `uvw` (directions, 3); NaN outside the table."""

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (directions,), the factors that the table does not hold, for wi, wr (directions, 3)."""


def never_negative(xyz: Array) -> Array:
    """Sets the negative values of interpolated XYZ (..., 3) to 0; NaN stays."""
    return np.asarray(np.maximum(xyz, 0.0))


def table_evaluator(table: Table, radiometry: Radiometry, progress: Progress = silent) -> Evaluator:
    """Makes the function that computes XYZ from a table as renderers do: `interpolator` without negative values.

    Parameters and NaN are those of `interpolator`.
    """
    interpolate = interpolator(table, radiometry, progress)
    return lambda wi, wr: never_negative(interpolate(wi, wr))


def interpolator(table: Table, radiometry: Radiometry, progress: Progress = silent) -> Evaluator:
    """Makes the function that interpolates XYZ in a table, C cos(ti) times the table's value.

    Interpolation may overshoot beside bright peaks, so values may be negative.

    table: of any layout. radiometry: light, material and coherence window. progress: called with the share done.
    Returns the function, which gives 0 at and below the horizon, and NaN outside the scene of the table.
    """

    def evaluate(wi: Array, wr: Array) -> Array:
        uvw = geometry.uvw(wi, wr)
        out = np.empty((len(wr), 3))
        for first in range(0, len(wr), _AT_ONCE):
            part = np.s_[first : first + _AT_ONCE]
            # a metal's reflectance takes an array over wavelengths for every direction
            factor = table.direction_factor(radiometry, wi[part], wr[part])
            out[part] = factor[:, None] * table.look_up(uvw[part])
            progress("look-up", min(1.0, (first + _AT_ONCE) / len(wr)))
        out[~geometry.above_horizon(wi, wr)] = 0.0
        return out

    return evaluate


@dataclass(frozen=True)
class Map:
    """The views of a BRDF map ([D14] sec. 7).

    The pixel centre (x, y) in [-1, 1]^2 is the view direction (sin t cos p, sin t sin p). +y is up: the first image
    row has y near +1. Pixels outside `radius` are not views and are 0.

    size: pixels along each side. radius: largest sin t of a view, dimensionless.
    """

    size: int
    radius: float = 1.0

    def _axes(self) -> tuple[Array, Array]:
        # this order of operations makes opposite pixels exactly opposite, so that one sum serves both
        centre = (2.0 * np.arange(self.size) + 1.0 - self.size) / self.size
        x, y = np.meshgrid(centre, -centre)
        return x, y

    @cached_property
    def inside(self) -> np.ndarray:
        """Mask of the pixels that are views, bool (size, size)."""
        x, y = self._axes()
        return np.asarray(np.hypot(x, y) < self.radius)

    def views(self) -> Array:
        """Computes the unit vectors (views, 3) of the pixels that are views, row by row."""
        x, y = (axis[self.inside] for axis in self._axes())
        return np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1)

    def image(self, values: Array) -> Array:
        """Arranges values of the views (views, ...) as an image (size, size, ...), 0 outside."""
        out = np.zeros((self.size, self.size, *values.shape[1:]))
        out[self.inside] = values
        return out


def map_bytes(size: int) -> int:
    """Computes the memory of a map and of its picture, bytes: four arrays of XYZ or sRGB in float64.

    Directions, factors and values of the views take less.
    """
    return 4 * 3 * 8 * size**2


def look_up_bytes(wavelengths: int, material: Material) -> int:
    """Computes the memory of a metal's factor for the directions that are looked up at once, bytes.

    wavelengths: of the mean over wavelength. Fresnel's equations hold four complex arrays.
    """
    return 4 * 16 * _AT_ONCE * wavelengths if material.fresnel == "conductor" else 0


def render_map(evaluate: Evaluator, light: Array, views: Map) -> Array:
    """Computes a map.

    evaluate: computes XYZ of pairs of directions. light: unit vector (3,). views: the pixels.
    Returns XYZ (size, size, 3).
    """
    wr = views.views()
    return views.image(evaluate(np.broadcast_to(light, wr.shape), wr))
