"""The polar table by FINUFFT, the fastest library for the same sums: the baseline of `bench speed`.

Every F_n(f), f = (u, v) / lambda, of every texel and wavelength is a 2D sum over uniform samples at a nonuniform
frequency, a type-2 transform. FINUFFT is used as follows, to its advantage:

- The patch repeats under the window, and its copies meet other phases at every f. So the patch is laid side by side
  under the whole window and transformed once; a window folded onto one patch would need other samples at every f.
- No view reaches beyond 2 / lambda_min. The terms are low-passed to that first and sampled no more finely: about a
  quarter of a 0.05 um scan's samples, and the same sums.
- Terms are transformed together, in single precision, by all threads, with the faster of both upsampling factors.
  Heights are real, so half of the azimuths do.
- In the DFT domain the window's few weights over the patch's own coefficients would do. That is this project's
  kernel: FINUFFT's interpolation has a window of its own and cannot apply the Gaussian one.

It runs on adjacent azimuths, a part of all. Time that grows with the points is scaled by their number; the rest
(terms, FFTs) counts once, as if the memory held the transforms of all points together.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from math import ceil, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.arrays import Array
from pipeline.evaluation.plain_numpy import chebyshev_terms
from pipeline.evaluation.speed.setting import Setting
from pipeline.evaluation.speed.timing import best_of
from pipeline.optics.coherence import reach_sigmas, sigma_f, window

Complex = NDArray[np.complex64]

_TOLERANCE = 1e-5
_UPSAMPLING = (1.25, 2.0)


def available() -> bool:
    """Return whether the library is installed (the extra `bench`)."""
    return find_spec("finufft") is not None


@dataclass(frozen=True)
class Modes:
    """Samples g(x) T_n(h(x) / H) / sum g, n = 0, 1, ..: complex64 (terms, ny, nx), x = 0 at sample n // 2.

    spacing_um: between samples along (x, y).
    """

    values: Complex
    spacing_um: tuple[float, float]


@dataclass(frozen=True)
class NufftRun:
    """FINUFFT on some of a table's points.

    fixed_s: terms and their FFTs. transform_s, integral_s: seconds a point, for all terms. points: number of (texel,
    wavelength) pairs transformed, of half a turn. upsampling: the faster factor. samples: X, Y, Z (rings, 3, w nodes,
    2 azimuths), the opposite half turn last.
    """

    fixed_s: float
    transform_s: float
    integral_s: float
    points: int
    upsampling: float
    samples: NDArray[np.float32]

    def seconds(self, setting: Setting) -> float:
        """Return the seconds of a whole table."""
        return self.fixed_s + (self.transform_s + self.integral_s) * points_of(setting)


def points_of(setting: Setting) -> int:
    """Return the number of frequencies of a table: wavelengths of all rings, over half of the azimuths."""
    return int(np.sum(setting.rules.count)) * setting.plan.azimuths.count // 2


def run(setting: Setting, azimuths: int, repeats: int) -> NufftRun:
    """Time FINUFFT on the first `azimuths` of a table, each part the best of `repeats`."""
    modes, modes_s = best_of(repeats, lambda: modes_of(setting))
    fx, fy = _frequencies(setting, azimuths)
    tried = [_transform(modes, fx, fy, upsampling, repeats) for upsampling in _UPSAMPLING]
    best = min(tried, key=lambda t: t.fft_s + t.point_s * points_of(setting))
    band_x, band_y = setting.field.band_limit_per_um
    best.f_n[:, (np.abs(fx) > band_x) | (np.abs(fy) > band_y)] = 0.0
    series = [setting.series(ring) for ring in range(setting.plan.rings.count)]
    samples, integral_s = best_of(repeats, lambda: _integrate(setting, best.f_n, series))
    return NufftRun(modes_s + best.fft_s, best.point_s, integral_s / fx.size, fx.size, best.upsampling, samples)


def modes_of(setting: Setting) -> Modes:
    """Return the terms that the budget needs, low-passed, over the window as far as its cut."""
    field, sigma_um, sigmas = setting.field, setting.bake.sigma_um, reach_sigmas(setting.bake.tolerance)
    # the fewest samples of one period that carry every frequency that a view reaches under the window
    edge = setting.plan.rings.last / (1e-3 * setting.bake.lambda_min_nm) + sigmas * sigma_f(sigma_um)
    fewest = (int(fft.next_fast_len(ceil(2.0 * edge * size_um), real=True)) for size_um in field.size_um)
    mx, my = (min(n, few) for n, few in zip(field.shape[::-1], fewest, strict=True))
    spacing_um = field.size_um[0] / mx, field.size_um[1] / my
    reach = (ceil(sigmas * sigma_um / spacing) for spacing in spacing_um)
    columns, rows = (np.arange(-r, r, dtype=np.float64) for r in reach)
    g_x, g_y = window(columns * spacing_um[0], sigma_um), window(rows * spacing_um[1], sigma_um)
    under = np.multiply.outer(g_y / g_y.sum(), g_x / g_x.sum()).astype(np.float32)
    values = np.empty((setting.plan.terms, *under.shape), np.complex64)
    t = np.fft.ifftshift(field.heights_um / field.half_range_um)
    with fft.set_workers(os.cpu_count() or 1):
        for value, term in zip(values, chebyshev_terms(t), strict=False):
            low = _low_passed(term.astype(np.float32), (my, mx))
            # the patch repeats under the window
            value[:] = under * low[np.ix_(rows.astype(int) % my, columns.astype(int) % mx)]
    return Modes(values, spacing_um)


def _low_passed(term: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    """A periodic term (ny, nx) on fewer samples of the same period, in half the time of scipy.signal.resample."""
    my, mx = shape
    spectrum = fft.rfft2(term)
    low = np.concatenate([spectrum[: (my + 1) // 2], spectrum[len(spectrum) - my // 2 :]])[:, : mx // 2 + 1]
    return np.asarray(np.float32(my * mx / term.size) * fft.irfft2(low, s=shape), np.float32)


def _frequencies(setting: Setting, azimuths: int) -> tuple[Array, Array]:
    """(fx, fy) of all wavelengths of all rings, one ring after the other, (wavelengths, azimuths), 1/um."""
    rings = enumerate(setting.plan.rings.rho())
    r = np.concatenate([rho / (1e-3 * setting.rule_of_ring(ring).lambda_nm) for ring, rho in rings])
    phi = setting.plan.azimuths.phi()[:azimuths]
    return np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi))


@dataclass(frozen=True)
class _Transformed:
    """F_n (terms, wavelengths, azimuths), and the seconds its FFTs took and each point beyond them."""

    f_n: Complex
    fft_s: float
    point_s: float
    upsampling: float


def _transform(modes: Modes, fx: Array, fy: Array, upsampling: float, repeats: int) -> _Transformed:
    import finufft

    terms = len(modes.values)
    plan: Any = finufft.Plan(
        2,
        modes.values.shape[1:],
        n_trans=terms,
        eps=_TOLERANCE,
        isign=1,
        dtype="complex64",
        upsampfac=upsampling,
        nthreads=os.cpu_count() or 1,
        showwarn=0,
    )
    # radians a sample
    x, y = ((2.0 * pi * d * f.ravel()).astype(np.float32) for d, f in zip(modes.spacing_um, (fx, fy), strict=True))

    def at(points: int) -> Complex:
        # the modes' first axis is y
        plan.setpts(y[:points], x[:points])
        return np.asarray(plan.execute(modes.values))

    # the first run plans its FFTs; one point costs no more than they do
    at(1)
    _, fft_s = best_of(repeats, lambda: at(1))
    f_n, seconds = best_of(repeats, lambda: at(x.size))
    return _Transformed(f_n.reshape(terms, *fx.shape), fft_s, max(seconds - fft_s, 0.0) / x.size, upsampling)


def _integrate(setting: Setting, f_n: Complex, series: list[NDArray[np.complex128]]) -> NDArray[np.float32]:
    """XYZ (rings, 3, w nodes, 2 azimuths) of both half turns, from F_n (terms, wavelengths, azimuths) of one."""
    end = np.cumsum(setting.rules.count)

    def ring(i: int) -> NDArray[np.float32]:
        part = f_n[:, end[i] - setting.rules.count[i] : end[i]].transpose(1, 0, 2)
        factors = series[i][..., : len(f_n)]
        # the factors of even terms are real, of odd terms imaginary: P(f) = even - i odd
        even, odd = _sum(factors[..., ::2].real, part[:, ::2]), _sum(-factors[..., 1::2].imag, part[:, 1::2])
        # heights are real, so P(-f) takes the conjugates of F_n
        power = np.concatenate([_squared(even - 1j * odd), _squared(even + 1j * odd)], axis=-1)
        weights = setting.rule_of_ring(i).weights.T.astype(np.float32)
        return np.asarray((weights @ power.reshape(len(power), -1)).reshape(3, *power.shape[1:]))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.stack(list(pool.map(ring, range(len(series)))))


def _sum(factors: Array, terms: Complex) -> Complex:
    """Sums of complex terms (..., n, azimuths) with real factors (..., w, n): a product of real matrices."""
    parts = np.ascontiguousarray(terms).view(np.float32)
    return np.asarray(np.matmul(factors.astype(np.float32), parts)).view(np.complex64)


def _squared(amplitude: Complex) -> NDArray[np.float32]:
    return np.asarray(amplitude.real**2 + amplitude.imag**2)
