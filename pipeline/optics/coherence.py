"""The Gaussian window of spatial coherence on the surface, [D14] sec. 4.2."""

from math import ceil, log, pi, sqrt
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pipeline.arrays import Array
from pipeline.validated import Validated

# exp(-8.5^2 / 2) = 2e-16: beyond this multiple of sigma the window is below the rounding of its peak in float64
BLIND_SIGMAS = 8.5


class Coherence(Validated):
    """The window exp(-r^2 / (2 sigma^2)) of coherent light: a config's [coherence].

    sigma_um: standard deviation, um; [D14] sec. 4.2 has 4 sigma = 65 um.
    boundary: the patch repeats under the window.
    windows: "auto" averages |P|^2 over the windows that a larger scan holds (polar tables), "centre" takes one.
    """

    sigma_um: Annotated[float, Field(ge=1e-3, le=1e4)] = 16.25
    boundary: Literal["periodic"] = "periodic"
    windows: Literal["auto", "centre"] = "auto"


# the flank of the specular lobe: (u, v) within so many of its widths, the largest CIELAB error allowed there, and the
# exposure in RU at which it is measured
FLANK_WIDTHS, FLANK_DELTA_E, FLANK_RU = 6.0, 5.0, 1000.0


def sigma_f(sigma_um: float) -> float:
    """Computes the width of the window's transform, sigma_f = 1 / (2 pi sigma), 1/um ([D14] eq. 8)."""
    return 1.0 / (2.0 * pi * sigma_um)


def lobe_width(lambda_nm: float, sigma_um: float) -> float:
    """Computes the width of the specular lobe in (u, v), lambda sigma_f, where |P|^2 has fallen to 1 / e."""
    return 1e-3 * lambda_nm * sigma_f(sigma_um)


def window(x_um: Array, sigma_um: float) -> Array:
    """Evaluates g(x) = exp(-x^2 / (2 sigma^2)), one axis of the separable window, at x_um (...,)."""
    return np.asarray(np.exp(-0.5 * (x_um / sigma_um) ** 2))


def reach_sigmas(tolerance: float) -> float:
    """Computes where the window's transform has fallen to `tolerance` of its peak, in units of sigma_f.

    DFT coefficients farther away can be omitted. [D14] sec. 5 uses 4, for a tolerance of 3e-4.
    """
    return sqrt(2.0 * log(1.0 / tolerance))


def folded_window(n: int, pitch_um: float, sigma_um: float, f_per_um: float) -> np.ndarray:
    """Sums the modulated window over all copies of a patch that repeats under it ([D14] eq. 8), along one axis.

    n: samples per period. pitch_um: their distance, um. sigma_um: the window's, um. f_per_um: frequency, 1/um.
    Returns sum_m g(x + m L) exp(2 pi i f (x + m L)) at the samples x of one period L, complex128 (n,).
    """
    period = n * pitch_um
    copies = ceil(BLIND_SIGMAS * sigma_um / period + 0.5)
    x: Array = (np.arange(n, dtype=np.float64) - n // 2) * pitch_um
    total = np.zeros(n, dtype=np.complex128)
    for m in range(-copies, copies + 1):
        shifted = x + m * period
        total += window(shifted, sigma_um) * np.exp(2j * pi * f_per_um * shifted)
    return total
