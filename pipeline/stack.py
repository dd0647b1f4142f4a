"""DFT stacks: the transforms of every term of a series of exp(i k w h), over the frequencies a view can reach.

Two series share one form, sum_n c_n(k w) t^n or T_n(t), t = h / H in [-1, 1]:

- Taylor ([D14] eq. 5-7): terms t^n, c_n = (i k w H)^n / n!;
- Chebyshev (Jacobi-Anger): terms T_n(t), c_n = (2 - [n = 0]) i^n J_n(k w H).
"""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import floor
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.fft import fft, next_fast_len, rfft

from kernels import device
from pipeline.errors import AccuracyError
from pipeline.optics.coherence import BLIND_SIGMAS, reach_sigmas, sigma_f
from pipeline.optics.geometry import Array
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

Basis = Literal["taylor", "chebyshev"]
# 1e-12 of the window's sum is lost to the gaps between samples
LEAST_SIGMA_PITCHES = 1.2
_MOST_BYTES = 6 * 2**30
# terms transformed together fill whole cache lines of the coefficients; rows of one block stay in a core's cache
_LINE_BYTES = 64
_BLOCK_SAMPLES = 2**15


@dataclass(frozen=True)
class Stack:
    """DFT coefficients F_n[psi, phi] = mean(term_n(h/H) exp(+2 pi i (phi x + psi y))) of one half plane.

    The other half is its conjugate, for heights are real. The sign is Stam's.

    coefficients: float64 or float32 (rows, columns, 2, terms): real and imaginary part, terms side by side.
    row_zero, column_zero: where psi = 0 and phi = 0 stand; phi starts `reach` coefficients below 0.
    spacing_per_um: (dphi, dpsi), 1/um: one over the patch's size.
    reach: coefficients (x, y) that the window's transform needs on either side of the nearest one.
    half_range_um: H. sigma_um: the coherence window's. band_per_um: the scan's band limit (x, y), 1/um.
    """

    basis: Basis
    coefficients: NDArray[Any]
    row_zero: int
    column_zero: int
    spacing_per_um: tuple[float, float]
    reach: tuple[int, int]
    half_range_um: float
    sigma_um: float
    band_per_um: tuple[float, float]

    @property
    def terms(self) -> int:
        return int(self.coefficients.shape[3])


def build(
    field: HeightField,
    basis: Basis,
    terms: int,
    sigma_um: float,
    frequency_max_per_um: float,
    tolerance: float,
    progress: Progress = silent,
    dtype: DTypeLike = np.float64,
) -> Stack:
    """The stack of `terms` terms for |f| <= `frequency_max_per_um` and the band, window cut at `tolerance`.

    Terms are made in float64 whatever `dtype` they are transformed and kept in: a recurrence in float32 would lose
    n^2 of its digits at |t| = 1. Raises AccuracyError where the stack would not fit into memory, or the samples do
    not resolve the window.
    """
    _check_window(sigma_um, field.pitch_um)
    # centred after the crop: what is left may lie off the whole patch's mid-range
    field = crop_to_window(field, sigma_um).centred()
    width, height = field.size_um
    spacing = (1.0 / width, 1.0 / height)
    reach = window_reach(spacing, sigma_um, tolerance)
    band = field.band_limit_per_um
    phi_max, psi_max = (
        floor(min(frequency_max_per_um, b) / d + 0.5) + r for b, d, r in zip(band, spacing, reach, strict=True)
    )
    shape = (2 * psi_max + 1, phi_max + reach[0] + 1, 2, terms)
    _check_memory(shape, np.dtype(dtype).itemsize)
    coefficients = device.empty(shape, dtype)
    together = min(terms, _LINE_BYTES // np.dtype(dtype).itemsize)
    series = _Series(field, basis)
    transform = _PrunedTransform(field.shape, psi_max, phi_max, reach[0], together, dtype)
    for first in range(0, terms, together):
        transform(series, coefficients[..., first : first + together])
        progress("stack", min(1.0, (first + together) / terms))
    half_range = field.half_range_um
    return Stack(basis, coefficients, psi_max, reach[0], spacing, reach, half_range, sigma_um, band)


def _check_window(sigma_um: float, pitch_um: tuple[float, float]) -> None:
    """The samples must resolve the window, or their sum is not its integral: 2 exp(-2 pi^2 (sigma / pitch)^2)."""
    if sigma_um < LEAST_SIGMA_PITCHES * max(pitch_um):
        raise AccuracyError(
            f"coherence.sigma_um = {sigma_um:g} is finer than the scan resolves: expected at least "
            f"{LEAST_SIGMA_PITCHES} pitches, {LEAST_SIGMA_PITCHES * max(pitch_um):.3g} um"
        )


def crop_to_window(field: HeightField, sigma_um: float) -> HeightField:
    """The middle of the patch that the window sees: beyond 8.5 sigma its weight is below float64's rounding."""
    ny, nx = field.shape
    # a little more where that makes the transform's length a product of small primes
    keep_x, keep_y = (
        min(n, next_fast_len(2 * int(np.ceil(BLIND_SIGMAS * sigma_um / pitch)) + 2, real=True))
        for n, pitch in ((nx, field.pitch_um[0]), (ny, field.pitch_um[1]))
    )
    # sample n // 2 stays the middle one
    x, y = nx // 2 - keep_x // 2, ny // 2 - keep_y // 2
    return HeightField(field.heights_um[y : y + keep_y, x : x + keep_x], field.pitch_um)


def window_tolerance(tolerance: float) -> float:
    """Where the window's transform is cut, as amplitude of its peak, for tables of a relative `tolerance`.

    The tail left out meets bright coefficients beside a dark node, so it is held to a tenth of the budget:
    1e-4 gives 4.8 sigma_f, 7 x 7 coefficients on a patch of four sigma (the paper takes 4 sigma_f).
    """
    return 0.1 * tolerance


def window_reach(spacing: tuple[float, float], sigma_um: float, tolerance: float) -> tuple[int, int]:
    """Coefficients (x, y) on either side of the nearest one within which the window exceeds `tolerance`."""
    radius = reach_sigmas(tolerance) * sigma_f(sigma_um)
    x, y = (floor(radius / d + 0.5) for d in spacing)
    return x, y


class _Series:
    """t^n or T_n(t), n = 0, 1, ..., by recurrence, t = h / H; row blocks are independent of each other.

    Rows and columns begin at the middle sample: terms are made sample by sample, so the origin moves to sample 0.
    """

    def __init__(self, field: HeightField, basis: Basis) -> None:
        self._heights, self._basis = field.heights_um, basis
        self._scale = 1.0 / field.half_range_um if field.half_range_um > 0 else 1.0
        self._begun: dict[int, Iterator[Array]] = {}

    def terms(self, rows: slice) -> Iterator[Array]:
        """The terms of a row block from where its last ones ended; each holds until the next is asked for."""
        return self._begun.setdefault(rows.start, self._from_first(rows))

    def _from_first(self, rows: slice) -> Iterator[Array]:
        ny, nx = self._heights.shape
        block = self._heights[np.arange(rows.start + ny // 2, rows.stop + ny // 2) % ny]
        t = self._scale * np.concatenate([block[:, nx // 2 :], block[:, : nx // 2]], axis=1)
        before, term = t.copy(), np.ones_like(t)
        while True:
            yield term
            # T_(n+1) = 2 t T_n - T_(n-1) takes the place of T_(n-1); T_(-1) = T_1 = t
            following = t * term
            if self._basis == "chebyshev":
                following *= 2.0
                following -= before
            before, term = term, following


class _PrunedTransform:
    """mean(a exp(+2 pi i f.x)) of real arrays (ny, nx) at psi = -psi_max.., phi = -reach_x .. phi_max.

    The transform along y is done only for the columns kept. Indices wrap: the DFT is periodic, so sums near
    the band limit equal those over the samples.
    """

    def __init__(
        self, shape: tuple[int, int], psi_max: int, phi_max: int, reach_x: int, together: int, dtype: DTypeLike
    ) -> None:
        ny, nx = shape
        phi = (np.arange(-reach_x, phi_max + 1) + nx // 2) % nx - nx // 2
        self._samples = ny * nx
        self._columns, self._mirrored = np.abs(phi), phi < 0
        self._rows = np.arange(-psi_max, psi_max + 1) % ny
        block = max(1, _BLOCK_SAMPLES // nx)
        self._blocks = [slice(first, min(first + block, ny)) for first in range(0, ny, block)]
        self._real = np.dtype(dtype)
        shape_kept = (together, ny, int(self._columns.max()) + 1)
        self._narrow = np.empty(shape_kept, np.result_type(dtype, np.complex64))

    def __call__(self, series: _Series, out: NDArray[Any]) -> None:
        """The next terms of a series into `out` (rows, columns, 2, terms)."""
        narrow, kept, threads = self._narrow[: out.shape[3]], self._narrow.shape[2], os.cpu_count() or 1

        def along_x(rows: slice) -> None:
            for plane, term in zip(narrow, series.terms(rows), strict=False):
                plane[rows] = rfft(term.astype(self._real, copy=False), axis=1)[:, :kept]

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(along_x, self._blocks))
            for plane in narrow:
                plane[...] = fft(plane, axis=0, workers=threads)
            list(pool.map(lambda row: self._take(row, out), range(out.shape[0])))

    def _take(self, row: int, out: NDArray[Any]) -> None:
        """One row of coefficients, from the transform's row and, where phi < 0, from its mirror image."""
        terms = out.shape[3]
        psi = self._rows[row]
        found = np.conj(self._narrow[:terms, psi][:, self._columns])
        found[:, self._mirrored] = self._narrow[:terms, -psi][:, self._columns[self._mirrored]]
        found = found.T / self._samples
        out[row, :, 0], out[row, :, 1] = found.real, found.imag


def _check_memory(shape: tuple[int, ...], itemsize: int) -> None:
    need = itemsize * int(np.prod(shape, dtype=np.int64))
    if need > _MOST_BYTES:
        raise AccuracyError(
            f"the stack of {shape[3]} terms on {shape[0]} x {shape[1]} frequencies needs {need / 2**30:.1f} GiB, "
            f"more than the {_MOST_BYTES / 2**30:.0f} GiB allowed. Use a smaller coherence.sigma_um, a smaller patch "
            "or fewer terms."
        )
