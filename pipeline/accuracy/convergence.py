"""The error of a table against each of its settings, measured on a coarse map under one light."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import dft_stack
from pipeline.diffraction.polar_grid import TILE, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.diffraction.reference import STEP_NM, MeanReference
from pipeline.optics import brdf, geometry
from pipeline.optics.colour import delta_e
from pipeline.optics.light import trapezoid
from pipeline.tables.evaluate import Evaluator, Map, table_evaluator
from pipeline.tables.planning import plan
from pipeline.tables.polar import quadrature
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.quadrature import RingQuadratures
from pipeline.tables.taylor import table as taylor
from pipeline.tables.taylor.layout import TaylorLayout

_MAP_SIZE = 61


@dataclass(frozen=True)
class Curve:
    """Mean CIELAB error at one exposure against one setting, with all other settings as configured.

    setting, unit: of the setting. values: of the setting, ascending. errors: at each value.
    chosen: the configured or planned value.
    """

    setting: str
    unit: str
    values: list[float]
    errors: list[float]
    chosen: float


Study = Sequence[Callable[[], Curve]]


class CoarseMap:
    """A coarse map under one light, with the reference's XYZ."""

    def __init__(self, reference: MeanReference, config: Config, light: Array, radius: float) -> None:
        """Computes the reference on the map.

        reference: of the height field. config: its light, material and exposure are read.
        light: unit vector (3,) towards it. radius: sin(theta) of the outermost views; at most 0.98 is used.
        """
        self.config, self._unit = config, config.radiometry.unit
        self.wr = Map(_MAP_SIZE, min(MAP_RADIUS, radius)).views()
        self.wi = np.broadcast_to(light, self.wr.shape)
        self._truth = reference.xyz(config.light, config.material, self.wi, self.wr)

    def error(self, evaluate: Evaluator) -> float:
        """Computes the mean CIELAB error of an evaluator, which gives XYZ for pairs of directions."""
        xyz, exposure = evaluate(self.wi, self.wr), self.config.accuracy.exposure_ru
        return float(np.mean(delta_e(xyz / self._unit, self._truth / self._unit, exposure)))


class TaylorStudy:
    """Error against terms, wavelength step, resolution and exponent of the paper's table.

    Terms and wavelength step are varied at the directions of the map, without a grid, while the other of the two is
    as fine as the reference's. Resolution and exponent are varied with all other settings as configured.
    """

    def __init__(self, stack: dft_stack.Stack, layout: TaylorLayout, chosen: Evaluator, views: CoarseMap) -> None:
        """Takes the stack of the table, its settings, the evaluator of the table itself, and the map."""
        self._stack, self._layout, self._chosen, self._views = stack, layout, chosen, views
        self._config = views.config

    def curves(self) -> Study:
        """Returns one function per setting, which computes its curve; a laser line has no wavelength step."""
        return [self.terms, *([] if self._config.light.is_line else [self.step]), self.grid, self.exponent]

    def terms(self) -> Curve:
        """Computes the error against the order N of the series."""
        most = self._stack.terms - 1
        orders = sorted({max(1, round(most * share)) for share in (0.25, 0.4, 0.55, 0.7, 0.85, 1.0)})
        errors = [self._at_views(order, STEP_NM) for order in orders]
        return Curve("terms N", "", [float(order) for order in orders], errors, float(most))

    def step(self) -> Curve:
        """Computes the error against the wavelength step, nm."""
        steps = sorted({1.0, 2.0, 5.0, 10.0, 20.0, self._layout.step_nm})
        errors = [self._at_views(self._stack.terms - 1, step) for step in steps]
        return Curve("wavelength step", "nm", steps, errors, self._layout.step_nm)

    def grid(self) -> Curve:
        """Computes the error against the table's resolution, at the configured exponent."""
        chosen = self._layout.resolution
        sizes = sorted({n for n in (51, 101, 201, 301) if n < chosen})
        errors = [self._on_grid(size, self._layout.power) for size in sizes]
        errors.append(self._views.error(self._chosen))
        return Curve("resolution", "nodes", [float(n) for n in (*sizes, chosen)], errors, float(chosen))

    def exponent(self) -> Curve:
        """Computes the error against the grid's exponent a, at 201 nodes or the configured number if it is less."""
        size = min(201, self._layout.resolution)
        powers = sorted({1.0, 2.0, 3.0, 5.0, self._layout.power})
        errors = [self._on_grid(size, power) for power in powers]
        return Curve(f"exponent a at {size} nodes", "", powers, errors, self._layout.power)

    def _on_grid(self, size: int, power: float) -> float:
        rule = self._config.radiometry.integrand(self._layout.step_nm)
        table = taylor.build(self._stack, rule, size, power, self._config.scene)
        return self._views.error(table_evaluator(table, self._config.radiometry))

    def _at_views(self, order: int, step_nm: float) -> float:
        """Computes the error of a Taylor series of some order and wavelength step, at the directions of the map."""
        fewer = replace(self._stack, coefficients=self._stack.coefficients[..., : order + 1])
        plain = trapezoid(self._config.light, step_nm)

        def evaluate(wi: Array, wr: Array) -> Array:
            summed = taylor.at_directions(fewer, self._config.radiometry.integrand(step_nm), geometry.uvw(wi, wr))
            return brdf.direction_factor(self._config.material, plain, wi, wr)[:, None] * summed

        return self._views.error(evaluate)


class PolarStudy:
    """Error against rings, azimuths, terms in |w| and wavelength step of the polar table, all others as planned."""

    def __init__(
        self,
        power: PolarPowerSpectrum,
        planned: plan.Plan,
        layout: PolarLayout,
        chosen: Evaluator,
        views: CoarseMap,
    ) -> None:
        """Prepares the study.

        power: the power spectrum E of the table. planned: the table's plan. layout: its settings.
        chosen: evaluator of the table itself. views: the map.
        """
        self._power, self._plan, self._views = power, planned, views
        config = self._config = views.config
        allowed = plan.Budget(config.budget_delta_e, config.accuracy.exposure_ru)
        self._bake = planned.bake(config.radiometry, allowed, layout)
        self._chosen = views.error(chosen)
        self._rules = self._bake.rules(planned.rings.rho())

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
