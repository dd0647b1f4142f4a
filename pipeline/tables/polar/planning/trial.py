"""Tables of the first coherence window on several grids, whose errors the planner measures."""

from collections.abc import Sequence

import numpy as np

from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.table import PolarTable


class Trial:
    """The stack of the first coherence window, and tables made from it.

    bake: the settings that all tables share, with the light and the grey material of the planner.
    stack: the DFT stack of the window.
    """

    def __init__(self, bake: PolarBake, field: HeightField, progress: Progress = silent) -> None:
        """Transforms the height field of the window. Raises the errors of `PolarBake.stack`."""
        self.bake = bake
        self.stack = bake.stack(field, progress)
        self._made: PolarPowerSpectrum | None = None

    def power_spectrum(self, azimuths: Azimuths) -> PolarPowerSpectrum:
        """Computes E of the window on the given azimuths.

        The last E is kept, because the search varies the rings between two changes of the azimuths.
        """
        if self._made is None or self._made.azimuths != azimuths:
            # release the memory first, so that the next E can reuse it
            self._made = None
            self._made = self.bake.power_spectrum(self.stack, azimuths)
        return self._made

    def table(self, azimuths: Azimuths, rings: Rings) -> PolarTable:
        """Makes the table on a grid."""
        return self.bake.table(self.power_spectrum(azimuths), rings, self.bake.rules(rings.rho()))

    def mean_power_spectrum(
        self, azimuths: Azimuths, others: Sequence[HeightField], progress: Progress = silent
    ) -> PolarPowerSpectrum:
        """Computes the mean of E over this window and others.

        others: height fields of the other windows. progress: called with the share done of each transform.
        """
        mean, self._made = self.power_spectrum(azimuths), None
        for field in others:
            mean.values[...] += self.bake.power_spectrum(self.bake.stack(field, progress), azimuths).values
        mean.values[...] /= np.float32(1 + len(others))
        return mean
