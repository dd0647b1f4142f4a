"""This project's table as a method: polar, planned for the config's error budget."""

from functools import cached_property

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.dft_stack import crop_to_window
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.diffraction.reference import in_band
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.polar import spectral
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.planning.plan import Budget, Plan
from pipeline.tables.polar.spectral import SpectralTable


class PolarTableMethod:
    """XYZ from rings and azimuths of splines; |P|^2 from the spectral form, which is made when first asked for.

    Of a larger scan it shows the window in the middle, as every method here does. Directions outside a
    config's [scene] are NaN.
    """

    source = "this project: polar power spectrum, integrated ring by ring"

    def __init__(self, field: HeightField, config: Config) -> None:
        """Raises AccuracyError where the budget is out of reach; DeviceError where no device works."""
        self._field, self._config = crop_to_window(field, config.coherence.sigma_um).centred(), config
        self._layout = config.table if isinstance(config.table, PolarLayout) else PolarLayout()
        power, chosen = self._planned(self._layout)
        bake = chosen.bake(config.radiometry, self._budget, self._layout)
        self._table = bake.table(power, chosen.rings, bake.rules(chosen.rings.rho()))
        self._look_up = table_evaluator(self._table, config.radiometry)

    @property
    def stored_bytes(self) -> int:
        """Of the table of XYZ; the spectral form is apart, `spectral_bytes`."""
        return self._table.values.nbytes

    @property
    def spectral_bytes(self) -> int:
        """Of the spectral form, which answers single wavelengths."""
        return self._spectral.values.nbytes

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        return self._look_up(wi, wr)

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L); NaN beyond the Nyquist limits."""
        found = spectral.look_up(self._spectral, uvw, lambda_nm)
        return np.where(in_band(self._field, uvw, 1e-3 * lambda_nm), found, np.nan)

    @cached_property
    def _spectral(self) -> SpectralTable:
        """The power spectrum on a grid planned for single wavelengths, not for the integral of many."""
        single = self._layout.model_copy(update={"form": "spectral"})
        return spectral.build(self._planned(single)[0])

    @property
    def _budget(self) -> Budget:
        return Budget(self._config.budget_delta_e, self._config.accuracy.exposure_ru)

    def _planned(self, layout: PolarLayout) -> tuple[PolarPowerSpectrum, Plan]:
        config = self._config
        trial = plan.start([self._field], config.coherence.sigma_um, config.light, config.scene, self._budget, layout)
        chosen = plan.choose(trial, config.scene, self._budget, layout)
        return trial.power_spectrum(chosen.azimuths), chosen
