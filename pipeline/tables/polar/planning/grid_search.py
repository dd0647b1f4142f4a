"""The search for the smallest polar grid that keeps an error budget.

The errors of three tables at test directions give the coefficients of e^2 = a / rings^8 + b / azimuths^8 + c: cubic
splines err by the fourth power of the distance of their knots. The search minimises rings times azimuths under this
model and measures the error of the grids that it proposes. Of those that keep the budget it takes the one with the
fewest texels, since innermost bands keep a part of the azimuths.
"""

from functools import cached_property
from math import asinh, ceil, sqrt

import numpy as np

from pipeline import resources
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings, last_ring
from pipeline.diffraction.tiles import AZIMUTHS, thinned
from pipeline.optics.coherence import FLANK_DELTA_E, lobe_width
from pipeline.scene.model import Scene
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning.anisotropy import anisotropy
from pipeline.tables.polar.planning.probes import FlankProbes, Probes
from pipeline.tables.polar.planning.trial import Trial

GRID_SHARE = 0.65  # share of the budget for the error at the test directions
# start of the search: the grid that keeps a dE of 0.1 on snake scans with sigma = 16.25 um
_BASE_SIGMA_UM, _BASE_DELTA_E, _BASE_AZIMUTHS, _BASE_RING_STEP, _BASE_R0 = 16.25, 0.1, 1792, 0.0253, 0.12
# distances of the innermost rings among which the search chooses, in widths of the specular lobe at the shortest
# wavelength, and the share of the limit for the largest error at the flank's test directions
_DISTANCES = (0.82, 0.65, 0.5, 0.42, 0.35, 0.3, 0.25)
_FLANK_SHARE = 0.65
_LEAST_SHARE_OF_R0 = 1.0 / 6.0
_LEAST_RINGS, _LEAST_AZIMUTHS, _MOST_RINGS, _MOST_AZIMUTHS = 24, 128, 4096, 32768
_POWER = 8  # of the knots' distance in the squared error of cubic splines
_ROUNDS = 6
_HALVINGS = 40
_GROWTH = 1.5
_NEAR = 0.75  # share of the target above which the search ends


class Grids:
    """The grids among which the search chooses, known before a surface is transformed."""

    def __init__(self, bake: PolarBake, layout: PolarLayout, delta_e: float, distance: float = _DISTANCES[0]) -> None:
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
            _whole_tiles(azimuths) if layout.azimuths == "auto" else layout.azimuths,
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

    def rings(self, count: int) -> Rings:
        """Places so many rings."""
        return Rings(count, self._r0(count), self._bake.rho_max)

    def clipped(self, rings: float, azimuths: float) -> tuple[int, int]:
        """Rounds and limits numbers of rings and azimuths, and replaces those that the layout sets."""
        layout = self._layout
        return (
            int(np.clip(ceil(rings), self._least_rings, _MOST_RINGS)) if layout.rings == "auto" else layout.rings,
            _whole_tiles(int(np.clip(azimuths, _LEAST_AZIMUTHS, _MOST_AZIMUTHS)))
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


class GridSearch:
    """The search for the grid of one surface. Numbers of rings and azimuths that the layout sets are kept."""

    def __init__(
        self, trial: Trial, layout: PolarLayout, scene: Scene | None, delta_e: float, exposure_ru: float
    ) -> None:
        """Computes the anisotropy of the surface.

        trial: the stack of the window in the middle. layout: numbers that are set. scene: lights and views, None for
        all. delta_e: mean CIELAB error allowed. exposure_ru: exposure at which it is measured, RU.
        """
        self._trial, self._bake, self._layout, self._scene = trial, trial.bake, layout, scene
        self._delta_e, self._exposure_ru = delta_e, exposure_ru
        self._grids = Grids(trial.bake, layout, delta_e, self._distance())
        self._stretch, self._axis = anisotropy(trial.stack)

    def run(self) -> tuple[Azimuths, Rings, float | None]:
        """Searches for the grid.

        Returns the azimuths, the rings, and the mean error at the test directions, None if both numbers are set.
        Raises ResourceError if a grid needs more memory than is allowed.
        """
        rings, azimuths = self._grids.first()
        error = None
        if "auto" in (self._layout.rings, self._layout.azimuths):
            rings, azimuths, error = self._smallest(rings, azimuths)
        return self._azimuths(azimuths), self._grids.rings(rings), error

    def _distance(self) -> float:
        """Chooses the largest distance of the innermost rings that keeps the flank's limit, else the least."""
        if self._bake.radiometry.light.is_line or self._layout.rings != "auto":
            return _DISTANCES[0]
        probes = FlankProbes(self._trial, self._scene)
        lobe = lobe_width(self._bake.lambda_min_nm, self._bake.sigma_um)
        kept = (one for one in _DISTANCES if probes.largest_error(one * lobe) <= _FLANK_SHARE * FLANK_DELTA_E)
        return next(kept, _DISTANCES[-1])

    def _texels(self, numbers: tuple[int, int]) -> int:
        rings, azimuths = numbers
        return thinned(PolarGrid(self._grids.rings(rings), self._azimuths(azimuths))).texels

    def _azimuths(self, count: int) -> Azimuths:
        return Azimuths(count, self._stretch, self._axis)

    def _smallest(self, rings: int, azimuths: int) -> tuple[int, int, float]:
        """Finds the numbers of rings and azimuths with the least product whose error is within the budget.

        rings, azimuths: where the search starts. Returns both numbers and the error at the test directions.
        """
        target = GRID_SHARE * self._delta_e
        errors = {}

        def error(r: int, a: int) -> float:
            if (r, a) not in errors:
                errors[r, a] = self._error(r, a)
            return errors[r, a]

        # e^2 = by_rings / rings^8 + by_azimuths / azimuths^8 + rest, from three tables
        here = error(rings, azimuths) ** 2
        other_rings = _other(rings, 3 * rings // 4)
        other_azimuths = _other(azimuths, _whole_tiles(3 * azimuths // 4))
        by_rings = _share(error(other_rings, azimuths) ** 2 - here, other_rings, rings)
        by_azimuths = _share(error(rings, other_azimuths) ** 2 - here, other_azimuths, azimuths)
        rest = max(here - by_rings * float(rings) ** -_POWER - by_azimuths * float(azimuths) ** -_POWER, 0.0)
        left = max(target**2 - rest, 0.25 * target**2)
        best, proposed = (rings, azimuths), set[tuple[int, int]]()
        for _ in range(_ROUNDS):
            before, best = (
                best,
                self._grids.clipped(*((2.0 * by / left) ** (1.0 / _POWER) for by in (by_rings, by_azimuths))),
            )
            if errors.get(best, 0.0) > target:
                # the model proposes a grid known to miss the target; a coarse grid can have a low error by chance
                if any(errors[pair] <= target for pair in proposed):
                    break
                best = self._grids.clipped(_GROWTH * before[0], _GROWTH * before[1])
            proposed.add(best)
            if _NEAR * target <= error(*best) <= target:
                break
            # no error at all, where every test direction saturates or is black, asks for the coarsest grid
            left *= min(2.0, 0.9 * target / max(error(*best), 1e-9 * target)) ** 2
        # numbers that the config sets were varied for the model only
        allowed = {pair: errors[pair] for pair in errors if pair == self._grids.clipped(*pair)}
        met = [pair for pair in allowed if allowed[pair] <= target]
        best = min(met, key=self._texels) if met else min(allowed, key=allowed.__getitem__)
        return *best, allowed[best]

    @cached_property
    def _probes(self) -> Probes:
        return Probes(self._trial, self._scene, self._exposure_ru)

    def _error(self, rings: int, azimuths: int) -> float:
        """Measures the mean CIELAB error of a table of this size at the test directions."""
        # the search may leave the grid that was foreseen: the probes' tables are small and come first
        probes, layout = self._probes, self._grids
        resources.require(
            f"the power spectrum on {azimuths} azimuths and the table of {rings} rings",
            sum(layout.arrays(rings, azimuths).values()),
            "use a smaller coherence.sigma_um, lower the heights or raise accuracy.delta_e",
        )
        return probes.error(self._trial.table(self._azimuths(azimuths), layout.rings(rings)))


def _other(count: int, coarser: int) -> int:
    """Chooses a second number for the model: the coarser one, or the double if that is not below `count`."""
    return coarser if coarser < count else 2 * count


def _share(growth: float, other: int, here: int) -> float:
    """Computes the coefficient c of a squared error c / n^8 that grows by `growth` from n = here to n = other."""
    return float(max(growth / (float(other) ** -_POWER - float(here) ** -_POWER), 0.0))


def _whole_tiles(azimuths: int) -> int:
    """Rounds up to whole sectors, of which a band may keep every fourth azimuth."""
    return AZIMUTHS * ceil(azimuths / AZIMUTHS)
