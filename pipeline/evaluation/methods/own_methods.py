"""This project's own methods: the exact reference, which all others are held against, and the polar table."""

from functools import cached_property

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.dft_stack import crop_to_window
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.diffraction.reference import Reference, in_band
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import MIDDLE
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.polar import spectral
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.planning.plan import Budget, Plan
from pipeline.tables.polar.spectral import SpectralTable


class Exact(Monochromatic):
    """|P|^2 of the window in the patch's middle to 1e-9 of the mirror, XYZ at 1 nm (diffraction.reference)."""

    source = "this project: Chebyshev terms, windowed DFT, 1 nm"

    def __init__(self, field: HeightField, config: Config) -> None:
        """Raises AccuracyError where the samples do not resolve the window; DeviceError where no device works."""
        super().__init__(config)
        self._reference = Reference(field, config.coherence.sigma_um, config.light.lambda_min_nm)
        self.stored_bytes = self._reference.stack_bytes

    def xyz(self, wi: Array, wr: Array) -> Array:
        return self._reference.xyz(self._config.light, self._config.material, wi, wr)

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        return self._reference.power(uvw, lambda_nm)


class PolarTableMethod(Monochromatic):
    """XYZ from rings and azimuths of splines; |P|^2 from the spectral form, which is made when first asked for.

    The table is planned for the config's error budget; `stored_bytes` are its own, without the spectral form's. Of a
    larger scan it shows the window in the middle, as every method here does. Directions outside a config's [scene]
    are NaN.
    """

    source = "this project: polar power spectrum, integrated ring by ring"

    def __init__(self, field: HeightField, config: Config) -> None:
        """Raises AccuracyError where the budget is out of reach; DeviceError where no device works."""
        super().__init__(config)
        self._layout = config.table if isinstance(config.table, PolarLayout) else PolarLayout()
        self._budget = Budget(config.budget_delta_e, config.accuracy.exposure_ru)
        cut = plan.AMPLITUDE_SHARE * self._budget.delta_e
        self._field = crop_to_window(field, config.coherence.sigma_um, cut).centred()
        power, chosen = self._planned(self._layout)
        bake = chosen.bake(config.radiometry, self._budget, self._layout)
        table = bake.table(power, chosen.rings, bake.rules(chosen.rings.rho()))
        self.stored_bytes = table.values.nbytes
        self._look_up = table_evaluator(table, config.radiometry)

    def xyz(self, wi: Array, wr: Array) -> Array:
        return self._look_up(wi, wr)

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        found = spectral.look_up(self._spectral, uvw, lambda_nm)
        return np.where(in_band(self._field, uvw, 1e-3 * lambda_nm), found, np.nan)

    @cached_property
    def _spectral(self) -> SpectralTable:
        """The power spectrum on a grid planned for single wavelengths, not for the integral of many."""
        return spectral.build(self._planned(self._layout.model_copy(update={"form": "spectral"}))[0])

    def _planned(self, layout: PolarLayout) -> tuple[PolarPowerSpectrum, Plan]:
        config, sigma_um = self._config, self._config.coherence.sigma_um
        trial = plan.start(self._field, MIDDLE, sigma_um, config.light, config.scene, self._budget, layout)
        chosen = plan.choose(trial, config.scene, self._budget, layout)
        return trial.power_spectrum(chosen.azimuths), chosen
