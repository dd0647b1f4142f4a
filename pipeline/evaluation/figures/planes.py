"""Views by their direction cosines, and the patch with its window on another sample."""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.surface.heightfield import HeightField


def views(x: ArrayLike, y: ArrayLike = 0.0) -> Array:
    """Return the views (n, 3) whose direction cosines along x and y are given, (n,) or one number each."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    return np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1)


def normal_light(wr: Array) -> Array:
    """Return wi (n, 3) at normal incidence for views (n, 3)."""
    return np.broadcast_to(geometry.direction(0.0, 0.0), wr.shape).copy()


def under_normal_light(x: ArrayLike, y: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Return wi at normal incidence and wr, (n, 3) each, for direction cosines as `views` takes them."""
    wr = views(x, y)
    return normal_light(wr), wr


def window_on_sample_zero(field: HeightField) -> HeightField:
    """Return the patch rolled by half its size: the window lies on sample 0, over the seams, as in public codes."""
    ny, nx = field.shape
    return HeightField(np.roll(field.heights_um, (ny // 2, nx // 2), axis=(0, 1)), field.pitch_um)
