"""The search for the smallest polar grid that keeps an error budget.

The errors of three tables at test directions give the coefficients of e^2 = a / rings^8 + b / azimuths^8 + c: cubic
splines err by the fourth power of the distance of their knots. The search minimises rings times azimuths under this
model and measures the error of the grids that it proposes. Of those that keep the budget it takes the one with the
fewest texels, since innermost bands keep a part of the azimuths.
"""

from functools import cached_property

from pipeline import resources
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import thinned
from pipeline.scene.model import Scene
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning.grids import Grids, whole_tiles
from pipeline.tables.polar.planning.probes import Probes
from pipeline.tables.polar.planning.trial import Trial

GRID_SHARE = 0.65  # share of the budget for the error at the test directions
_POWER = 8  # of the knots' distance in the squared error of cubic splines
_ROUNDS = 6
_GROWTH = 1.5
_NEAR = 0.75  # share of the target above which the search ends


class GridSearch:
    """The search for the grid of one surface. Numbers of rings and azimuths that the layout sets are kept."""

    def __init__(
        self,
        trial: Trial,
        layout: PolarLayout,
        scene: Scene | None,
        delta_e: float,
        exposure_ru: float,
        distance: float,
    ) -> None:
        """Computes the anisotropy of the surface.

        trial: the stack of the window in the middle. layout: numbers that are set. scene: lights and views, None for
        all. delta_e: mean CIELAB error allowed. exposure_ru: exposure at which it is measured, RU.
        distance: of the innermost rings at most, in widths of the specular lobe at the shortest wavelength.
        """
        self._trial, self._layout, self._scene = trial, layout, scene
        self._delta_e, self._exposure_ru = delta_e, exposure_ru
        self._grids = Grids(trial.bake, layout, delta_e, distance)
        self._stretch, self._axis = trial.scattering.anisotropy()

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
        other_azimuths = _other(azimuths, whole_tiles(3 * azimuths // 4))
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
