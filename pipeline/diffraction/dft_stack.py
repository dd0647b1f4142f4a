"""DFT stacks: the transforms of all terms of a series of exp(i k w h), for the frequencies that views can reach.

Two series have one form, sum_n c_n(k w) term_n(t) with t = h / H in [-1, 1]:

- Taylor ([D14] eq. 5-7): terms t^n, c_n = (i k w H)^n / n!;
- Chebyshev (Jacobi-Anger): terms T_n(t), c_n = (2 - [n = 0]) i^n J_n(k w H).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray

from kernels import device, dft_stack
from kernels.dft_stack import Kept
from pipeline import resources
from pipeline.arrays import Array
from pipeline.diffraction.device import require_device
from pipeline.errors import AccuracyError
from pipeline.fourier import term_transforms
from pipeline.fourier.lengths import next_fast
from pipeline.optics.coherence import BLIND_SIGMAS, reach_sigmas, sigma_f
from pipeline.progress import Progress, silent
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import Places

Basis = Literal["taylor", "chebyshev"]
# the sum over samples then differs from the window's integral by 1e-12 of it
LEAST_SIGMA_PITCHES = 1.2
# a wider patch has more coefficients under a window than kernels hold
_WIDEST_SIGMAS = 30.0


@dataclass(frozen=True)
class Stack:
    """DFT coefficients F_n[psi, phi] = mean(term_n(h/H) exp(+2 pi i (phi x + psi y))) of a half plane of frequencies.

    Heights are real, so the other half plane is the complex conjugate. The sign of the exponent is that of [S99].

    coefficients: float64 or float32 (rows, columns, 2, terms or more): real and imaginary parts, terms contiguous.
    terms: number of terms of the series; further entries of the last axis fill the device's vectors.
    row_zero, column_zero: indices of psi = 0 and phi = 0; the first column is at phi = -reach[0] spacings.
    spacing_per_um: (dphi, dpsi), 1/um, the reciprocal of the patch's size.
    reach: number of coefficients (x, y) on either side of the nearest one over which the window's transform extends.
    half_range_um: H, um. sigma_um: standard deviation of the coherence window, um.
    band_per_um: the scan's Nyquist limits (x, y), 1/um.
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


@dataclass(frozen=True)
class StackSize:
    """The size of a stack, known before it is built: samples that are transformed, coefficients that are kept.

    samples: (ny, nx) that are transformed. is_part: whether these are a part of the patch.
    kept: indices of the coefficients. spacing_per_um, reach: as in `Stack`.
    """

    samples: tuple[int, int]
    is_part: bool
    kept: Kept
    spacing_per_um: tuple[float, float]
    reach: tuple[int, int]

    def stack_bytes(self, terms: int, itemsize: int) -> int:
        """Computes the size of the stack of a number of terms, bytes."""
        rows, columns = self.kept.shape
        return 2 * rows * columns * terms * itemsize

    def chebyshev_bytes(self, terms: int, itemsize: int) -> resources.Arrays:
        """Lists the arrays of `build` for a Chebyshev stack.

        These are the centred heights of a part and the device's copy, the terms between the kernel's two steps, and
        the stack. The heights of a whole patch are centred already, and shared with the device.
        """
        ny, nx = self.samples
        return {
            "centred heights, twice": 2 * 8 * ny * nx if self.is_part else 0,
            "terms between two transforms": dft_stack.between_bytes(self.kept, ny),
            "stack": self.stack_bytes(terms, itemsize),
        }

    def taylor_bytes(self, terms: int) -> resources.Arrays:
        """Lists the arrays of `build` for a Taylor stack.

        These are the centred heights, t, its power and a copy with another origin, FFTW's plans, and the stack.
        """
        return {
            "heights and their powers": 4 * 8 * self.samples[0] * self.samples[1],
            "FFTW's plans": term_transforms.plans_bytes(self.samples, self.kept, terms, np.dtype(np.float64)),
            "stack": self.stack_bytes(terms, 8),
        }


def size(
    extent: Extent, sigma_um: float, frequency_max_per_um: float, tolerance: float, *, whole: bool = False
) -> StackSize:
    """Chooses the samples and the coefficients of a stack; the parameters are those of `build`."""
    samples = extent.shape if whole else samples_seen(extent, sigma_um, tolerance)
    spacing = 1.0 / (samples[1] * extent.pitch_um[0]), 1.0 / (samples[0] * extent.pitch_um[1])
    reach = window_reach(spacing, sigma_um, tolerance)
    phi_max, psi_max = (
        floor(min(frequency_max_per_um, 0.5 / pitch) / d + 0.5) + r
        for pitch, d, r in zip(extent.pitch_um, spacing, reach, strict=True)
    )
    return StackSize(samples, samples != extent.shape, Kept(psi_max, phi_max, reach[0]), spacing, reach)


def build(
    field: HeightField,
    basis: Basis,
    terms: int,
    sigma_um: float,
    frequency_max_per_um: float,
    tolerance: float,
    progress: Progress = silent,
    dtype: DTypeLike = np.float64,
    *,
    whole: bool = False,
    first_term: int = 0,
) -> Stack:
    """Transforms the terms of a series ([D14] eq. 5-7 for the Taylor series).

    Terms are computed in float64, then transformed and stored as `dtype`.

    field: heights of the whole patch. basis: the series. terms: number of terms.
    sigma_um: standard deviation of the coherence window, um.
    frequency_max_per_um: highest |f| of interest, 1/um; frequencies above the Nyquist limits are omitted in any case.
    tolerance: amplitude, relative to its peak, at which the window and its transform are cut.
    progress: called with the share done. dtype: float32 or float64.
    whole: whether samples beyond the window in the middle are transformed, too, as windows elsewhere need them.
    first_term: order of the first term, a multiple of 8; 0 for a Taylor series.
    Returns the stack. Raises AccuracyError if the samples do not resolve the window, ResourceError if the stack does
    not fit into memory, and DeviceError if a Chebyshev stack is asked for and no device works.
    """
    _check_window(sigma_um, field.pitch_um)
    # centred after the crop, because the mid-range of the part may differ from that of the whole patch
    chosen = size(field.extent, sigma_um, frequency_max_per_um, tolerance, whole=whole)
    kept, reach = chosen.kept, chosen.reach
    field = _middle(field, chosen.samples).centred()
    resources.require(
        f"the stack of {terms} terms on {kept.shape[0]} x {kept.shape[1]} frequencies",
        chosen.stack_bytes(terms, np.dtype(dtype).itemsize),
        "use a smaller coherence.sigma_um, a smaller patch or fewer terms",
    )
    values = device.empty((*kept.shape, 2, terms), dtype)
    if basis == "taylor":
        _taylor(field, kept, values, progress)
    else:
        _chebyshev(field, kept, values, first_term, progress)
    return Stack(
        basis,
        values,
        terms,
        kept.psi_max,
        reach[0],
        chosen.spacing_per_um,
        reach,
        field.half_range_um,
        sigma_um,
        field.band_limit_per_um,
    )


def _taylor(field: HeightField, kept: Kept, out: NDArray[Any], progress: Progress) -> None:
    """Transforms t^n by FFTW."""
    t = np.fft.ifftshift(field.heights_um) * scale_per_um(field)
    term_transforms.transform(_powers(t), kept, out, progress)


def _powers(t: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Yields 1, t, t^2, ... without end; each overwrites the one before."""
    power = np.ones_like(t)
    while True:
        yield power
        power *= t


def _chebyshev(field: HeightField, kept: Kept, out: NDArray[Any], first_term: int, progress: Progress) -> None:
    """Transforms T_n(t) by a kernel. Raises DeviceError if no device works."""
    require_device()
    heights, scale = field.heights_um, scale_per_um(field)
    dft_stack.transform(heights, scale, kept, out, lambda done: progress("stack", done), first_term)


def scale_per_um(field: HeightField) -> float:
    """Computes 1 / H of a centred field, 1/um; any value serves a flat field, whose t is 0."""
    return 1.0 / field.half_range_um if field.half_range_um > 0 else 1.0


def _check_window(sigma_um: float, pitch_um: tuple[float, float]) -> None:
    """Raises AccuracyError if the samples do not resolve the window.

    The sum over samples differs from the window's integral by 2 exp(-2 pi^2 (sigma / pitch)^2) of it.
    """
    if sigma_um < LEAST_SIGMA_PITCHES * max(pitch_um):
        raise AccuracyError(
            f"coherence.sigma_um = {sigma_um:g} is too narrow for the pitch of the scan: expected at least "
            f"{LEAST_SIGMA_PITCHES} pitches, {LEAST_SIGMA_PITCHES * max(pitch_um):.3g} um"
        )


def crop_to_window(field: HeightField, sigma_um: float, tolerance: float) -> HeightField:
    """Cuts the field to the samples at which the window in the middle exceeds `tolerance` of its peak.

    sigma_um: standard deviation of the coherence window, um. Returns the middle part of the field.
    """
    return _middle(field, samples_seen(field.extent, sigma_um, tolerance))


def _middle(field: HeightField, samples: tuple[int, int]) -> HeightField:
    (ny, nx), (keep_y, keep_x) = field.shape, samples
    # the middle sample remains at index n // 2
    x, y = nx // 2 - keep_x // 2, ny // 2 - keep_y // 2
    return HeightField(field.heights_um[y : y + keep_y, x : x + keep_x], field.pitch_um)


def samples_seen(extent: Extent, sigma_um: float, tolerance: float) -> tuple[int, int]:
    """Computes the samples (ny, nx) at which the window in the middle exceeds `tolerance` of its peak.

    The samples beyond hold less than `tolerance` of the window's sum.
    """
    (ny, nx), (pitch_x, pitch_y) = extent.shape, extent.pitch_um
    reach_um = min(reach_sigmas(tolerance), BLIND_SIGMAS) * sigma_um
    # lengths that are products of small primes are fast to transform
    keep_y, keep_x = (
        min(n, next_fast(2 * int(np.ceil(reach_um / pitch)) + 2)) for n, pitch in ((ny, pitch_y), (nx, pitch_x))
    )
    return keep_y, keep_x


def serves_all(extent: Extent, sigma_um: float, tolerance: float, windows: int) -> bool:
    """Says whether one stack of the whole patch is less work for several windows than a stack of each.

    The work of a stack grows with its samples, and so does the number of coefficients under a window.
    """
    ny, nx = samples_seen(extent, sigma_um, tolerance)
    is_narrow = max(extent.size_um) <= _WIDEST_SIGMAS * sigma_um
    return windows > 1 and is_narrow and 2 * extent.samples <= windows * ny * nx


def modes(built: Stack, places: Places) -> tuple[Array, Array]:
    """Computes the real factors of coefficients that stand for several windows on the patch of a stack.

    A window at a distance a from the middle multiplies the coefficients by exp(-2 pi i f a). For windows at -a and a,
    |sum F exp(-2 pi i f a)|^2 + |sum F exp(2 pi i f a)|^2 = 2 |sum F cos(2 pi f a)|^2 + 2 |sum F sin(2 pi f a)|^2:
    the mean of |P|^2 over the windows is a sum of |P|^2 over modes, each with the factors of one row and column.

    built: a stack of the whole patch. places: the windows; at most one pair and the middle along either axis.
    Returns the factors at the columns, (columns, modes), and at the rows, (rows, modes).
    """
    rows, columns = built.coefficients.shape[:2]
    along = ((columns, built.column_zero, places.x), (rows, built.row_zero, places.y))
    x, y = (
        _modes((np.arange(count, dtype=np.float64) - zero) * (spacing * 0.5 / band), offsets)
        for (count, zero, offsets), spacing, band in zip(along, built.spacing_per_um, built.band_per_um, strict=True)
    )
    return x, y


def _modes(turns: Array, offsets: tuple[int, ...]) -> Array:
    """Computes the factors along one axis; turns: f times the pitch (n,). offsets: of the windows, samples."""
    farthest = max(offsets)
    if set(offsets) - {-farthest, 0, farthest}:
        raise ValueError(f"expected windows at -a, 0 and a, got {offsets}")
    angle = 2.0 * np.pi * farthest * turns
    factors = [np.ones_like(turns)] if 0 in offsets else []
    if farthest:
        factors += [sqrt(2.0) * np.cos(angle), sqrt(2.0) * np.sin(angle)]
    return np.stack(factors, axis=-1) / sqrt(len(offsets))


def window_tolerance(tolerance: float) -> float:
    """Computes the amplitude, relative to its peak, at which the window's transform is cut for a table.

    The omitted tail multiplies coefficients that may be bright where the table is dark, so it gets a tenth of the
    tolerance. 1e-4 gives 4.8 sigma_f, which is 7 x 7 coefficients on a patch of four sigma; [D14] uses 4 sigma_f.

    tolerance: relative error allowed in the table.
    """
    return 0.1 * tolerance


def window_reach(spacing: tuple[float, float], sigma_um: float, tolerance: float) -> tuple[int, int]:
    """Computes how many coefficients (x, y) on either side of the nearest one the window's transform covers.

    spacing: distance of the coefficients (x, y), 1/um. sigma_um: standard deviation of the window, um.
    tolerance: amplitude, relative to its peak, at which the transform is cut.
    """
    radius = reach_sigmas(tolerance) * sigma_f(sigma_um)
    x, y = (floor(radius / d + 0.5) for d in spacing)
    return x, y
