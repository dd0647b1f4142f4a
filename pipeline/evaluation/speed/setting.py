"""A polar table to be timed: everything that its stages are given, and the same table's integral in other hands."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.special import jv

from kernels.chebyshev import w_max, w_nodes
from kernels.spectral_operator import LinePoints, RingQuadratures
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.dft_stack import Stack, crop_to_window
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import Light, Quadrature
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import line_points, spectral_integral
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.planning.plan import Budget, Plan

# what the terms, nodes and wavelengths of every polar table here are chosen for; its grid is given
BUDGET = Budget(0.1, 7500.0)
# of P: what terms left out and the window's cut may leave
AMPLITUDE = plan.AMPLITUDE_SHARE * BUDGET.delta_e


@dataclass(frozen=True)
class Setting:
    """The stages of one surface's polar table. A config's [scene], [table] and [accuracy] are left aside.

    field: what the window sees of the surface, centred.
    """

    field: HeightField
    config: Config
    plan: Plan

    @property
    def sigma_um(self) -> float:
        return self.config.coherence.sigma_um

    @property
    def light(self) -> Light:
        return self.config.light

    @property
    def lambda_min_nm(self) -> float:
        return self.light.lambda_min_nm

    @property
    def r_max_per_um(self) -> float:
        return self.plan.rings.rho_max / (1e-3 * self.lambda_min_nm)

    @cached_property
    def bake(self) -> PolarBake:
        """The bake of this plan under the config's own light."""
        return self.plan.bake(self._under(self.light), BUDGET, PolarLayout())

    def _under(self, light: Light) -> Radiometry:
        return Radiometry(light, self.config.material, self.sigma_um)

    @property
    def radius_per_um(self) -> Array:
        """The radii of E."""
        return self.bake.radius_per_um

    def stack(self) -> Stack:
        return self.bake.stack(self.field)

    def power_spectrum(self, built: Stack) -> PolarPowerSpectrum:
        return self.bake.power_spectrum(built, self.plan.azimuths)

    @cached_property
    def rules(self) -> RingQuadratures:
        """The wavelengths of every ring under the config's own light."""
        return self.bake.rules(self.plan.rings.rho())

    @cached_property
    def points(self) -> LinePoints:
        """Where the rings take E."""
        s_max, rho = power_spectrum.s_max(self.lambda_min_nm), self.plan.rings.rho()
        return line_points.choose(self.radius_per_um, self.plan.s_nodes, s_max, rho, self.rules)

    def table(self, made: PolarPowerSpectrum, light: Light) -> polar.PolarTable:
        """Wavelengths and table under a light of the same range."""
        bake = replace(self.bake, radiometry=self._under(light))
        return bake.table(made, self.plan.rings, bake.rules(self.plan.rings.rho()))

    def samples(self, made: PolarPowerSpectrum) -> NDArray[np.float64]:
        """The table's samples (rings, 3, w nodes, azimuths) before splines are put through them."""
        of = made.values, made.radius_per_um, made.s_max_per_um, self.plan.rings.rho(), self.rules
        reflectance = self.bake.radiometry.reflectance
        terms = spectral_integral.integrate(*of, self.plan.w_terms, reflectance)
        # T_k at the nodes of w, (w node, k)
        x = 2.0 * w_nodes(self.plan.w_terms) - 1.0
        cosines = np.cos(np.arange(self.plan.w_terms) * np.arccos(x)[:, None])
        return np.asarray(np.einsum("wk,rcka->rcwa", cosines, terms))

    @cached_property
    def _w(self) -> Array:
        """|w| at the nodes of every ring, (rings, w nodes)."""
        return np.outer(w_max(self.plan.rings.rho()), w_nodes(self.plan.w_terms))

    @cached_property
    def _reflectance(self) -> NDArray[np.float32]:
        """What of R stays inside the integral, (wavelengths of all rings, w nodes)."""
        reflectance = self.bake.radiometry.reflectance
        return spectral_integral.at_nodes(reflectance, self.plan.rings.rho(), self._w, self.rules)

    def rule_of_ring(self, ring: int) -> Quadrature:
        """Wavelengths and weights of one ring."""
        first = int(self.rules.first[ring])
        part = slice(first, first + int(self.rules.count[ring]))
        return Quadrature(1e3 * self.rules.lambda_um[part], self.rules.weights[part])

    def series(self, ring: int) -> NDArray[np.complex128]:
        """(2 - [n = 0]) i^n J_n(k w H) sqrt(R), complex (wavelengths, w nodes, terms), at the ring's nodes of w.

        w is negative, and J_n(-z) = (-1)^n J_n(z).
        """
        n = np.arange(self.plan.terms)
        rule = self.rule_of_ring(ring)
        phase = 2.0 * pi / (1e-3 * rule.lambda_nm)[:, None] * self._w[ring] * self.field.half_range_um
        amplitudes = np.where(n == 0, 1.0, 2.0) * (-1j) ** n * jv(n, phase[..., None])
        first = int(np.sum(self.rules.count[:ring]))
        return np.asarray(amplitudes * np.sqrt(self._reflectance[first : first + len(phase), :, None]))


def first_bake(field: HeightField, config: Config, layout: PolarLayout) -> tuple[PolarPowerSpectrum, Setting]:
    """The spectrum and the setting of a table of a layout."""
    seen = crop_to_window(field, config.coherence.sigma_um).centred()
    trial = plan.start([seen], config.coherence.sigma_um, config.light, None, BUDGET, layout)
    chosen = plan.choose(trial, None, BUDGET, layout)
    return trial.power_spectrum(chosen.azimuths), Setting(seen, config, chosen)


def make(field: HeightField, config: Config, layout: PolarLayout) -> Setting:
    """The setting of a table of a layout."""
    return first_bake(field, config, layout)[1]
