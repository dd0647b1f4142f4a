"""The error of a polar table against each of its settings."""

from dataclasses import replace

import numpy as np

from pipeline.accuracy.convergence import CoarseMap, Curve, Study
from pipeline.diffraction.polar_grid import TILE, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.polar import quadrature
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.quadrature import RingQuadratures


class PolarStudy:
    """Error against rings, azimuths, terms in |w| and wavelength step of the polar table, all others as planned."""

    def __init__(
        self,
        power: PolarPowerSpectrum,
        planned: plan.Plan,
        layout: PolarLayout,
        views: CoarseMap,
    ) -> None:
        """Prepares the study.

        power: the power spectrum E of the table. planned: the table's plan. layout: its settings. views: the map.
        """
        self._power, self._plan, self._views = power, planned, views
        config = self._config = views.config
        allowed = plan.Budget(config.budget_delta_e, config.accuracy.exposure_ru)
        self._bake = planned.bake(config.radiometry, allowed, layout)
        self._rules = self._bake.rules(planned.rings.rho())
        self._chosen = self._error(self._bake, self._rules, power)

    def curves(self) -> Study:
        """Returns one function per setting, which computes its curve; a laser line has no wavelength step."""
        return [self.rings, self.azimuths, self.w_terms, *([] if self._config.light.is_line else [self.step])]

    def rings(self) -> Curve:
        """Computes the error against the number of rings."""
        chosen = self._plan.rings.count
        counts = sorted({max(8, round(chosen * share)) for share in (0.25, 0.35, 0.5, 0.7)} - {chosen})
        errors = [self._of_rings(n) for n in counts]
        return Curve("rings", "", [float(n) for n in (*counts, chosen)], [*errors, self._chosen], float(chosen))

    def azimuths(self) -> Curve:
        """Computes the error against the number of azimuths: every eighth, fourth, second, and all."""
        chosen = self._plan.azimuths.count
        skips = [skip for skip in (8, 4, 2) if chosen % (skip * TILE) == 0]
        errors = [self._error(self._bake, self._rules, self._power.thinned(skip)) for skip in skips]
        counts = [float(chosen // skip) for skip in (*skips, 1)]
        return Curve("azimuths", "", counts, [*errors, self._chosen], float(chosen))

    def w_terms(self) -> Curve:
        """Computes the error against the number of Chebyshev terms in |w|."""
        chosen = self._plan.w_terms
        counts = sorted({4, 8, 12, chosen})
        errors = [self._chosen if n == chosen else self._of_w_terms(n) for n in counts]
        return Curve("terms in |w|", "", [float(n) for n in counts], errors, float(chosen))

    def step(self) -> Curve:
        """Computes the error against one wavelength step for all rings, nm; `chosen` is their planned mean."""
        light, rho = self._config.light, self._plan.rings.rho()
        steps = [1.0, 2.0, 5.0, 10.0, 20.0]
        light_of = self._config.radiometry.illumination
        errors = [self._error(self._bake, quadrature.uniform(light_of(s), len(rho)), self._power) for s in steps]
        low, high = light.range_nm
        chosen = (high - low) / (float(np.mean(self._rules.count)) - 1.0)
        return Curve("wavelength step", "nm", steps, errors, round(chosen, 2))

    def _of_rings(self, count: int) -> float:
        rings = replace(self._plan.rings, count=count)
        return self._error_on(rings, self._bake, self._bake.rules(rings.rho()), self._power)

    def _of_w_terms(self, count: int) -> float:
        return self._error(replace(self._bake, w_terms=count), self._rules, self._power)

    def _error(self, bake: PolarBake, rules: RingQuadratures, power: PolarPowerSpectrum) -> float:
        return self._error_on(self._plan.rings, bake, rules, power)

    def _error_on(self, rings: Rings, bake: PolarBake, rules: RingQuadratures, power: PolarPowerSpectrum) -> float:
        return self._views.error(table_evaluator(bake.table(power, rings, rules), self._config.radiometry))
