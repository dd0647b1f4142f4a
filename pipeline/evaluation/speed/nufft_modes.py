"""Input of FINUFFT: every Chebyshev term under the window, low-passed to the frequencies that views reach."""

import os
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.evaluation.plain_numpy import chebyshev_terms
from pipeline.evaluation.speed.setting import AMPLITUDE, Setting
from pipeline.optics.coherence import reach_sigmas, sigma_f, window

Complex = NDArray[np.complex64]


@dataclass(frozen=True)
class Modes:
    """Samples g(x) T_n(h(x) / H) / sum g, n = 0, 1, ..: complex64 (terms, ny, nx), x = 0 at sample n // 2.

    spacing_um: between samples along (x, y).
    """

    values: Complex
    spacing_um: tuple[float, float]


def make(setting: Setting) -> Modes:
    """Return the terms that the budget needs, over the window as far as its cut."""
    field = setting.field
    ny, nx = field.shape
    my, mx = (
        _samples(n, size, setting) for n, size in zip((ny, nx), (field.size_um[1], field.size_um[0]), strict=True)
    )
    spacing_x, spacing_y = field.size_um[0] / mx, field.size_um[1] / my
    g_x, g_y = (_window(spacing, setting.sigma_um) for spacing in (spacing_x, spacing_y))
    # the patch repeats under the window
    rows, columns = ((np.arange(len(g)) - len(g) // 2) % m for g, m in ((g_y, my), (g_x, mx)))
    under = np.multiply.outer(g_y / g_y.sum(), g_x / g_x.sum()).astype(np.float32)
    values = np.empty((setting.plan.terms, len(g_y), len(g_x)), np.complex64)
    t = np.fft.ifftshift(field.heights_um / field.half_range_um)
    for value, term in zip(values, chebyshev_terms(t), strict=False):
        value[:] = under * _low_passed(term.astype(np.float32), (my, mx))[np.ix_(rows, columns)]
    return Modes(values, (spacing_x, spacing_y))


def _samples(n: int, size_um: float, setting: Setting) -> int:
    """The fewest samples of one period that carry every frequency that a view reaches under the window."""
    edge = setting.r_max_per_um + reach_sigmas(AMPLITUDE) * sigma_f(setting.sigma_um)
    return min(n, int(fft.next_fast_len(ceil(2.0 * edge * size_um), real=True)))


def _window(spacing_um: float, sigma_um: float) -> NDArray[np.float64]:
    reach = ceil(reach_sigmas(AMPLITUDE) * sigma_um / spacing_um)
    return np.asarray(window(np.arange(-reach, reach, dtype=np.float64) * spacing_um, sigma_um))


def _low_passed(term: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    """A periodic term (ny, nx) on fewer samples of the same period."""
    if term.shape == shape:
        return term
    my, mx = shape
    spectrum = fft.rfft2(term, workers=os.cpu_count())
    low = np.concatenate([spectrum[: (my + 1) // 2], spectrum[len(spectrum) - my // 2 :]])[:, : mx // 2 + 1]
    scale = np.float32(my * mx / term.size)
    return np.asarray(scale * fft.irfft2(low, s=shape, workers=os.cpu_count()), np.float32)
