"""Chebyshev nodes, and where the spectral operator places them over |w|."""

import numpy as np


def chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev's nodes and the matrix that interpolates at them.

    count: number of nodes, n.
    Returns the matrix (n, n) from values at the nodes to coefficients of T_k, [k][node], and the nodes
    x_j = cos(pi (j + 1/2) / n), (n,), which descend within (-1, 1).
    """
    k = np.arange(count)
    angle = np.pi * (k + 0.5) / count
    matrix = np.cos(np.outer(k, angle)) * 2.0 / count
    matrix[0] /= 2.0
    return matrix, np.cos(angle)


def w_nodes(w_terms: int) -> np.ndarray:
    """Return the nodes at which E is taken over |w|, as shares of w_max: Chebyshev's on [0, 1], (w_terms,)."""
    return 0.5 * (chebyshev(w_terms)[1] + 1.0)


def w_max(rho: np.ndarray) -> np.ndarray:
    """Return the largest |w| of any light and view with |(u, v)| = rho: sqrt(4 - rho^2), 0 beyond rho = 2."""
    return np.sqrt(np.maximum(4.0 - rho**2, 0.0))
