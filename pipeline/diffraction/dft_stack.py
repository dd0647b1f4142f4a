"""DFT stacks: the transforms of every term of a series of exp(i k w h), over the frequencies a view can reach.

Two series share one form, sum_n c_n(k w) t^n or T_n(t), t = h / H in [-1, 1]:

- Taylor ([D14] eq. 5-7): terms t^n, c_n = (i k w H)^n / n!;
- Chebyshev (Jacobi-Anger): terms T_n(t), c_n = (2 - [n = 0]) i^n J_n(k w H).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import floor
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.fft import next_fast_len

from kernels import device, dft_stack
from kernels.dft_stack import Kept
from pipeline.diffraction.device import require_device
from pipeline.errors import AccuracyError
from pipeline.fourier import term_transforms
from pipeline.optics.coherence import BLIND_SIGMAS, reach_sigmas, sigma_f
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

Basis = Literal["taylor", "chebyshev"]
# 1e-12 of the window's sum is lost to the gaps between samples
LEAST_SIGMA_PITCHES = 1.2
_MOST_BYTES = 6 * 2**30


@dataclass(frozen=True)
class Stack:
    """DFT coefficients F_n[psi, phi] = mean(term_n(h/H) exp(+2 pi i (phi x + psi y))) of one half plane.

    The other half is its conjugate, for heights are real. The sign is Stam's.

    coefficients: float64 or float32 (rows, columns, 2, terms or more): real and imaginary part, terms side by side.
    terms: of the series; what the coefficients hold beyond fills vectors.
    row_zero, column_zero: where psi = 0 and phi = 0 stand; phi starts `reach` coefficients below 0.
    spacing_per_um: (dphi, dpsi), 1/um: one over the patch's size.
    reach: coefficients (x, y) that the window's transform needs on either side of the nearest one.
    half_range_um: H. sigma_um: the coherence window's. band_per_um: the scan's band limit (x, y), 1/um.
    """

    basis: Basis
    coefficients: NDArray[Any]
    terms: int
    row_zero: int
    column_zero: int
    spacing_per_um: tuple[float, float]
    reach: tuple[int, int]
    half_range_um: float
    sigma_um: float
    band_per_um: tuple[float, float]


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

    Terms are made in float64 whatever `dtype` they are transformed and kept in. Raises AccuracyError where the stack
    would not fit into memory, or the samples do not resolve the window; DeviceError where a Chebyshev stack finds no
    device that works.
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
    transform = _taylor if basis == "taylor" else _chebyshev
    coefficients = device.empty(shape, dtype)
    transform(field, Kept(psi_max, phi_max, reach[0]), coefficients, progress)
    return Stack(basis, coefficients, terms, psi_max, reach[0], spacing, reach, field.half_range_um, sigma_um, band)


def _taylor(field: HeightField, kept: Kept, out: NDArray[Any], progress: Progress) -> None:
    """The transforms of t^n, by FFTW."""
    t = np.fft.ifftshift(field.heights_um) * scale_per_um(field)
    term_transforms.transform(_powers(t), kept, out, progress)


def _powers(t: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """1, t, t^2, ... without end, each in the place of the one before."""
    power = np.ones_like(t)
    while True:
        yield power
        power *= t


def _chebyshev(field: HeightField, kept: Kept, out: NDArray[Any], progress: Progress) -> None:
    """The transforms of T_n(t), by a kernel. Raises DeviceError where no device works."""
    require_device()
    dft_stack.transform(field.heights_um, scale_per_um(field), kept, out, lambda done: progress("stack", done))


def scale_per_um(field: HeightField) -> float:
    """1 / H of a centred field, 1/um; of a flat one, whose t is 0, anything."""
    return 1.0 / field.half_range_um if field.half_range_um > 0 else 1.0


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


def _check_memory(shape: tuple[int, ...], itemsize: int) -> None:
    need = itemsize * int(np.prod(shape, dtype=np.int64))
    if need > _MOST_BYTES:
        raise AccuracyError(
            f"the stack of {shape[3]} terms on {shape[0]} x {shape[1]} frequencies needs {need / 2**30:.1f} GiB, "
            f"more than the {_MOST_BYTES / 2**30:.0f} GiB allowed. Use a smaller coherence.sigma_um, a smaller patch "
            "or fewer terms."
        )
