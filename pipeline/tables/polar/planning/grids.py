"""The grids among which the search of the planner chooses, known before a surface is transformed."""

from math import asinh, ceil, floor, sqrt

import numpy as np

from pipeline import resources
from pipeline.diffraction.polar_grid import Rings, last_ring
from pipeline.diffraction.tiles import AZIMUTHS
from pipeline.optics.coherence import lobe_width
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout

# start of the search: the grid that keeps a dE of 0.1 on snake scans with sigma = 16.25 um
_BASE_SIGMA_UM, _BASE_DELTA_E, _BASE_AZIMUTHS, _BASE_RING_STEP, _BASE_R0 = 16.25, 0.1, 1792, 0.0253, 0.12
# distances of the innermost rings among which the planner chooses, in widths of the specular lobe at the shortest
# wavelength
DISTANCES = (0.82, 0.65, 0.5, 0.42, 0.35, 0.3, 0.25)
_LEAST_SHARE_OF_R0 = 1.0 / 6.0
_LEAST_RINGS, _LEAST_AZIMUTHS, _MOST_RINGS, _MOST_AZIMUTHS = 24, 128, 4096, 32768
_HALVINGS = 40


class Grids:
    """The grids among which the search chooses, known before a surface is transformed."""

    def __init__(self, bake: PolarBake, layout: PolarLayout, delta_e: float, distance: float = DISTANCES[0]) -> None:
        """Takes the settings of all grids.

        bake: the settings of the tables. layout: numbers that are set. delta_e: mean CIELAB error allowed.
        distance: of the innermost rings at most, in widths of the specular lobe at the shortest wavelength.
        """
        self._bake, self._layout, self._delta_e = bake, layout, delta_e
        self._last, self._is_line = last_ring(bake.rho_max), bake.radiometry.light.is_line
        self._distance = distance * lobe_width(bake.lambda_min_nm, bake.sigma_um)

    def first(self) -> tuple[int, int]:
        """Computes the first numbers of rings and azimuths: the error falls with the square of either."""
        finer = sqrt(_BASE_DELTA_E / self._delta_e)
        window = self._bake.sigma_um / _BASE_SIGMA_UM
        step = _BASE_RING_STEP / finer
        if self._is_line:
            x = asinh(self._last / self._widest_r0)
            step = 0.5 * x / (self._bake.radius_per_um[-1] * 2.0 * np.pi * self._bake.sigma_um) / finer
        x = asinh(self._last / self._r0_at(step))
        rings = int(np.clip(x / step, self._least_rings, _MOST_RINGS))
        azimuths = int(np.clip(_BASE_AZIMUTHS * window * finer, _LEAST_AZIMUTHS, _MOST_AZIMUTHS))
        layout = self._layout
        return (
            rings if layout.rings == "auto" else layout.rings,
            whole_tiles(azimuths) if layout.azimuths == "auto" else layout.azimuths,
        )

    @property
    def _widest_r0(self) -> float:
        """The largest radius below which rings are even: about the specular lobe, or all for a laser line."""
        widest = 4.0 * self._last
        return widest if self._is_line else min(_BASE_R0 * _BASE_SIGMA_UM / self._bake.sigma_um, widest)

    def _r0(self, count: int) -> float:
        """Chooses the radius below which rings are evenly spaced, for a number of rings.

        It is the largest one that places the innermost rings at the distance that the specular lobe needs. A number
        that the layout sets keeps the largest of all, which serves the mean error best.
        """
        high = self._widest_r0
        if self._is_line or self._layout.rings != "auto" or self._span(high) <= self._distance * (count - 1):
            return high
        low = _LEAST_SHARE_OF_R0 * high
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._span(middle) <= self._distance * (count - 1) else (low, middle)
        return low

    def _span(self, r0: float) -> float:
        """Computes the distance of the innermost rings times the number of distances."""
        return r0 * asinh(self._last / r0)

    @property
    def _least_rings(self) -> int:
        """Least number of rings, whatever the budget: the step that puts even rings one width of the lobe apart."""
        step = lobe_width(self._bake.lambda_min_nm, self._bake.sigma_um) / self._widest_r0
        return max(_LEAST_RINGS, ceil(asinh(self._last / self._r0_at(step)) / step))

    def _r0_at(self, step: float) -> float:
        """Chooses the radius below which rings are evenly spaced, for a step of arsinh(rho / r0)."""
        widest = self._widest_r0
        return widest if self._is_line else float(np.clip(self._distance / step, _LEAST_SHARE_OF_R0 * widest, widest))

    def innermost(self) -> Rings:
        """Places the rings of the first grid as far apart at the mirror direction as the search may."""
        r0 = self._r0(self.first()[0])
        return Rings(max(floor(self._span(r0) / self._distance) + 1, _LEAST_RINGS), r0, self._bake.rho_max)

    def rings(self, count: int) -> Rings:
        """Places so many rings."""
        return Rings(count, self._r0(count), self._bake.rho_max)

    def clipped(self, rings: float, azimuths: float) -> tuple[int, int]:
        """Rounds and limits numbers of rings and azimuths, and replaces those that the layout sets."""
        layout = self._layout
        return (
            int(np.clip(ceil(rings), self._least_rings, _MOST_RINGS)) if layout.rings == "auto" else layout.rings,
            whole_tiles(int(np.clip(azimuths, _LEAST_AZIMUTHS, _MOST_AZIMUTHS)))
            if layout.azimuths == "auto"
            else layout.azimuths,
        )

    def arrays(self, rings: int, azimuths: int) -> resources.Arrays:
        """Lists the arrays of E and of a table from it."""
        bake = self._bake
        return {
            "power spectrum": bake.power_spectrum_bytes(azimuths),
            **bake.integral_size(self.rings(rings), azimuths).arrays(),
        }


def whole_tiles(azimuths: int) -> int:
    """Rounds up to whole sectors, of which a band may keep every fourth azimuth."""
    return AZIMUTHS * ceil(azimuths / AZIMUTHS)
