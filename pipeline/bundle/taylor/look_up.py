"""The look-up in the paper's tables, as the evaluator of a bundle holds it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array


class TaylorTextures:
    """I_p on a grid of (u, v), bilinear between texels; i_p is (v, u, channel, p), computed is (v, u)."""

    def __init__(self, grid: dict[str, Any], planes: list[NDArray[Any]], scale: list[float]) -> None:
        self.i_p = np.stack([plane[..., :3] for plane in planes], axis=-1)
        self.scale, self.computed = scale, planes[0][..., 3] == 1.0
        self.n, self.power = int(grid["width"]), float(grid["power"])
        if not self.power > 0.0:
            raise ValueError(f"expected a power above 0, got {self.power}")

    def value(self, u: Array, v: Array, w: Array) -> Array:
        """Computes sum_p w^p I_p(u, v), (directions, 3)."""
        column, row = self.texel(u), self.texel(v)
        left, low = (np.clip(np.floor(index).astype(int), 0, self.n - 2) for index in (column, row))
        a, b, total = column - left, row - low, np.zeros((len(w), 3))
        for up, right, weight in ((0, 0, (1 - a) * (1 - b)), (0, 1, a * (1 - b)), (1, 0, (1 - a) * b), (1, 1, a * b)):
            at = low + up, left + right
            known = self.computed[at] | (weight == 0.0)
            total += np.where(known, weight, np.nan)[:, None] * self.polynomial(self.i_p[at], w)
        return total

    def texel(self, u: Array) -> Array:
        """Computes the texel index i of u = 2 |t|^a sign(t), t = 2 i / (n - 1) - 1; texture: (i + 1/2) / n."""
        return np.asarray(0.5 * (np.sign(u) * (np.abs(u) / 2.0) ** (1.0 / self.power) + 1.0) * (self.n - 1))

    def polynomial(self, i_p: NDArray[Any], w: Array) -> Array:
        """Computes sum_p w^p I_p by Horner's rule, from the highest p down."""
        total = np.zeros((len(w), 3))
        for p in range(len(self.scale) - 1, -1, -1):
            total = total * w[:, None] + self.scale[p] * i_p[..., p].astype(float)
        return total


textures = TaylorTextures
