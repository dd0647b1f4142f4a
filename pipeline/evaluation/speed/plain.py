"""Plain numpy: the equations as they are printed, one node and wavelength after the other.

Numpy does the sums over coefficients and terms. Also the second way to the kernels' numbers.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import Quadrature


def paper_nodes(built: Stack, quadrature: Quadrature, uv: Array) -> Array:
    """I_p (nodes, 3, 2N + 1) of [D14] eq. 8, 11 and 12 at `uv` (nodes, 2), from a Taylor stack."""
    terms = built.terms
    out = np.zeros((len(uv), 3, 2 * terms - 1))
    n = np.arange(terms)
    factorial = np.cumprod(np.maximum(n, 1).astype(float))
    coefficients = complex_coefficients(built)
    for node, uv_of_node in enumerate(uv):
        for nm, weight in zip(quadrature.lambda_nm, quadrature.weights, strict=True):
            f = uv_of_node / (1e-3 * nm)
            if np.any(np.abs(f) > built.band_per_um):
                continue
            f_n = 1j**n * _transforms(built, coefficients, f)
            kh = 2.0 * np.pi / (1e-3 * nm) * built.half_range_um
            for p in range(2 * terms - 1):
                low, high = max(0, p - terms + 1), min(p, terms - 1)
                i, j = n[low : high + 1], p - n[low : high + 1]
                dots = np.real(f_n[i] * np.conj(f_n[j])) / (factorial[i] * factorial[j])
                out[node, :, p] += kh**p * np.sum(dots) * weight
    return out


def polar_texel(
    built: Stack, coefficients: NDArray[np.complex128], rule: Quadrature, uv: Array, series: NDArray[np.complex128]
) -> Array:
    """X, Y, Z (3, w nodes) of one texel of a polar table, from its Chebyshev stack and its complex coefficients.

    P = sum_n series[l, w, n] F_n(uv / lambda), `series` as pipeline.evaluation.speed.setting has it.
    """
    out = np.zeros((3, series.shape[1]))
    # the stack holds fx >= 0; P(-f) of real heights takes the conjugates of F_n
    turned = uv[0] < 0.0
    for i, nm in enumerate(rule.lambda_nm):
        f = uv / (1e-3 * nm)
        if np.any(np.abs(f) > built.band_per_um):
            continue
        f_n = _transforms(built, coefficients, -f if turned else f)
        amplitude = series[i] @ (np.conj(f_n) if turned else f_n)
        out += np.outer(rule.weights[i], np.abs(amplitude) ** 2)
    return out


def complex_coefficients(built: Stack) -> NDArray[np.complex128]:
    """The stack's coefficients (rows, columns, terms) as complex numbers."""
    return np.asarray(built.coefficients[:, :, 0, : built.terms] + 1j * built.coefficients[:, :, 1, : built.terms])


def _transforms(built: Stack, coefficients: NDArray[np.complex128], f: Array) -> NDArray[np.complex128]:
    """F_n(f) (terms,) under the window, [D14] eq. 8: a weighted sum over the coefficients about f."""
    spread = 2.0 * sigma_f(built.sigma_um) ** 2
    columns, rows = (
        np.arange(-reach, reach + 1) + int(np.rint(x / d))
        for x, d, reach in zip(f, built.spacing_per_um, built.reach, strict=True)
    )
    g_x = np.exp(-((f[0] - columns * built.spacing_per_um[0]) ** 2) / spread)
    g_y = np.exp(-((f[1] - rows * built.spacing_per_um[1]) ** 2) / spread)
    near = coefficients[np.ix_(rows + built.row_zero, columns + built.column_zero)]
    return np.asarray(np.einsum("y,x,yxn->n", g_y, g_x, near))
