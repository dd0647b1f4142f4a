"""A stack summed in memory: what a series keeps of its digits, in any precision."""

from math import pi

import numpy as np
from scipy.special import jv

from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.evaluation.stability.cell import LAMBDA_MIN_NM, Cell
from pipeline.evaluation.stability.reading import Reading, readings
from pipeline.optics.coherence import sigma_f
from pipeline.surface.heightfield import HeightField

# terms left out and the window's cut, in amplitude: nothing beside float32's rounding
CUT = 1e-10
_MOST_TAYLOR_TERMS = 400


def in_memory(cell: Cell, field: HeightField) -> list[Reading]:
    """A stack summed in memory, with as many terms as the series can use."""
    z = expansion.largest_phase(field.half_range_um, LAMBDA_MIN_NM)
    # z^(N+1) / (N+1)! is nothing from N = e z on; the series dies of its rounding long before the cap
    taylor_terms = min(_MOST_TAYLOR_TERMS, int(3.6 * z) + 30)
    terms = taylor_terms if cell.basis == "taylor" else expansion.chebyshev_order(z, CUT) + 1
    reachable = expansion.W_MAX / (1e-3 * LAMBDA_MIN_NM)
    built = dft_stack.build(field, cell.basis, terms, cell.sigma_um, reachable, CUT, dtype=np.dtype(cell.precision))
    return readings(cell, field, lambda uvw, nm: series_power(built, uvw, nm))


def series_power(built: dft_stack.Stack, uvw: Array, lambda_nm: float) -> Array:
    """|P|^2 (directions,) = |sum_n c_n F_n(f)|^2 of a stack, sums and factors in its own precision.

    NaN beyond the scan's band. The window's taps are those of the kernels: nearest coefficient +- reach.
    """
    real, lambda_um = built.coefficients.dtype, 1e-3 * lambda_nm
    (dx, dy), (reach_x, reach_y) = built.spacing_per_um, built.reach
    # a dead series overflows float32: that is what is to be seen
    with np.errstate(over="ignore"):
        factors = _factors(built, 2.0 * pi / lambda_um * uvw[:, 2]).astype(np.result_type(real, np.complex64))
    power = np.full(len(uvw), np.nan)
    for i, (u, v, _) in enumerate(uvw):
        # the stack holds the half plane fx >= 0; the other is its conjugate
        turn = -1.0 if u < 0.0 else 1.0
        fx, fy = turn * u / lambda_um, turn * v / lambda_um
        if fx > built.band_per_um[0] or abs(fy) > built.band_per_um[1]:
            continue
        x, y = round(fx / dx), round(fy / dy)
        along_x = np.exp(-0.5 * ((fx - np.arange(x - reach_x, x + reach_x + 1) * dx) / sigma_f(built.sigma_um)) ** 2)
        along_y = np.exp(-0.5 * ((fy - np.arange(y - reach_y, y + reach_y + 1) * dy) / sigma_f(built.sigma_um)) ** 2)
        row, column = y + built.row_zero - reach_y, x + built.column_zero - reach_x
        taps = built.coefficients[row : row + len(along_y), column : column + len(along_x)]
        parts = np.tensordot(np.outer(along_y, along_x).astype(real), taps, 2)
        terms = parts[0] + parts.dtype.type(turn) * 1j * parts[1]
        with np.errstate(over="ignore", invalid="ignore"):
            power[i] = np.abs(np.sum(factors[i] * terms)) ** 2
    return power


def _factors(built: dft_stack.Stack, s_per_um: Array) -> Array:
    """c_n(s) (directions, terms), s = k w: (i s H)^n / n!, or (2 - [n = 0]) i^n J_n(s H)."""
    n, phase = np.arange(built.terms), s_per_um[:, None] * built.half_range_um
    if built.basis == "chebyshev":
        return np.asarray(np.where(n == 0, 1.0, 2.0) * 1j**n * jv(n, phase))
    return np.cumprod(np.concatenate([np.ones((len(phase), 1)), 1j * phase / n[1:]], axis=1), axis=1)
