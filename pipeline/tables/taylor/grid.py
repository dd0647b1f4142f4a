"""The paper's non-linear grid of (u, v), [D14] sec. 5: nodes at 2 |t|^a sign(t), t uniform in [-1, 1].

Node i of n has t = 2 i / (n - 1) - 1; n is odd, so that the middle node is exactly 0. In a texture node i is
the centre of texel i: texture coordinate (i + 1/2) / n.
"""

import numpy as np

from pipeline.arrays import Array

U_MAX = 2.0


def node_position(t: Array, power: float) -> Array:
    """u = 2 |t|^a sign(t)."""
    return np.asarray(U_MAX * np.sign(t) * np.abs(t) ** power)


def grid_coordinate(u: Array, power: float) -> Array:
    """t, the inverse of `node_position`."""
    return np.asarray(np.sign(u) * (np.abs(u) / U_MAX) ** (1.0 / power))


def nodes(resolution: int, power: float) -> Array:
    """All node positions along one axis, (resolution,)."""
    i = np.arange(resolution)
    return node_position((2.0 * i - (resolution - 1)) / (resolution - 1), power)


def node_index(u: Array, resolution: int, power: float) -> Array:
    """Fractional node index of u, 0 .. resolution - 1: what a bilinear look-up interpolates over."""
    return 0.5 * (grid_coordinate(u, power) + 1.0) * (resolution - 1)
