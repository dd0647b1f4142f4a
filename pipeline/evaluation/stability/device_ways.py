"""What the stages run: the reference, the polar power spectrum and the paper's tables."""

from math import pi

import numpy as np

from kernels.polar_spectrum import LANES
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion, power_spectrum
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.stability.cell import LAMBDA_MIN_NM, SEED, Cell
from pipeline.evaluation.stability.reading import MOST_WORK, Reading, readings
from pipeline.evaluation.stability.series_way import CUT
from pipeline.optics.light import Quadrature
from pipeline.surface.heightfield import HeightField
from pipeline.tables.taylor import table as taylor

TAYLOR_TOLERANCE = 1e-4
_S_NODES = 16


def reference(cell: Cell, field: HeightField) -> list[Reading]:
    """`Reference`: the Chebyshev stack in float64 on the device."""
    exact = Reference(field, cell.sigma_um, LAMBDA_MIN_NM)
    return readings(cell, field, lambda uvw, nm: exact.power(uvw, np.array([nm]))[:, 0])


def plan_taylor(field: HeightField) -> expansion.TaylorPlan:
    """The paper's table for this surface at the shortest wavelength. Raises AccuracyError where it must refuse."""
    return expansion.plan_taylor(field, one_wavelength(LAMBDA_MIN_NM), TAYLOR_TOLERANCE)


def one_wavelength(lambda_nm: float) -> Quadrature:
    """One wavelength, so that every channel is |P|^2."""
    return Quadrature(np.array([lambda_nm]), np.ones((1, 3)))


def taylor_tables(cell: Cell, field: HeightField) -> list[Reading]:
    """I_p at the directions' own (u, v), kept in float32 as tables keep them, and eq. 10's sum."""
    order, reachable = plan_taylor(field).order, expansion.W_MAX / (1e-3 * LAMBDA_MIN_NM)
    cut = dft_stack.window_tolerance(TAYLOR_TOLERANCE)
    built = dft_stack.build(field, "taylor", order + 1, cell.sigma_um, reachable, cut)

    def power(uvw: Array, nm: float) -> Array:
        # I_p(-u, -v) = (-1)^p I_p(u, v): the half plane u < 0 is the other one at -w
        turn = np.where(uvw[:, 0] < 0.0, -1.0, 1.0)
        i_p = taylor.node_values(built, one_wavelength(nm), turn[:, None] * uvw[:, :2])
        i_p = i_p.astype(np.float32).astype(np.float64)
        return taylor.sum_powers(i_p, turn * uvw[:, 2])[:, 0]

    return readings(cell, field, power)


def polar_power(cell: Cell, field: HeightField) -> list[Reading]:
    """E of the float32 Chebyshev stack at some of its own nodes, where nothing is interpolated."""
    terms = expansion.chebyshev_order(expansion.largest_phase(field.half_range_um, LAMBDA_MIN_NM), CUT) + 1
    # few sizes, so that few kernels are compiled; what is too many adds terms that are nothing
    terms = LANES * 2 ** int(np.ceil(np.log2(terms / LANES).clip(0.0)))
    radius = power_spectrum.radii(cell.sigma_um, expansion.W_MAX / (1e-3 * LAMBDA_MIN_NM))
    built = power_spectrum.chebyshev_stack(field, cell.sigma_um, float(radius[-1]), terms, CUT)
    half = pi * np.arange(LANES) / LANES
    values = power_spectrum.gather(built, half, radius, LAMBDA_MIN_NM, _S_NODES)
    s = power_spectrum.s_nodes(_S_NODES, power_spectrum.s_max(LAMBDA_MIN_NM))
    turn, i, j, lane = _nodes(cell, len(radius))
    phi, lambda_um = half[lane] + pi * turn, 1e-3 * LAMBDA_MIN_NM
    f = radius[i, None] * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    uvw = np.concatenate([lambda_um * f, -lambda_um * s[j, None] / (2.0 * pi)], axis=1)
    return [Reading(values[turn, i, j, lane], power_direct(field, cell.sigma_um, uvw, LAMBDA_MIN_NM))]


def _nodes(cell: Cell, radii: int) -> tuple[np.ndarray, ...]:
    """Which of E's nodes are held against the truth: (half turn, radius, s node, azimuth), each (nodes,)."""
    rng = np.random.default_rng(SEED)
    count = int(np.clip(2.0 * MOST_WORK / (cell.shape[0] * cell.shape[1]), 12, 60))
    chosen = [rng.integers(n, size=count) for n in (2, radii, _S_NODES, LANES)]
    # both ends of r under the largest and the smallest s
    chosen[1][:4], chosen[2][:4] = (0, 0, radii - 1, radii - 1), (0, _S_NODES - 1, 0, _S_NODES - 1)
    return tuple(chosen)
