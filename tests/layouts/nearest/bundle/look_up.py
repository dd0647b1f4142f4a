"""The look-up of a bundle."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array


class NearestTextures:
    """The texel that is nearest to (u, v)."""

    def __init__(self, grid: dict[str, Any], planes: list[NDArray[Any]], _scale: list[float]) -> None:
        self.n, self.plane = grid["width"], planes[0][..., :3]

    def value(self, u: Array, v: Array, _w: Array) -> Array:
        column, row = (np.rint((x + 2.0) / 4.0 * (self.n - 1)).astype(int) for x in (u, v))
        return self.plane[row, column].astype(float)


textures = NearestTextures
