"""Tables of the coherence window in the middle on several grids, whose errors the planner measures."""

from functools import cached_property

import numpy as np

from pipeline.diffraction import dft_stack
from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.progress import Progress, silent
from pipeline.surface import windows
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import Places
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.planning.anisotropy import Scattering
from pipeline.tables.polar.table import PolarTable

# the kernel of several windows keeps this many terms of each mode
_MOST_TERMS = 256


def serves_all(bake: PolarBake, extent: Extent, places: Places) -> bool:
    """Says whether the stack of a trial serves all windows; else each has one of its own."""
    fits = bake.terms <= _MOST_TERMS
    return fits and dft_stack.serves_all(extent, bake.sigma_um, bake.tolerance, places.count)


class Trial:
    """The stack of the coherence window in the middle, and tables made from it.

    bake: the settings that all tables share, with the light and the grey material of the planner.
    stack: the DFT stack of the window, or of the whole patch if that serves the other windows, too.
    """

    def __init__(self, bake: PolarBake, field: HeightField, places: Places, progress: Progress = silent) -> None:
        """Transforms the height field.

        field: the whole scan. places: positions of the window. Raises the errors of `PolarBake.stack`.
        """
        self.bake, self._field, self._places = bake, field, places
        self._serves_all = serves_all(bake, field.extent, places)
        self.stack = bake.stack(field, progress, whole=self._serves_all)
        self._made: PolarPowerSpectrum | None = None

    @cached_property
    def scattering(self) -> Scattering:
        """The azimuths into which the window in the middle scatters light."""
        return Scattering(self.stack)

    def adopt(self, bake: PolarBake) -> None:
        """Takes settings with other nodes in s and terms in |w|, which the stack serves as well."""
        self.bake, self._made = bake, None

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

    def mean_power_spectrum(self, azimuths: Azimuths, progress: Progress = silent) -> PolarPowerSpectrum:
        """Computes the mean of E over all windows.

        progress: called with the share done of each transform.
        """
        if self._places == windows.MIDDLE:
            return self.power_spectrum(azimuths)
        self._made = None
        if self._serves_all:
            return self.bake.power_spectrum(self.stack, azimuths, self._places)
        samples = dft_stack.samples_seen(self._field.extent, self.bake.sigma_um, self.bake.tolerance)
        mean: PolarPowerSpectrum | None = None
        for place in self._places.pairs():
            # release the memory first, so that the next stack can reuse it
            del self.stack
            self.stack = self.bake.stack(windows.around(self._field, place, samples), progress)
            found = self.bake.power_spectrum(self.stack, azimuths)
            if mean is None:
                mean = found
            else:
                mean.values[...] += found.values
        assert mean is not None
        mean.values[...] /= np.float32(self._places.count)
        return mean
