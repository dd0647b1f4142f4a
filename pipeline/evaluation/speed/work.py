"""Work of the stages: operations of the algorithm, and bytes that must move at least once.

Padding to whole vectors does not count, and a fused multiply-add is two operations. Bytes are those of inputs and
outputs, each once, as if caches held all that is read again.
"""

from math import log2

import numpy as np

from kernels.programs import ORDER
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum, s_max
from pipeline.evaluation.speed.machine import Precision, Work
from pipeline.evaluation.speed.setting import Setting
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import line_points
from pipeline.tables.polar.table import PolarTable

_SPLINE_TAPS = 12


def taps(built: Stack) -> int:
    """Return the number of coefficients under the window."""
    return (2 * built.reach[0] + 1) * (2 * built.reach[1] + 1)


def stack(field: HeightField, built: Stack) -> Work:
    """Count terms, and transforms pruned to the frequencies kept: along x of every row, along y of the columns kept.

    An FFT of n samples of which k frequencies are wanted takes 5 n log2 k operations, half of them for real samples.
    The rows' transforms are written and read once more: they are larger than caches.
    """
    ny, nx = field.shape
    rows, columns = built.coefficients.shape[0], built.coefficients.shape[1] - built.column_zero
    flops = built.terms * (2.0 * ny * nx + 2.5 * ny * nx * log2(2 * columns) + 5.0 * columns * ny * log2(rows))
    precision: Precision = "single" if built.coefficients.itemsize == 4 else "double"
    between = 2.0 * 2 * built.coefficients.itemsize * built.terms * columns * ny
    return Work("stack", precision, flops, field.heights_um.nbytes + between + _nbytes(built))


def _nbytes(built: Stack) -> float:
    """Bytes of the coefficients that are terms of the series."""
    return float(built.coefficients.nbytes * built.terms / built.coefficients.shape[3])


def power_spectrum(setting: Setting, built: Stack, made: PolarPowerSpectrum) -> Work:
    """Count the window over every term, then the series at every node in s, for half of the azimuths."""
    pairs = _pairs_in_band(made)
    flops = 2.0 * pairs * built.terms * 2 * (taps(built) + setting.plan.s_nodes)
    return Work("power spectrum", "single", flops, _nbytes(built) + made.values.nbytes)


def _pairs_in_band(made: PolarPowerSpectrum) -> int:
    """Radii and azimuths of half a turn within the scan's band."""
    phi = made.azimuths.phi()[: made.azimuths.count // 2]
    fx, fy = (np.abs(np.outer(made.radius_per_um, along)) for along in (np.cos(phi), np.sin(phi)))
    return int(np.count_nonzero((fx <= made.band_per_um[0]) & (fy <= made.band_per_um[1])))


def build_operator(setting: Setting) -> Work:
    """Count, at every point, cardinal functions at nodes of w and at radii; then wavelengths over the points."""
    s, w = setting.plan.s_nodes, setting.plan.w_terms
    points, between, taken = _points(setting)
    wavelengths = float(np.sum(setting.rules.count))
    flops = 2.0 * (points * s * s * w + between * ORDER + wavelengths * ORDER * 3 * w)
    return Work("build_operator", "single", flops, 4.0 * w * (points * s + 3 * taken))


def apply_operator(setting: Setting, made: PolarPowerSpectrum, table: PolarTable) -> Work:
    """Count, at every point, E over r where it lies between radii, then over s; X, Y, Z of every ring; w's series."""
    s, w = setting.plan.s_nodes, setting.plan.w_terms
    points, between, taken = _points(setting)
    each = between * ORDER * s + points * s * w + taken * 3 * w + setting.plan.rings.count * 3 * w * w
    moved = made.values.nbytes + 4.0 * w * (points * s + 3 * taken) + table.values.nbytes
    return Work("apply_operator", "single", 2.0 * each * setting.plan.azimuths.count, moved)


def _points(setting: Setting) -> tuple[float, float, float]:
    """Number of points of all groups of rings, of those between radii, and of those that all rings take together."""
    bake, rho, taken = setting.bake, setting.plan.rings.rho(), 0
    points = line_points.choose(bake.radius_per_um, bake.s_nodes, s_max(bake.lambda_min_nm), rho, setting.rules)
    low, high = (points.stretch * kappa for kappa in setting.rules.kappa_ends_per_um)
    lines = np.split(points.kappa_per_um, points.first[1:])
    for ring, group in enumerate(points.group):
        line = lines[group]
        within = int(np.count_nonzero((line >= low[ring]) & (line <= high[ring])))
        taken += within if points.on_nodes[group] else min(within + ORDER, len(line))
    return float(len(points.place)), float(points.count[~points.on_radii].sum()), float(taken)


def splines(table: PolarTable) -> Work:
    """Count a symmetric filter of 12 taps on either side around the turn, then one across the rings."""
    flops = 2.0 * table.values.size * (3 * _SPLINE_TAPS + 1)
    return Work("splines", "single", flops, 4.0 * table.values.nbytes)


def paper_table(pairs: float, built: Stack) -> Work:
    """Count taylor_table: eq. 8, 11 and 12 of [D14] for half of the (node, wavelength) pairs.

    Its bytes are those of the stack, which are negligible beside its arithmetic.
    """
    terms = built.terms
    per_pair = taps(built) * 2 * terms + 2 * terms * terms + 3 * (2 * terms - 1)
    return Work("paper table", "double", 2.0 * 0.5 * pairs * per_pair, built.coefficients.nbytes)
