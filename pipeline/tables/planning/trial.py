"""The first coherence window at work: its stack, and its power spectrum on the azimuths last asked for."""

from collections.abc import Sequence

import numpy as np

from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.table import PolarTable


class Trial:
    """Makes tables of several grids from one window, to measure their errors.

    bake: the settings that all of them share, under the light and the grey material of the probes.
    stack: the window's.
    """

    def __init__(self, bake: PolarBake, field: HeightField, progress: Progress = silent) -> None:
        """Transforms the height field of the window."""
        self.bake = bake
        self.stack = bake.stack(field, progress)
        self._made: PolarPowerSpectrum | None = None

    def power_spectrum(self, azimuths: Azimuths) -> PolarPowerSpectrum:
        """E of the window on these azimuths; the last one is kept, since a search varies rings in between."""
        if self._made is None or self._made.azimuths != azimuths:
            # releases its memory, which may serve the next one
            self._made = None
            self._made = self.bake.power_spectrum(self.stack, azimuths)
        return self._made

    def table(self, azimuths: Azimuths, rings: Rings) -> PolarTable:
        """The table on a grid."""
        return self.bake.table(self.power_spectrum(azimuths), rings, self.bake.rules(rings.rho()))

    def mean_power_spectrum(
        self, azimuths: Azimuths, others: Sequence[HeightField], progress: Progress = silent
    ) -> PolarPowerSpectrum:
        """The mean of E over this window and others, each given by its height field."""
        mean, self._made = self.power_spectrum(azimuths), None
        for field in others:
            mean.values[...] += self.bake.power_spectrum(self.bake.stack(field, progress), azimuths).values
        mean.values[...] /= np.float32(1 + len(others))
        return mean
