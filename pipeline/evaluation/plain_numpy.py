"""The equations as they are printed, in numpy: one direction and one wavelength after the other.

A second implementation of what the kernels compute, and the baseline of `bench speed`.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import Quadrature

Complex = NDArray[np.complex128]


def coefficients_about(built: Stack, f_per_um: Array) -> tuple[tuple[slice, slice], Array, Array] | None:
    """Return the coefficients under the window, [D14] eq. 8.

    f_per_um: (fx, fy) with fx >= 0, which is the half plane that a stack holds. Returns their rows and columns in the
    stack, and the Gaussian weights along y and x; None beyond the scan's Nyquist limits.
    """
    if np.any(np.abs(f_per_um) > built.band_per_um):
        return None
    spread, weights, places = 2.0 * sigma_f(built.sigma_um) ** 2, [], []
    zeros = (built.column_zero, built.row_zero)
    for f, spacing, reach, zero in zip(f_per_um, built.spacing_per_um, built.reach, zeros, strict=True):
        first = round(f / spacing) - reach
        near = np.arange(first, first + 2 * reach + 1)
        weights.append(np.exp(-((f - near * spacing) ** 2) / spread))
        places.append(slice(first + zero, first + zero + len(near)))
    return (places[1], places[0]), weights[1], weights[0]


def complex_coefficients(built: Stack) -> Complex:
    """Return the coefficients of a stack as complex numbers (rows, columns, terms)."""
    return np.asarray(built.coefficients[:, :, 0, : built.terms] + 1j * built.coefficients[:, :, 1, : built.terms])


def _transforms(built: Stack, coefficients: Complex, f_per_um: Array) -> Complex | None:
    """F_n(f) (terms,) under the window, [D14] eq. 8; None beyond the scan's Nyquist limits."""
    found = coefficients_about(built, f_per_um)
    return None if found is None else np.asarray(np.einsum("y,x,yxn->n", *found[1:], coefficients[found[0]]))


def chebyshev_terms(t: Array) -> Iterator[Array]:
    """Give T_0(t), T_1(t), ... without end, each an array as `t`, in [-1, 1]."""
    before, term = t, np.ones_like(t)
    while True:
        yield term
        # T_-1 = T_1 = t
        before, term = term, 2.0 * t * term - before


def paper_nodes(built: Stack, quadrature: Quadrature, uv: Array) -> Array:
    """Return I_p (nodes, 3, 2N + 1) of [D14] eq. 8, 11 and 12 from a Taylor stack at `uv` (nodes, 2), u >= 0."""
    terms = built.terms
    out = np.zeros((len(uv), 3, 2 * terms - 1))
    n = np.arange(terms)
    factorial = np.cumprod(np.maximum(n, 1).astype(float))
    coefficients = complex_coefficients(built)
    for node, uv_of_node in enumerate(uv):
        for nm, weight in zip(quadrature.lambda_nm, quadrature.weights, strict=True):
            transforms = _transforms(built, coefficients, uv_of_node / (1e-3 * nm))
            if transforms is None:
                continue
            f_n = 1j**n * transforms
            kh = 2.0 * np.pi / (1e-3 * nm) * built.half_range_um
            for p in range(2 * terms - 1):
                low, high = max(0, p - terms + 1), min(p, terms - 1)
                i, j = n[low : high + 1], p - n[low : high + 1]
                dots = np.real(f_n[i] * np.conj(f_n[j])) / (factorial[i] * factorial[j])
                out[node, :, p] += kh**p * np.sum(dots) * weight
    return out


def polar_texel(built: Stack, coefficients: Complex, rule: Quadrature, uv: Array, series: Complex) -> Array:
    """Return X, Y, Z (3, w nodes) of one texel of a polar table: sum_l weight |sum_n series[l, w, n] F_n(f)|^2.

    built, coefficients: a Chebyshev stack and its `complex_coefficients`. rule: wavelengths and weights of the ring.
    uv: of the texel (2,). series: factors of the expansion (wavelengths, w nodes, terms).
    """
    out = np.zeros((3, series.shape[1]))
    # P(-f) of real heights takes the conjugates of F_n
    turned = uv[0] < 0.0
    for i, nm in enumerate(rule.lambda_nm):
        f_n = _transforms(built, coefficients, (-uv if turned else uv) / (1e-3 * nm))
        if f_n is None:
            continue
        amplitude = series[i] @ (np.conj(f_n) if turned else f_n)
        out += np.outer(rule.weights[i], np.abs(amplitude) ** 2)
    return out
