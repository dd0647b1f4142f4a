"""How fast the paper-sized bake is: beside plain numpy, and beside the device's own peak."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from kernels import device
from pipeline import series, stack
from pipeline.config import Config
from pipeline.optics import brdf
from pipeline.optics.coherence import sigma_f
from pipeline.optics.geometry import Array
from pipeline.optics.spectra import Quadrature
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables import grid, taylor

T = TypeVar("T")

_SAMPLE_NODES = 12
_SEED = 7


@dataclass(frozen=True)
class PaperBench:
    """One run of the paper's bake, all timed in this process on this machine.

    nodes, wavelengths, order, taps: the size of the work; floating_point_operations of the table kernel.
    stack_s, table_s: warm times. numpy_s: plain numpy on `sample_nodes` nodes, scaled by their number.
    peak_flops: the device's measured double-precision peak; table_share: the kernel's part of it.
    agreement: largest difference between kernel and numpy on the sample, over the largest I_p.
    """

    device: str
    nodes: int
    wavelengths: int
    order: int
    taps: int
    floating_point_operations: float
    stack_s: float
    table_s: float
    sample_nodes: int
    numpy_s: float
    speedup: float
    peak_flops: float
    table_share: float
    agreement: float


def paper_bake(config: Config, field: HeightField, progress: Progress = silent) -> PaperBench:
    """Times the stack and the table of a config on a height field, and plain numpy on a few nodes of it."""
    sigma, tolerance = config.coherence.sigma_um, config.table.tolerance
    quadrature = brdf.integrand(config.material, config.spectrum, config.table.step_nm, sigma)
    order = None if config.table.terms == "auto" else config.table.terms
    plan = series.plan_taylor(field, quadrature, tolerance, order)
    reachable = series.W_MAX / (1e-3 * quadrature.lambda_min_nm)

    def build_stack() -> stack.Stack:
        return stack.build(
            field, "taylor", plan.order + 1, sigma, reachable, stack.window_tolerance(tolerance), progress
        )

    built, stack_s = _timed(build_stack)

    def build_table() -> taylor.TaylorTable:
        return taylor.build(built, quadrature, config.table.resolution, config.table.power, config.scene, progress)

    # the first table compiles the kernel
    build_table()
    table, table_s = _timed(build_table)

    sample = _sample_nodes(table)
    found, numpy_sample_s = _timed(lambda: plain_numpy(built, quadrature, sample))
    kernel = taylor.node_values(built, quadrature, sample)
    agreement = np.max(np.abs(found - kernel)) / np.max(np.abs(kernel))
    nodes = int(np.count_nonzero(table.computed))
    numpy_s = numpy_sample_s * nodes / len(sample)
    # by (u, v) -> (-u, -v) half of the nodes are computed
    taps = (2 * built.reach[0] + 1) * (2 * built.reach[1] + 1)
    work = table_operations(nodes / 2, len(quadrature.lambda_nm), plan.order + 1, taps)
    peak = device.measure_peak()
    return PaperBench(
        device=device.default_device().name,
        nodes=nodes,
        wavelengths=len(quadrature.lambda_nm),
        order=plan.order,
        taps=taps,
        floating_point_operations=work,
        stack_s=stack_s,
        table_s=table_s,
        sample_nodes=len(sample),
        numpy_s=numpy_s,
        speedup=numpy_s / (stack_s + table_s),
        peak_flops=peak,
        table_share=work / table_s / peak,
        agreement=float(agreement),
    )


def table_operations(nodes: float, wavelengths: int, terms: int, taps: int) -> float:
    """Multiplications and additions that eq. 8, 11 and 12 need, without padding to whole vectors."""
    gather = taps * 2 * terms
    products = 2 * terms * terms
    integral = 3 * (2 * terms - 1)
    return 2.0 * nodes * wavelengths * (gather + products + integral)


def plain_numpy(built: stack.Stack, quadrature: Quadrature, uv: Array) -> Array:
    """I_p (nodes, 3, 2N + 1) as [D14] eq. 8, 11 and 12 are printed, one node and wavelength after the other.

    Numpy does the sums over coefficients and terms; the loops are the paper's. Also the second way to the
    kernel's numbers.
    """
    terms = built.terms
    out = np.zeros((len(uv), 3, 2 * terms - 1))
    spread = 2.0 * sigma_f(built.sigma_um) ** 2
    n = np.arange(terms)
    factorial = np.cumprod(np.maximum(n, 1).astype(float))
    complex_stack = built.coefficients[:, :, 0] + 1j * built.coefficients[:, :, 1]
    for node, (u, v) in enumerate(uv):
        for nm, weight in zip(quadrature.lambda_nm, quadrature.weights, strict=True):
            f = np.array([u, v]) / (1e-3 * nm)
            if np.any(np.abs(f) > built.band_per_um):
                continue
            columns, rows = (
                np.arange(-reach, reach + 1) + int(np.rint(x / d))
                for x, d, reach in zip(f, built.spacing_per_um, built.reach, strict=True)
            )
            g_x = np.exp(-((f[0] - columns * built.spacing_per_um[0]) ** 2) / spread)
            g_y = np.exp(-((f[1] - rows * built.spacing_per_um[1]) ** 2) / spread)
            near = complex_stack[np.ix_(rows + built.row_zero, columns + built.column_zero)]
            f_n = 1j**n * np.einsum("y,x,yxn->n", g_y, g_x, near)
            kh = 2.0 * np.pi / (1e-3 * nm) * built.half_range_um
            for p in range(2 * terms - 1):
                low, high = max(0, p - terms + 1), min(p, terms - 1)
                i, j = n[low : high + 1], p - n[low : high + 1]
                dots = np.real(f_n[i] * np.conj(f_n[j])) / (factorial[i] * factorial[j])
                out[node, :, p] += kh**p * np.sum(dots) * weight
    return out


def _sample_nodes(table: taylor.TaylorTable) -> Array:
    """A few of the computed nodes with u >= 0 and |(u, v)| <= 2, (nodes, 2)."""
    u = grid.nodes(table.resolution, table.power)
    v_index, u_index = np.nonzero(table.computed & (u >= 0.0) & (np.hypot(u[:, None], u) <= grid.U_MAX))
    chosen = np.random.default_rng(_SEED).choice(len(u_index), size=min(_SAMPLE_NODES, len(u_index)), replace=False)
    return np.stack([u[u_index[chosen]], u[v_index[chosen]]], axis=-1)


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    """What `work` gives, and the seconds it took."""
    started = time.perf_counter()
    result = work()
    return result, time.perf_counter() - started
