"""How much the stages need: operations that the algorithm asks for, and bytes that must move at least once.

Padding to whole vectors is no work, and a fused multiply-add is two operations. Bytes are those of inputs and
outputs, each once, as if caches held all that is read again.
"""

from math import log2

import numpy as np

from kernels.spectral_operator import ORDER
from pipeline.bench.machine import Precision, Work
from pipeline.bench.setting import Setting
from pipeline.spectrum import PolarSpectrum
from pipeline.stack import Stack
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import PolarTable

_SPLINE_TAPS = 12


def taps(built: Stack) -> int:
    """Coefficients under the window."""
    return (2 * built.reach[0] + 1) * (2 * built.reach[1] + 1)


def stack(field: HeightField, built: Stack, terms: int) -> Work:
    """Transforms of `terms` real fields, along x for every row, along y for the columns kept: 2.5 n log2 n real."""
    ny, nx = field.shape
    columns = built.coefficients.shape[1] - built.column_zero
    flops = terms * (2.5 * ny * nx * log2(nx) + 5.0 * columns * ny * log2(ny))
    precision: Precision = "single" if built.coefficients.itemsize == 4 else "double"
    kept = built.coefficients.nbytes * terms / built.terms
    return Work("stack", precision, flops, field.heights_um.nbytes + kept)


def spectrum(setting: Setting, built: Stack, made: PolarSpectrum) -> Work:
    """polar_spectrum: the window over every term, then the series at every node in s, for half of the azimuths."""
    terms = setting.needed_terms
    pairs = _pairs_in_band(made)
    flops = 2.0 * pairs * (taps(built) * 2 * terms + terms * 2 * setting.plan.s_nodes)
    read = built.coefficients.nbytes * terms / built.terms
    return Work("spectrum", "single", flops, read + made.values.nbytes)


def _pairs_in_band(made: PolarSpectrum) -> int:
    """Radii and azimuths of half a turn within the scan's band."""
    phi = made.azimuths.angles()[: made.azimuths.count // 2]
    fx, fy = (np.abs(np.outer(made.radius_per_um, along)) for along in (np.cos(phi), np.sin(phi)))
    return int(np.count_nonzero((fx <= made.band_per_um[0]) & (fy <= made.band_per_um[1])))


def build_operator(setting: Setting) -> Work:
    """At every point: cardinal functions at the nodes of w, the radii about it; wavelengths over the points."""
    s, w = setting.plan.s_nodes, setting.plan.w_terms
    points, between = _points(setting)
    wavelengths = float(np.sum(setting.rules.count))
    flops = 2.0 * (points * s * s * w + between * ORDER + wavelengths * ORDER * 3 * w)
    return Work("build_operator", "single", flops, 4.0 * points * w * (s + 3))


def apply_operator(setting: Setting, made: PolarSpectrum, table: PolarTable) -> Work:
    """At every point: E over r where it lies between radii, then over s, into X, Y, Z; w's series at last."""
    s, w = setting.plan.s_nodes, setting.plan.w_terms
    points, between = _points(setting)
    each = between * ORDER * s + points * (s * w + 3 * w) + setting.plan.rings.count * 3 * w * w
    moved = made.values.nbytes + 4.0 * points * w * (s + 3) + table.values.nbytes
    return Work("apply_operator", "single", 2.0 * each * setting.plan.azimuths.count, moved)


def _points(setting: Setting) -> tuple[float, float]:
    """Points of all rings, and those of them that lie between radii."""
    count = setting.points.count
    return float(count.sum()), float(count[~setting.points.on_radii].sum())


def splines(table: PolarTable) -> Work:
    """A symmetric filter of 12 taps on either side around the turn, then one across the rings."""
    flops = 2.0 * table.values.size * (3 * _SPLINE_TAPS + 1)
    return Work("splines", "single", flops, 4.0 * table.values.nbytes)


def paper_table(pairs: float, built: Stack) -> Work:
    """taylor_table: multiplications and additions of eq. 8, 11 and 12 of [D14], for half of (node, wavelength) pairs.

    Its bytes are the stack's; beside its arithmetic nothing of them counts.
    """
    terms = built.terms
    per_pair = taps(built) * 2 * terms + 2 * terms * terms + 3 * (2 * terms - 1)
    return Work("paper table", "double", 2.0 * 0.5 * pairs * per_pair, built.coefficients.nbytes)
