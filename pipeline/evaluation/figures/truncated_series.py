"""Maps from a series of exp(i k w h) cut after any order: Taylor's about two origins, and Chebyshev's.

All three are summed at the views themselves, at the same wavelengths, so what differs is the order alone. Light falls
at normal incidence: of the frequencies no more than 1 / lambda is kept.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import comb

from kernels import windowed_dft
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack
from pipeline.diffraction.dft_stack import Basis, Stack
from pipeline.diffraction.reference import integrate
from pipeline.diffraction.upload import upload
from pipeline.evaluation.figures.page import BenchSurface
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.optics import brdf, geometry
from pipeline.optics.light import trapezoid
from pipeline.tables.taylor import table as taylor

STEP_NM = PUBLISHED_STEP_NM
# of the window's transform: far below what any order here leaves
_WINDOW_CUT = 1e-5


@dataclass(frozen=True)
class TaylorSeries:
    """sum_(n <= N) (i k w h)^n / n! ([D14] eq. 6), heights from -H to H as the stack has them."""

    surface: BenchSurface
    stack: Stack

    @classmethod
    def centred(cls, surface: BenchSurface, order: int) -> "TaylorSeries":
        """About the heights' mid-range, as this project has them, up to an order."""
        return cls(surface, _stack(surface, "taylor", order))

    def raised(self) -> "TaylorSeries":
        """The same about the lowest height, heights from 0 to 2 H as scans come: twice the phase at the top.

        ((h + H) / 2H)^n = 2^-n sum_j C(n, j) t^j, so every transform is a mean of those about mid-range.
        """
        n = np.arange(self.stack.terms)
        mixing = comb(n[:, None], n) / 2.0 ** n[:, None]
        coefficients = np.ascontiguousarray(self.stack.coefficients @ mixing.T)
        half_range = 2.0 * self.stack.half_range_um
        return replace(self, stack=replace(self.stack, coefficients=coefficients, half_range_um=half_range))

    def xyz(self, order: int, wi: Array, wr: Array) -> Array:
        """XYZ (directions, 3) of the terms up to `order`."""
        config = self.surface.config
        summed = taylor.at_directions(
            _cut(self.stack, order), config.radiometry.integrand(STEP_NM), geometry.uvw(wi, wr)
        )
        factor = brdf.direction_factor(config.material, trapezoid(config.light, STEP_NM), wi, wr)
        return np.asarray(factor[:, None] * summed)


@dataclass(frozen=True)
class ChebyshevSeries:
    """sum_(n <= N) (2 - [n = 0]) i^n J_n(k w H) T_n(h / H)."""

    surface: BenchSurface
    order: int

    @cached_property
    def _stack(self) -> Stack:
        return _stack(self.surface, "chebyshev", self.order)

    def xyz(self, order: int, wi: Array, wr: Array) -> Array:
        """XYZ (directions, 3) of the terms up to `order`."""
        config, rule = self.surface.config, trapezoid(self.surface.config.light, STEP_NM)
        terms = upload(_cut(self._stack, order))
        power = windowed_dft.exact_power(terms, geometry.uvw(wi, wr), 1e-3 * rule.lambda_nm)
        return integrate(power, rule, config.material, config.coherence.sigma_um, wi, wr)


def _stack(surface: BenchSurface, basis: Basis, order: int) -> Stack:
    config = surface.config
    reachable = 1e3 / config.light.lambda_min_nm
    return dft_stack.build(surface.field, basis, order + 1, config.coherence.sigma_um, reachable, _WINDOW_CUT)


def _cut(whole: Stack, order: int) -> Stack:
    """The same without the terms above `order`; they stay as zeros, so that one kernel serves every order."""
    coefficients = whole.coefficients.copy()
    coefficients[..., order + 1 :] = 0.0
    return replace(whole, coefficients=coefficients)
