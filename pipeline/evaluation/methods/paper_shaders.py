"""The shaders of [D14] sec. 5: the reference shader, which sums on the fly, and the look-up shader of tables."""

from math import exp

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.reference import in_band
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Method, Monochromatic
from pipeline.optics.light import Quadrature, trapezoid
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.taylor import table as taylor

# [D14] sec. 5: the window's transform is summed over 4 sigma_f either side, where it has fallen to 3e-4
PUBLISHED_CUT = exp(-(4.0**2) / 2.0)
# [D14] sec. 5: "up to 501 x 501" nodes 2 |t|^5 sign(t)
PUBLISHED_RESOLUTION, PUBLISHED_POWER = 501, 5.0
# of |P|^2: it gives heights like the paper's some of its 15 to 40 terms
_TOLERANCE = 1e-3


class PaperReference(Monochromatic):
    """sum_n (i k w)^n / n! F_n(u / lambda, v / lambda), F_n gathered for every direction and wavelength.

    With as many terms as its tolerance asks for, it differs from the exact reference by the window's cut at 4 sigma_f
    and the wavelength step. `terms` is N + 1: the paper has 15 to 40.
    """

    source = "[D14] sec. 5, reference shader"

    def __init__(self, field: HeightField, config: Config) -> None:
        """Raises AccuracyError where heights are beyond Taylor terms in the shaders' single precision."""
        super().__init__(config)
        self._field, self._stack = field, taylor_stack(field, config)
        self.terms, self.stored_bytes = self._stack.terms, self._stack.coefficients.nbytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        out = np.empty((len(uvw), len(lambda_nm)))
        for first in range(0, len(lambda_nm), 3):
            three = lambda_nm[first : first + 3]
            # the integral's three channels, each given one wavelength: I_p is then |P|^2 ordered by powers of w
            single = Quadrature(three, np.eye(len(three), 3))
            out[:, first : first + 3] = taylor.at_directions(self._stack, single, uvw)[:, : len(three)]
        return np.where(in_band(self._field, uvw, 1e-3 * lambda_nm), out, np.nan)


class PaperLookUp(Method):
    """sum_p w^p I_p(u, v) ([D14] eq. 10) from float32 tables, bilinear. They know no single wavelength."""

    source = "[D14] sec. 5, look-up shader"

    def __init__(self, field: HeightField, config: Config, resolution: int = PUBLISHED_RESOLUTION) -> None:
        """Raises AccuracyError where float32 tables would lose their digits, or not fit."""
        rule = config.radiometry.integrand(PUBLISHED_STEP_NM)
        table = taylor.build(taylor_stack(field, config), rule, resolution, PUBLISHED_POWER)
        self.stored_bytes = table.values.nbytes
        self._look_up = table_evaluator(table, config.radiometry)

    def xyz(self, wi: Array, wr: Array) -> Array:
        return self._look_up(wi, wr)


def taylor_stack(field: HeightField, config: Config) -> Stack:
    """The DFT of every Taylor term that the tolerance asks for, the window cut where the paper cuts it.

    Raises AccuracyError where no number of terms reaches the tolerance in single precision.
    """
    rule = trapezoid(config.light, PUBLISHED_STEP_NM)
    order = expansion.plan_taylor(field, rule, _TOLERANCE).order
    reachable = expansion.W_MAX / (1e-3 * config.light.lambda_min_nm)
    return dft_stack.build(field, "taylor", order + 1, config.coherence.sigma_um, reachable, PUBLISHED_CUT)
