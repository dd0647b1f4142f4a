"""The Gaussian window that spatial coherence puts on the surface, [D14] 4.2."""

from math import ceil, log, pi, sqrt
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pipeline.arrays import Array
from pipeline.validated import Validated

# exp(-8.5^2 / 2) = 2e-16: beyond this many sigma the window is below float64's rounding of its peak
BLIND_SIGMAS = 8.5


class Coherence(Validated):
    """The Gaussian window exp(-r^2 / (2 sigma^2)) of coherent light; 65 um = 4 sigma in [D14] 4.2.

    windows: "auto" averages |P|^2 over the windows that a larger scan holds (polar tables), "centre" takes one.
    """

    sigma_um: Annotated[float, Field(ge=1e-3, le=1e4)] = 16.25
    boundary: Literal["periodic"] = "periodic"
    windows: Literal["auto", "centre"] = "auto"


def sigma_f(sigma_um: float) -> float:
    """Width of the window's transform, 1/um: sigma_f = 1 / (2 pi sigma), [D14] eq. 8."""
    return 1.0 / (2.0 * pi * sigma_um)


def window(x_um: Array, sigma_um: float) -> Array:
    """g(x) = exp(-x^2 / (2 sigma^2)), one axis of the separable window."""
    return np.asarray(np.exp(-0.5 * (x_um / sigma_um) ** 2))


def reach_sigmas(tolerance: float) -> float:
    """How many sigma_f of neighbouring DFT coefficients matter, for amplitudes to `tolerance`.

    Cut where the window's transform has fallen to `tolerance` of its peak. [D14] sec. 5 uses 4 (3e-4).
    """
    return sqrt(2.0 * log(1.0 / tolerance))


def folded_window(n: int, pitch_um: float, sigma_um: float, f_per_um: float) -> np.ndarray:
    """sum_m g(x + m L) exp(2 pi i f (x + m L)) at the n samples x of one period L, complex128 (n,).

    The patch repeats under the window ([D14] eq. 8), so a sample meets the window once in every copy.
    """
    period = n * pitch_um
    copies = ceil(BLIND_SIGMAS * sigma_um / period + 0.5)
    x: Array = (np.arange(n, dtype=np.float64) - n // 2) * pitch_um
    total = np.zeros(n, dtype=np.complex128)
    for m in range(-copies, copies + 1):
        shifted = x + m * period
        total += window(shifted, sigma_um) * np.exp(2j * pi * f_per_um * shifted)
    return total
