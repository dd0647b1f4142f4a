"""The reference shader of [D14] sec. 5: Taylor terms, their windowed DFT, a trapezoidal rule of 5 nm, on the fly."""

from math import exp

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.reference import in_band
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, integrated
from pipeline.optics.light import Quadrature, trapezoid
from pipeline.surface.heightfield import HeightField
from pipeline.tables.taylor import table as taylor

# [D14] sec. 5: the window's transform is summed over 4 sigma_f either side, where it has fallen to 3e-4
PUBLISHED_CUT = exp(-(4.0**2) / 2.0)
# of |P|^2: it gives heights like the paper's some of its 15 to 40 terms
TOLERANCE = 1e-3


class PaperReference:
    """sum_n (i k w)^n / n! F_n(u / lambda, v / lambda), F_n gathered for every direction and wavelength.

    With as many terms as its tolerance asks for, it differs from the exact reference by the window's cut at 4 sigma_f
    and the wavelength step.
    """

    source = "[D14] sec. 5, reference shader"

    def __init__(self, field: HeightField, config: Config, tolerance: float = TOLERANCE) -> None:
        """Raises AccuracyError where heights are beyond Taylor terms in the shaders' single precision."""
        self._field, self._config = field, config
        self._stack = taylor_stack(field, config, tolerance)

    @property
    def terms(self) -> int:
        """N + 1: the paper has 15 to 40."""
        return self._stack.terms

    @property
    def stored_bytes(self) -> int:
        """Of the DFT of every Taylor term."""
        return self._stack.coefficients.nbytes

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        return integrated(self.power, self._config, wi, wr)

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L); NaN beyond the Nyquist limits."""
        out = np.empty((len(uvw), len(lambda_nm)))
        for first in range(0, len(lambda_nm), 3):
            three = lambda_nm[first : first + 3]
            # the integral's three channels, each given one wavelength: I_p is then |P|^2 ordered by powers of w
            single = Quadrature(three, np.eye(len(three), 3))
            out[:, first : first + 3] = taylor.at_directions(self._stack, single, uvw)[:, : len(three)]
        return np.where(in_band(self._field, uvw, 1e-3 * lambda_nm), out, np.nan)


def taylor_stack(field: HeightField, config: Config, tolerance: float) -> Stack:
    """The DFT of every Taylor term that `tolerance` asks for, the window cut where the paper cuts it.

    Raises AccuracyError where no number of terms reaches the tolerance in single precision.
    """
    rule = trapezoid(config.light, PUBLISHED_STEP_NM)
    order = expansion.plan_taylor(field, rule, tolerance).order
    reachable = expansion.W_MAX / (1e-3 * config.light.lambda_min_nm)
    return dft_stack.build(field, "taylor", order + 1, config.coherence.sigma_um, reachable, PUBLISHED_CUT)
