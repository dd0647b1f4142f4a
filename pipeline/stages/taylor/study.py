"""The error of the paper's table against each of its settings."""

from dataclasses import replace

from pipeline.accuracy.convergence import CoarseMap, Curve, Study
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack
from pipeline.diffraction.reference import STEP_NM
from pipeline.optics import brdf, geometry
from pipeline.optics.light import trapezoid
from pipeline.tables.evaluate import Evaluator, table_evaluator
from pipeline.tables.taylor import table as taylor
from pipeline.tables.taylor.layout import TaylorLayout


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
