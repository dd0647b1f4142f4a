"""The whole span of surfaces, windows and directions, cell by cell: digits, or a refusal, and never a silent error.

Every cell is one surface seen one way, held against `power_direct`, the plain sum over samples:

- series: a DFT stack summed in memory, in its own precision; Taylor or Chebyshev, float32 or float64;
- device: what the stages run: `Reference` (Chebyshev float64), E of the polar power spectrum at its own nodes
  (Chebyshev float32), the paper's I_p kept in float32 (Taylor float32);
- table: a polar table baked by the stages, certificate included, on directions that the certificate never saw.

Errors of |P|^2 are |found - truth| / max(truth, floor). In speckle every relative error diverges at the dark nodes,
so the floor is part of what each way promises (`promise`). The one that says most is a thousandth of the surface's
mean level: by Parseval the mean of |P|^2 over the scan's band is sum g^2 / (sum g)^2, whatever the heights.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import jv

from kernels import polar as device
from pipeline import run, series, spectrum, stack
from pipeline.config import Accuracy, Coherence, Config, Mirror, Surface
from pipeline.directions import random_pairs
from pipeline.errors import AccuracyError, BakeError
from pipeline.evaluate import table_evaluator
from pipeline.optics import geometry
from pipeline.optics.coherence import folded_window, sigma_f
from pipeline.optics.colour_error import delta_e
from pipeline.optics.geometry import Array
from pipeline.optics.spectra import Quadrature
from pipeline.progress import Progress, silent
from pipeline.reference import Reference, power_direct, reference_evaluator
from pipeline.stages import surface, table
from pipeline.store import Store
from pipeline.surface.heightfield import HeightField
from pipeline.tables import taylor

Way = Literal["series", "device", "table"]
Precision = Literal["float32", "float64"]
Kind = Literal["flat", "spike", "steps", "hills", "noise"]
Verdict = Literal["ok", "refused", "wrong"]

# NaN, infinity and errors beyond this are told as this: no digit is left
NO_DIGITS = 1e6
# of the mean level: nodes darker than this are held to an absolute error
_DARK_SHARE = 1e-3
_TAYLOR_TOLERANCE = 1e-4
CHEBYSHEV_TOLERANCE = 1e-4
_REFERENCE_TOLERANCE = 1e-9
_TABLE_DELTA_E = 0.5
# means over two sets of a thousand directions differ by so much
_SAMPLING = 1.25
_LAMBDA_MIN_NM, _LAMBDA_MAX_NM = 380.0, 780.0
# terms left out and the window's cut, in amplitude: nothing beside float32's rounding
_CUT = 1e-10
_MOST_TAYLOR_TERMS = 400
_S_NODES = 16
# samples times directions that the plain sum may take for one cell
_MOST_WORK = 3e7
_SEED = 1811


@dataclass(frozen=True)
class Cell:
    """One surface, window and way. `height_um` is the span of heights, 2 H; `shape` is (ny, nx)."""

    family: str
    way: Way
    basis: stack.Basis
    precision: Precision
    kind: Kind
    height_um: float
    shape: tuple[int, int]
    pitch_um: tuple[float, float]
    sigma_um: float

    def field(self) -> HeightField:
        """The surface itself, the same every time."""
        rng = np.random.default_rng(_SEED)
        if self.kind == "flat":
            return HeightField(np.full(self.shape, self.height_um), self.pitch_um)
        if self.kind == "spike":
            relief = np.zeros(self.shape)
            # under the window's peak
            relief[self.shape[0] // 2, self.shape[1] // 2] = 1.0
        elif self.kind == "steps":
            # every |t| = 1: no power of t is small, and all T_n reach their bound
            relief = rng.integers(0, 2, self.shape).astype(float)
        else:
            relief = rng.random(self.shape)
            if self.kind == "hills":
                relief = gaussian_filter(relief, 4.0, mode="wrap")
        return HeightField(self.height_um * (relief - relief.min()) / np.ptp(relief), self.pitch_um)


@dataclass(frozen=True)
class Promise:
    """A way keeps |found - truth| / max(truth, floor) <= error; for a table, the mean CIELAB error."""

    error: float
    floor: float


@dataclass(frozen=True)
class Outcome:
    """What a cell came to.

    error: the worst found, as its promise measures; None where a refusal came first. promised: the most it may be.
    speckle: the worst error over max(truth, 1e-3 of the mean level); None of tables and where nothing was measured.
    message: a refusal's, or an internal fault's.
    """

    cell: Cell
    verdict: Verdict
    error: float | None
    promised: float
    speckle: float | None
    message: str


@dataclass(frozen=True)
class Reading:
    """|P|^2 found and true (directions,); NaN where the truth lies beyond the scan's band."""

    found: Array
    truth: Array

    def worst(self, floor: float) -> float:
        """The largest |found - truth| / max(truth, floor); what is claimed beyond the band counts as no digits."""
        known = np.isfinite(self.truth)
        error = np.abs(self.found - self.truth)[known] / np.maximum(self.truth[known], floor)
        claimed = np.nan_to_num(self.found[~known]) != 0.0
        if np.any(claimed) or not np.all(np.isfinite(error)):
            return NO_DIGITS
        return float(np.clip(error.max(initial=0.0), 0.0, NO_DIGITS))


def mean_level(field: HeightField, sigma_um: float) -> float:
    """Mean of |P|^2 over the scan's band, sum g^2 / (sum g)^2 with g folded into the patch (Parseval; |p| = 1)."""
    (ny, nx), (px, py) = field.shape, field.pitch_um
    along = (np.abs(folded_window(n, pitch, sigma_um, 0.0)) for n, pitch in ((nx, px), (ny, py)))
    return float(np.prod([np.sum(g**2) / np.sum(g) ** 2 for g in along]))


def promise(cell: Cell, field: HeightField) -> Promise:
    """What a cell's way promises: the Taylor plan's, the reference's, float32 speckle's, or the table's budget."""
    if cell.way == "table":
        return Promise(_SAMPLING * _TABLE_DELTA_E, 1.0)
    if cell.basis == "taylor":
        return Promise(_TAYLOR_TOLERANCE, series.MIRROR_SHARE)
    if cell.precision == "float64":
        return Promise(_REFERENCE_TOLERANCE, 1.0)
    return Promise(CHEBYSHEV_TOLERANCE, _DARK_SHARE * mean_level(field, cell.sigma_um))


def judge(cell: Cell) -> Outcome:
    """Runs one cell. Raises DeviceError where no device works; every other fault is the cell's outcome."""
    field = cell.field()
    promised = promise(cell, field)
    error = speckle = None
    try:
        if cell.way == "table":
            error = _table_error(cell, field)
        else:
            readings = _WAYS[cell.way, cell.basis, cell.precision](cell, field)
            error, speckle = (
                max(reading.worst(floor) for reading in readings)
                for floor in (promised.floor, _DARK_SHARE * mean_level(field, cell.sigma_um))
            )
            if cell.basis == "taylor":
                _plan_taylor(field)
    except AccuracyError as refusal:
        return Outcome(cell, "refused", error, promised.error, speckle, str(refusal))
    except BakeError:
        raise
    except Exception as fault:
        # a crash is no refusal: nobody is told what to do
        return Outcome(cell, "wrong", NO_DIGITS, promised.error, None, f"{type(fault).__name__}: {fault}")
    return Outcome(cell, "ok" if error <= promised.error else "wrong", error, promised.error, speckle, "")


def sweep(cells: Sequence[Cell], progress: Progress = silent) -> list[Outcome]:
    """All cells, one after the other."""
    outcomes = []
    for done, cell in enumerate(cells, 1):
        outcomes.append(judge(cell))
        progress("stress", done / len(cells))
    return outcomes


# --- directions ------------------------------------------------------------------------------------------


def directions(cell: Cell, lambda_nm: float) -> Array:
    """(u, v, w) (directions, 3): random ones, then those where something vanishes or ends."""
    samples = cell.shape[0] * cell.shape[1]
    wi, wr = random_pairs(None, int(np.clip(_MOST_WORK / samples, 4, 24)), _SEED)
    # on coefficients of the patch's DFT and midway between two of them
    du, dv = (1e-3 * lambda_nm / (n * pitch) for n, pitch in zip(cell.shape[::-1], cell.pitch_um, strict=True))
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


def _wavelengths(cell: Cell) -> tuple[float, ...]:
    """Both ends of the spectrum; where the plain sum is slow, the end where phases are largest."""
    large = cell.shape[0] * cell.shape[1] > _MOST_WORK / 24
    return (_LAMBDA_MIN_NM,) if large else (_LAMBDA_MIN_NM, _LAMBDA_MAX_NM)


def _readings(cell: Cell, field: HeightField, power: Callable[[Array, float], Array]) -> list[Reading]:
    """`power(uvw, lambda_nm)` beside the plain sum."""
    found = []
    for nm in _wavelengths(cell):
        uvw = directions(cell, nm)
        found.append(Reading(power(uvw, nm), power_direct(field, cell.sigma_um, uvw, nm)))
    return found


# --- the ways --------------------------------------------------------------------------------------------


def _phase(field: HeightField) -> float:
    return series.largest_phase(field.half_range_um, _LAMBDA_MIN_NM)


def _series(cell: Cell, field: HeightField) -> list[Reading]:
    """A stack summed in memory, with as many terms as the series can use."""
    z = _phase(field)
    # z^(N+1) / (N+1)! is nothing from N = e z on; the series dies of its rounding long before the cap
    taylor_terms = min(_MOST_TAYLOR_TERMS, int(3.6 * z) + 30)
    terms = taylor_terms if cell.basis == "taylor" else series.chebyshev_order(z, _CUT) + 1
    reachable = series.W_MAX / (1e-3 * _LAMBDA_MIN_NM)
    built = stack.build(field, cell.basis, terms, cell.sigma_um, reachable, _CUT, dtype=np.dtype(cell.precision))
    return _readings(cell, field, lambda uvw, nm: series_power(built, uvw, nm))


def series_power(built: stack.Stack, uvw: Array, lambda_nm: float) -> Array:
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


def _factors(built: stack.Stack, s_per_um: Array) -> Array:
    """c_n(s) (directions, terms), s = k w: (i s H)^n / n!, or (2 - [n = 0]) i^n J_n(s H)."""
    n, phase = np.arange(built.terms), s_per_um[:, None] * built.half_range_um
    if built.basis == "chebyshev":
        return np.asarray(np.where(n == 0, 1.0, 2.0) * 1j**n * jv(n, phase))
    return np.cumprod(np.concatenate([np.ones((len(phase), 1)), 1j * phase / n[1:]], axis=1), axis=1)


def _reference(cell: Cell, field: HeightField) -> list[Reading]:
    """`Reference`: the Chebyshev stack in float64 on the device."""
    reference = Reference(field, cell.sigma_um, _LAMBDA_MIN_NM)
    return _readings(cell, field, lambda uvw, nm: reference.power(uvw, np.array([nm]))[:, 0])


def _plan_taylor(field: HeightField) -> series.TaylorPlan:
    """The paper's table for this surface at the shortest wavelength. Raises AccuracyError where it must refuse."""
    return series.plan_taylor(field, _line(_LAMBDA_MIN_NM), _TAYLOR_TOLERANCE)


def _line(lambda_nm: float) -> Quadrature:
    """One wavelength, so that every channel is |P|^2."""
    return Quadrature(np.array([lambda_nm]), np.ones((1, 3)))


def _taylor_tables(cell: Cell, field: HeightField) -> list[Reading]:
    """I_p at the directions' own (u, v), kept in float32 as tables keep them, and eq. 10's sum."""
    order, reachable = _plan_taylor(field).order, series.W_MAX / (1e-3 * _LAMBDA_MIN_NM)
    cut = stack.window_tolerance(_TAYLOR_TOLERANCE)
    built = stack.build(field, "taylor", order + 1, cell.sigma_um, reachable, cut)

    def power(uvw: Array, nm: float) -> Array:
        # I_p(-u, -v) = (-1)^p I_p(u, v): the half plane u < 0 is the other one at -w
        turn = np.where(uvw[:, 0] < 0.0, -1.0, 1.0)
        i_p = taylor.node_values(built, _line(nm), turn[:, None] * uvw[:, :2])
        i_p = i_p.astype(np.float32).astype(np.float64)
        return taylor.sum_powers(i_p, turn * uvw[:, 2])[:, 0]

    return _readings(cell, field, power)


def _power_spectrum(cell: Cell, field: HeightField) -> list[Reading]:
    """E of the float32 Chebyshev stack at some of its own nodes, where nothing is interpolated."""
    terms = series.chebyshev_order(_phase(field), _CUT) + 1
    # few sizes, so that few kernels are compiled; what is too many adds terms that are nothing
    terms = device.LANES * 2 ** int(np.ceil(np.log2(terms / device.LANES).clip(0.0)))
    radius = spectrum.radii(cell.sigma_um, series.W_MAX / (1e-3 * _LAMBDA_MIN_NM))
    built = spectrum.chebyshev_stack(field, cell.sigma_um, float(radius[-1]), terms, _CUT)
    half = pi * np.arange(device.LANES) / device.LANES
    values = spectrum.gather(built, half, radius, _LAMBDA_MIN_NM, _S_NODES)
    s = spectrum.s_nodes(_S_NODES, spectrum.s_max(_LAMBDA_MIN_NM))
    turn, i, j, lane = _nodes(cell, len(radius))
    phi, lambda_um = half[lane] + pi * turn, 1e-3 * _LAMBDA_MIN_NM
    f = radius[i, None] * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    uvw = np.concatenate([lambda_um * f, -lambda_um * s[j, None] / (2.0 * pi)], axis=1)
    return [Reading(values[turn, i, j, lane], power_direct(field, cell.sigma_um, uvw, _LAMBDA_MIN_NM))]


def _nodes(cell: Cell, radii: int) -> tuple[np.ndarray, ...]:
    """Which of E's nodes are held against the truth: (half turn, radius, s node, azimuth), each (nodes,)."""
    rng = np.random.default_rng(_SEED)
    count = int(np.clip(2.0 * _MOST_WORK / (cell.shape[0] * cell.shape[1]), 12, 60))
    chosen = [rng.integers(n, size=count) for n in (2, radii, _S_NODES, device.LANES)]
    # both ends of r under the largest and the smallest s
    chosen[1][:4], chosen[2][:4] = (0, 0, radii - 1, radii - 1), (0, _S_NODES - 1, 0, _S_NODES - 1)
    return tuple(chosen)


def _config(cell: Cell, heights: Path) -> Config:
    """What a table cell is baked and certified under, its surface in a file; a file of one height is refused."""
    if cell.kind == "flat":
        (ny, nx), (px, py) = cell.shape, cell.pitch_um
        section = Surface(recipe=Mirror(kind="mirror", size_um=(nx * px, ny * py), pitch_um=cell.pitch_um))
    else:
        section = Surface(path=str(heights), height_unit="um", pitch_um=cell.pitch_um, level="none")
    coherence, accuracy = Coherence(sigma_um=cell.sigma_um), Accuracy(delta_e=_TABLE_DELTA_E)
    return Config(name="stress", surface=section, coherence=coherence, accuracy=accuracy)


def _table_error(cell: Cell, field: HeightField) -> float:
    """Mean CIELAB error of a baked polar table on fresh directions; NO_DIGITS where a look-up is not finite.

    Raises AccuracyError where the plan or the certificate refuses.
    """
    with TemporaryDirectory() as folder:
        heights = Path(folder) / "heights.npy"
        np.save(heights, field.heights_um)
        config, store = _config(cell, heights), Store(Path(folder) / "store")
        made = run.execute(config, run.plan(config, store, "table"), store)
        baked = table.load(config, store.open("table", made["table"].key))
        field = surface.load(store.open("surface", made["surface"].key))
    evaluate = table_evaluator(baked, config)
    wi, wr = random_pairs(None, 1000, _SEED)
    found = evaluate(wi, wr)
    if not (np.all(np.isfinite(found)) and np.all(np.isfinite(evaluate(*_extreme_pairs())))):
        return NO_DIGITS
    return float(np.mean(delta_e(found, reference_evaluator(field, config)(wi, wr), config.accuracy.exposure_ru)))


def _extreme_pairs() -> tuple[Array, Array]:
    """Normal, mirror and retro-reflecting pairs up to a millionth of a radian above the surface."""
    theta = np.array([0.0, 0.5, 1.5, pi / 2 - 1e-6])
    phi = np.array([0.0, pi / 2, 3.0, -2.0])
    wi = geometry.direction(np.repeat(theta, 2), np.repeat(phi, 2))
    there_and_back = np.tile([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]], (len(theta), 1))
    return wi, wi * there_and_back


_WAYS: dict[tuple[Way, stack.Basis, Precision], Callable[[Cell, HeightField], list[Reading]]] = {
    ("series", "taylor", "float32"): _series,
    ("series", "taylor", "float64"): _series,
    ("series", "chebyshev", "float32"): _series,
    ("series", "chebyshev", "float64"): _series,
    ("device", "taylor", "float32"): _taylor_tables,
    ("device", "chebyshev", "float32"): _power_spectrum,
    ("device", "chebyshev", "float64"): _reference,
}


# --- the sweep -------------------------------------------------------------------------------------------

_BASE = Cell("", "device", "chebyshev", "float32", "noise", 0.5, (128, 128), (0.1, 0.1), 3.2)
_SERIES_HEIGHTS_UM = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0, 7.0, 10.0)
# heights that Taylor tables of 1e-4 take, and one that they must refuse
_TAYLOR_HEIGHTS_UM = (1e-3, 0.1, 0.3, 0.5, 2.0)


def cells(quick: bool = False) -> list[Cell]:
    """The sweep, or a part of it that takes seconds."""
    return [cell for family in _FAMILIES for cell in family(quick)]


def _by_height(quick: bool) -> Iterator[Cell]:
    heights = (1e-3, 0.1, 0.5, 2.0, 10.0) if quick else _SERIES_HEIGHTS_UM
    for height in heights:
        for way, basis, precision in _WAYS:
            if way == "series":
                yield replace(
                    _BASE, family="height, series", way=way, basis=basis, precision=precision, height_um=height
                )
    for height in (1e-3, 0.5, 10.0) if quick else (1e-3, 0.03, 0.5, 2.0, 5.0, 10.0):
        yield from _on_device(replace(_BASE, family="height", height_um=height), with_taylor=False)
    for height in _TAYLOR_HEIGHTS_UM:
        yield replace(_BASE, family="height, I_p", basis="taylor", height_um=height)


def _on_device(cell: Cell, with_taylor: bool = True) -> Iterator[Cell]:
    """A cell in every way that stages run; the paper's tables at a height that they take."""
    yield replace(cell, precision="float32")
    yield replace(cell, precision="float64")
    if with_taylor:
        yield replace(cell, basis="taylor", height_um=min(cell.height_um, 0.1))


def _by_pitch(quick: bool) -> Iterator[Cell]:
    for pitch in (0.005, 0.2) if quick else (0.005, 0.01, 0.02, 0.05, 0.2):
        sigma = 0.25 * _BASE.shape[1] * pitch
        yield from _on_device(replace(_BASE, family="pitch", pitch_um=(pitch, pitch), sigma_um=sigma))


def _by_size(quick: bool) -> Iterator[Cell]:
    for n in (64, 512) if quick else (64, 256, 1024, 4096):
        yield from _on_device(
            replace(_BASE, family="size", shape=(n, n), pitch_um=(0.02, 0.02), sigma_um=0.005 * n), n <= 1024
        )


def _by_shape(quick: bool) -> Iterator[Cell]:
    oblong: Iterable[tuple[tuple[int, int], tuple[float, float]]] = (
        ((65, 33), (0.1, 0.2)),
        ((64, 256), (0.1, 0.1)),
        ((200, 72), (0.05, 0.13)),
        ((128, 128), (0.02, 0.2)),
    )
    for shape, pitch in list(oblong)[:1] if quick else oblong:
        yield from _on_device(replace(_BASE, family="shape", shape=shape, pitch_um=pitch, sigma_um=1.5))


def _by_window(quick: bool) -> Iterator[Cell]:
    """From one pixel, which must be refused, over two to twice the patch's width."""
    for sigma in (0.1, 0.2, 12.8) if quick else (0.1, 0.2, 0.4, 6.4, 12.8, 25.6):
        yield from _on_device(replace(_BASE, family="window", sigma_um=sigma))


def _by_surface(quick: bool) -> Iterator[Cell]:
    kinds: tuple[Kind, ...] = ("flat", "spike", "steps") if quick else ("flat", "spike", "steps", "hills", "noise")
    for kind in kinds:
        for height in (10.0,) if quick else (0.1, 2.0, 10.0):
            yield from _on_device(replace(_BASE, family="surface", kind=kind, height_um=height), height == 0.1)


def _by_table(quick: bool) -> Iterator[Cell]:
    base = replace(_BASE, family="table", way="table", shape=(64, 64), height_um=0.3, sigma_um=1.6)
    yield base
    if quick:
        return
    yield replace(base, kind="flat")
    yield replace(base, kind="spike", height_um=1.0)
    yield replace(base, kind="steps", height_um=1e-3)
    yield replace(base, kind="hills", height_um=2.0)
    yield replace(base, shape=(128, 96), pitch_um=(0.05, 0.1))
    yield replace(base, shape=(128, 128), pitch_um=(0.2, 0.2), sigma_um=6.4)
    yield replace(base, sigma_um=0.8)
    yield replace(base, sigma_um=6.4)


_FAMILIES = (_by_height, _by_pitch, _by_size, _by_shape, _by_window, _by_surface, _by_table)


@dataclass(frozen=True)
class Criterion:
    """Errors over max(local value, 1e-3 of the mean level): Chebyshev float32 at 10 um, Taylor float64 at 2 um."""

    chebyshev_float32_at_10_um: float
    taylor_float64_at_2_um: float

    @property
    def met(self) -> bool:
        """Chebyshev in single precision holds where Taylor in double has long failed."""
        return self.chebyshev_float32_at_10_um <= CHEBYSHEV_TOLERANCE < self.taylor_float64_at_2_um


def criterion(outcomes: Sequence[Outcome]) -> Criterion:
    """The worst of the height family's cells, in memory and on the device."""

    def worst(basis: str, precision: str, height_um: float) -> float:
        return max(
            outcome.speckle
            for outcome in outcomes
            if outcome.speckle is not None
            and outcome.cell.family.startswith("height")
            and (outcome.cell.basis, outcome.cell.precision, outcome.cell.height_um) == (basis, precision, height_um)
        )

    return Criterion(worst("chebyshev", "float32", 10.0), worst("taylor", "float64", 2.0))
