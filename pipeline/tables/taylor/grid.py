"""The paper's non-linear grid of (u, v), [D14] sec. 5: nodes at 2 |t|^a sign(t), t uniform in [-1, 1].

Node i of n has t = 2 i / (n - 1) - 1; n is odd, so that the middle node is exactly 0. In a texture, node i is the
centre of texel i, at texture coordinate (i + 1/2) / n.
"""

import numpy as np

from pipeline.arrays import Array

U_MAX = 2.0


def node_position(t: Array, power: float) -> Array:
    """Computes u = 2 |t|^a sign(t) (...,) from t (...,) in [-1, 1]; power: the exponent a."""
    return np.asarray(U_MAX * np.sign(t) * np.abs(t) ** power)


def grid_coordinate(u: Array, power: float) -> Array:
    """Computes t (...,) from u (...,), the inverse of `node_position`; power: the exponent a."""
    return np.asarray(np.sign(u) * (np.abs(u) / U_MAX) ** (1.0 / power))


def nodes(resolution: int, power: float) -> Array:
    """Computes the positions of all nodes along one axis (resolution,); power: the exponent a."""
    i = np.arange(resolution)
    return node_position((2.0 * i - (resolution - 1)) / (resolution - 1), power)


def node_index(u: Array, resolution: int, power: float) -> Array:
    """Computes the fractional index of a node (...,), 0 .. resolution - 1, from u (...,), for bilinear look-ups."""
    return 0.5 * (grid_coordinate(u, power) + 1.0) * (resolution - 1)
