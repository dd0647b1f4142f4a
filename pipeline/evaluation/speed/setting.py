"""A polar table to be timed, and the same table's integral for other algorithms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.special import jv

from kernels.chebyshev import w_max, w_nodes
from kernels.spectral_operator import RingQuadratures
from pipeline.config.models import Config
from pipeline.diffraction.dft_stack import crop_to_window
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import Light, Quadrature
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import MIDDLE
from pipeline.tables.polar import spectral_integral, table
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.planning.plan import Budget, Plan
from pipeline.tables.polar.table import PolarTable

# what the terms, nodes and wavelengths of every polar table here are chosen for; its grid is given
BUDGET = Budget(0.1, 7500.0)


@dataclass(frozen=True)
class Setting:
    """One surface's polar table. A config's [scene], [table] and [accuracy] are left aside.

    field: what the window sees of the surface, centred. plan: the table's grid. bake: its steps under the config's
    own light.
    """

    field: HeightField
    plan: Plan
    bake: PolarBake

    @cached_property
    def rules(self) -> RingQuadratures:
        """The wavelengths of every ring under the config's own light."""
        return self.bake.rules(self.plan.rings.rho())

    def table(self, made: PolarPowerSpectrum) -> PolarTable:
        """Choose wavelengths and make the table."""
        return self.bake.table(made, self.plan.rings, self.bake.rules(self.plan.rings.rho()))

    def tables(self, made: PolarPowerSpectrum, lights: Sequence[Light]) -> list[PolarTable]:
        """Choose wavelengths and make the tables of several lights of the config's range in one pass."""
        bakes = [replace(self.bake, radiometry=replace(self.bake.radiometry, light=light)) for light in lights]
        integrands = [bake.integrand(bake.rules(self.plan.rings.rho())) for bake in bakes]
        return table.build(made, self.plan.rings, integrands, self.plan.w_terms)

    def samples(self, made: PolarPowerSpectrum) -> NDArray[np.float64]:
        """Return the table's samples (rings, 3, w nodes, azimuths) before splines are put through them."""
        of = made.values, made.radius_per_um, made.s_max_per_um, self.plan.rings.rho(), self.rules
        terms = spectral_integral.integrate(*of, self.plan.w_terms, self.bake.radiometry.reflectance)
        at_nodes = np.polynomial.chebyshev.chebvander(2.0 * w_nodes(self.plan.w_terms) - 1.0, self.plan.w_terms - 1)
        return np.asarray(np.einsum("wk,rcka->rcwa", at_nodes, terms))

    def rule_of_ring(self, ring: int) -> Quadrature:
        """Return wavelengths and weights of one ring."""
        part = slice(self.rules.first[ring], self.rules.first[ring] + self.rules.count[ring])
        return Quadrature(1e3 * self.rules.lambda_um[part], self.rules.weights[part])

    def series(self, ring: int) -> NDArray[np.complex128]:
        """Return (2 - [n = 0]) i^n J_n(k w H) sqrt(R), (wavelengths, w nodes, terms), at the ring's nodes of w.

        w is negative, and J_n(-z) = (-1)^n J_n(z).
        """
        rho, lambda_nm = self.plan.rings.rho()[ring], self.rule_of_ring(ring).lambda_nm
        n, w = np.arange(self.plan.terms), w_max(rho) * w_nodes(self.plan.w_terms)
        phase = 2.0 * pi / (1e-3 * lambda_nm)[:, None] * w * self.field.half_range_um
        amplitudes = np.where(n == 0, 1.0, 2.0) * (-1j) ** n * jv(n, phase[..., None])
        # (u, v, w) = -wi - wr, whose half length is the cosine of the half angle
        reflectance = self.bake.radiometry.reflectance(lambda_nm, 0.5 * np.hypot(rho, w)).T
        return np.asarray(amplitudes * np.sqrt(reflectance)[..., None])


def make(field: HeightField, config: Config, layout: PolarLayout) -> Setting:
    """Return the setting of a table of a layout."""
    return first_bake(field, config, layout)[1]


def first_bake(field: HeightField, config: Config, layout: PolarLayout) -> tuple[PolarPowerSpectrum, Setting]:
    """Return the power spectrum and the setting of a table of a layout."""
    sigma_um = config.coherence.sigma_um
    seen = crop_to_window(field, sigma_um, plan.AMPLITUDE_SHARE * BUDGET.delta_e).centred()
    trial = plan.start(seen, MIDDLE, sigma_um, config.light, None, BUDGET, layout)
    chosen = plan.choose(trial, None, BUDGET, layout)
    bake = chosen.bake(Radiometry(config.light, config.material, sigma_um), BUDGET, PolarLayout())
    return trial.power_spectrum(chosen.azimuths), Setting(seen, chosen, bake)
