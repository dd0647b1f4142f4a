"""The algorithms under test, measured against the plain sum over samples at random and adversarial directions.

They are a series summed in memory, what the stages run, and a table that they bake.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt
from pathlib import Path

import numpy as np
from scipy.special import jv

from kernels.polar_power_spectrum import LANES
from pipeline import layouts
from pipeline.accuracy.exact import reference_evaluator
from pipeline.arrays import Array
from pipeline.config.models import Accuracy, Config
from pipeline.diffraction import dft_stack, expansion, power_spectrum
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.plain_numpy import coefficients_about
from pipeline.evaluation.stability.sweep import LAMBDA_MAX_NM, LAMBDA_MIN_NM, SEED, StressCase
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.colour import delta_e
from pipeline.optics.light import Quadrature
from pipeline.optics.material import Material
from pipeline.scene.pairs import random_pairs
from pipeline.stages import run, surface
from pipeline.store import scratch
from pipeline.store.store import Store
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Mirror
from pipeline.surface.source import SurfaceSource
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.taylor import table as taylor

# error reported for NaN, infinity and anything larger: no digit is correct
NO_DIGITS = 1e6
# samples times directions that the plain sum may take for one case
MOST_WORK = 3e7


@dataclass(frozen=True)
class Measurement:
    """|P|^2 found and true (directions,); NaN where the truth lies beyond the scan's Nyquist limits."""

    found: Array
    truth: Array

    def worst(self, floor: float) -> float:
        """Return the largest |found - truth| / max(truth, floor); a value beyond the Nyquist limits is NO_DIGITS."""
        known = np.isfinite(self.truth)
        error = np.abs(self.found - self.truth)[known] / np.maximum(self.truth[known], floor)
        claimed = np.nan_to_num(self.found[~known]) != 0.0
        if np.any(claimed) or not np.all(np.isfinite(error)):
            return NO_DIGITS
        return float(np.clip(error.max(initial=0.0), 0.0, NO_DIGITS))


def directions(case: StressCase, lambda_nm: float) -> Array:
    """Return (u, v, w) (directions, 3): random ones, then those where something vanishes or reaches its limit."""
    wi, wr = random_pairs(None, int(np.clip(MOST_WORK / case.samples, 4, 24)), SEED)
    # on coefficients of the patch's DFT and midway between two of them
    du, dv = (1e-3 * lambda_nm / (n * pitch) for n, pitch in zip(case.shape[::-1], case.pitch_um, strict=True))
    adversarial = [
        [0.0, 0.0, -2.0],
        [0.0, 0.0, -1e-9],
        [1e-12, -1e-12, -2.0],
        [-1e-300, 0.0, -1.0],
        [-2.0 * du, dv, -1.9],
        [0.5 * du, -1.5 * dv, -1.9],
        [-1.2, 0.4, -1e-12],
        [sqrt(2.0), -sqrt(2.0), -1e-9],
        [-2.0 + 1e-12, 0.0, -1e-6],
        [0.0, 2.0 - 1e-12, -1e-6],
    ]
    return np.concatenate([geometry.uvw(wi, wr), [d for d in adversarial if np.hypot(d[0], d[1]) <= 2.0]])


def measure(case: StressCase, field: HeightField, power: Callable[[Array, float], Array]) -> list[Measurement]:
    """Return `power(uvw, lambda_nm)` and the plain sum at both ends of the visible range.

    Where the plain sum is slow, only at the shortest wavelength, where phases are largest.
    """
    found = []
    for nm in (LAMBDA_MIN_NM,) if case.samples > MOST_WORK / 24 else (LAMBDA_MIN_NM, LAMBDA_MAX_NM):
        uvw = directions(case, nm)
        found.append(Measurement(power(uvw, nm), power_direct(field, case.sigma_um, uvw, nm)))
    return found


# budget of the tables that are baked, mean CIELAB error
TABLE_DELTA_E = 0.5
TAYLOR_TOLERANCE = 1e-4
# truncation and window cut in amplitude: far below float32's rounding
_CUT = 1e-10
_MOST_TAYLOR_TERMS = 400
_S_NODES = 16
# largest |f| of any view at the shortest wavelength, 1/um
_REACHABLE = expansion.W_MAX / (1e-3 * LAMBDA_MIN_NM)


def in_memory(case: StressCase, field: HeightField) -> list[Measurement]:
    """Measure a stack summed in memory, with as many terms as the series can use."""
    z = expansion.largest_phase(field.half_range_um, LAMBDA_MIN_NM)
    # z^(N+1) / (N+1)! is nothing from N = e z on; the series dies of its rounding long before the cap
    taylor_terms = min(_MOST_TAYLOR_TERMS, int(3.6 * z) + 30)
    terms = taylor_terms if case.basis == "taylor" else expansion.chebyshev_order(z, _CUT) + 1
    built = dft_stack.build(field, case.basis, terms, case.sigma_um, _REACHABLE, _CUT, dtype=np.dtype(case.precision))
    return measure(case, field, lambda uvw, nm: _series_power(built, uvw, nm))


def _series_power(built: Stack, uvw: Array, lambda_nm: float) -> Array:
    """|P|^2 (directions,) = |sum_n c_n F_n(f)|^2 of a stack, sums and factors in its own precision; else NaN."""
    real, lambda_um = built.coefficients.dtype, 1e-3 * lambda_nm
    # a dead series overflows float32, which is to be seen
    with np.errstate(over="ignore"):
        factors = _factors(built, 2.0 * pi / lambda_um * uvw[:, 2]).astype(np.result_type(real, np.complex64))
    power = np.full(len(uvw), np.nan)
    for i, (u, v, _) in enumerate(uvw):
        # the stack holds the half plane fx >= 0; the other is its conjugate
        turn = -1.0 if u < 0.0 else 1.0
        near = coefficients_about(built, turn * np.array([u, v]) / lambda_um)
        if near is None:
            continue
        place, along_y, along_x = near
        parts = np.tensordot(np.outer(along_y, along_x).astype(real), built.coefficients[place], 2)
        terms = parts[0] + parts.dtype.type(turn) * 1j * parts[1]
        with np.errstate(over="ignore", invalid="ignore"):
            power[i] = np.abs(np.sum(factors[i] * terms)) ** 2
    return power


def _factors(built: Stack, s_per_um: Array) -> Array:
    """c_n(s) (directions, terms), s = k w: (i s H)^n / n!, or (2 - [n = 0]) i^n J_n(s H)."""
    n, phase = np.arange(built.terms), s_per_um[:, None] * built.half_range_um
    if built.basis == "chebyshev":
        return np.asarray(np.where(n == 0, 1.0, 2.0) * 1j**n * jv(n, phase))
    return np.cumprod(np.concatenate([np.ones((len(phase), 1)), 1j * phase / n[1:]], axis=1), axis=1)


def reference(case: StressCase, field: HeightField) -> list[Measurement]:
    """Measure `Reference`: the Chebyshev stack in float64 on the device."""
    exact = Reference(field, case.sigma_um, LAMBDA_MIN_NM)
    return measure(case, field, lambda uvw, nm: exact.power(uvw, np.array([nm]))[:, 0])


def plan_taylor(field: HeightField) -> expansion.TaylorPlan:
    """Plan the paper's table at the shortest wavelength. Raises AccuracyError where float32 loses the tolerance."""
    return expansion.plan_taylor(field, one_wavelength(LAMBDA_MIN_NM), TAYLOR_TOLERANCE)


def one_wavelength(lambda_nm: float) -> Quadrature:
    """Return a quadrature of one wavelength, so that every channel is |P|^2."""
    return Quadrature(np.array([lambda_nm]), np.ones((1, 3)))


def taylor_tables(case: StressCase, field: HeightField) -> list[Measurement]:
    """Measure [D14] eq. 10 over I_p at the directions' own (u, v), kept in float32 as tables keep them."""
    terms, cut = plan_taylor(field).order + 1, dft_stack.window_tolerance(TAYLOR_TOLERANCE)
    built = dft_stack.build(field, "taylor", terms, case.sigma_um, _REACHABLE, cut)

    def power(uvw: Array, nm: float) -> Array:
        # I_p(-u, -v) = (-1)^p I_p(u, v): the half plane u < 0 is the other one at -w
        turn = np.where(uvw[:, 0] < 0.0, -1.0, 1.0)
        i_p = taylor.node_values(built, one_wavelength(nm), turn[:, None] * uvw[:, :2])
        i_p = i_p.astype(np.float32).astype(np.float64)
        return taylor.sum_powers(i_p, turn * uvw[:, 2])[:, 0]

    return measure(case, field, power)


def polar_power(case: StressCase, field: HeightField) -> list[Measurement]:
    """Measure E of the float32 Chebyshev stack at some of its own nodes, where nothing is interpolated."""
    terms = expansion.chebyshev_order(expansion.largest_phase(field.half_range_um, LAMBDA_MIN_NM), _CUT) + 1
    # few sizes, so that few kernels are compiled; superfluous terms are zero
    terms = LANES * 2 ** int(np.ceil(np.log2(terms / LANES).clip(0.0)))
    radius = power_spectrum.radii(case.sigma_um, _REACHABLE)
    built = power_spectrum.chebyshev_stack(field, case.sigma_um, float(radius[-1]), terms, _CUT)
    half = pi * np.arange(LANES) / LANES
    values = power_spectrum.gather(built, half, radius, LAMBDA_MIN_NM, _S_NODES)
    s = power_spectrum.s_nodes(_S_NODES, power_spectrum.s_max(LAMBDA_MIN_NM))
    turn, i, j, lane = _nodes(case, len(radius))
    phi, lambda_um = half[lane] + pi * turn, 1e-3 * LAMBDA_MIN_NM
    f = radius[i, None] * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    uvw = np.concatenate([lambda_um * f, -lambda_um * s[j, None] / (2.0 * pi)], axis=1)
    return [Measurement(values[turn, i, j, lane], power_direct(field, case.sigma_um, uvw, LAMBDA_MIN_NM))]


def _nodes(case: StressCase, radii: int) -> tuple[np.ndarray, ...]:
    """Nodes of E to compare: (half turn, radius, s node, azimuth), each (nodes,)."""
    rng = np.random.default_rng(SEED)
    count = int(np.clip(2.0 * MOST_WORK / case.samples, 12, 60))
    chosen = [rng.integers(n, size=count) for n in (2, radii, _S_NODES, LANES)]
    # both ends of r under the largest and the smallest s
    chosen[1][:4], chosen[2][:4] = (0, 0, radii - 1, radii - 1), (0, _S_NODES - 1, 0, _S_NODES - 1)
    return tuple(chosen)


def table_error(case: StressCase, field: HeightField) -> float:
    """Return the mean CIELAB error of a baked polar table on fresh directions; NO_DIGITS for a non-finite look-up.

    Raises AccuracyError where the plan or the certificate refuses.
    """
    with scratch.temporary() as folder:
        heights = folder / "heights.npy"
        np.save(heights, field.heights_um)
        config, store = _config(case, heights), Store(folder / "store")
        made = run.execute(config, run.plan(config, store, "table"), store)
        baked = layouts.of(config.table).load(store.open("table", made["table"].key))
        field = surface.load(store.open("surface", made["surface"].key))
    evaluate = table_evaluator(baked, config.radiometry)
    wi, wr = random_pairs(None, 1000, SEED)
    found = evaluate(wi, wr)
    if not (np.all(np.isfinite(found)) and np.all(np.isfinite(evaluate(*_extreme_pairs())))):
        return NO_DIGITS
    return float(np.mean(delta_e(found, reference_evaluator(field, config)(wi, wr), config.accuracy.exposure_ru)))


def _config(case: StressCase, heights: Path) -> Config:
    """The config of a table, its surface in a file; a recipe for a flat one, which no file may hold."""
    if case.kind == "flat":
        (ny, nx), (px, py) = case.shape, case.pitch_um
        source = SurfaceSource(recipe=Mirror(kind="mirror", size_um=(nx * px, ny * py), pitch_um=case.pitch_um))
    else:
        source = SurfaceSource(path=str(heights), height_unit="um", pitch_um=case.pitch_um, level="none")
    coherence, accuracy = Coherence(sigma_um=case.sigma_um), Accuracy(delta_e=TABLE_DELTA_E)
    material = Material(normalisation="relative")
    return Config(name="stress", surface=source, coherence=coherence, material=material, accuracy=accuracy)


def _extreme_pairs() -> tuple[Array, Array]:
    """Normal, mirror and retro-reflecting pairs up to a millionth of a radian above the surface."""
    theta = np.array([0.0, 0.5, 1.5, pi / 2 - 1e-6])
    phi = np.array([0.0, pi / 2, 3.0, -2.0])
    wi = geometry.direction(np.repeat(theta, 2), np.repeat(phi, 2))
    there_and_back = np.tile([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]], (len(theta), 1))
    return wi, wi * there_and_back
