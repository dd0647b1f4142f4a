"""[D14] fig. 15, [S14] fig. 2.11 and 2.12: the number of terms that the series of exp(i k w h) needs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.diffraction import expansion
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import map_physics, maps
from pipeline.evaluation.figures.maps import NOTICEABLE, SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageTable, PageText, Picture, numbers
from pipeline.evaluation.figures.truncated_series import STEP_NM, ChebyshevSeries, TaylorSeries
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics.colour import delta_e
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_CENTRED, _RAISED, _CHEBYSHEV = _SERIES = "Taylor, centred", "Taylor, 0 to max", "Chebyshev"
# [S14] 2.1: N that it found enough for the blazed grating, for Elaphe, and for all its surfaces
_PUBLISHED_BLAZED, _PUBLISHED_ELAPHE = _PUBLISHED = 7, 9
_PUBLISHED_ALL = 39
_ORDERS = tuple(range(1, 24, 2))
_RAISED_ORDERS = (1, 3, 5, 7, 9, 13, 17, 21, 25, 29, 33, _PUBLISHED_ALL)
_SHOWN_ORDERS = (1, 3, 5, 7, 9)
# curves need no pictures' resolution
_CURVE_VIEWS = Map(41, MAP_RADIUS)
# of exp(i k w h): the share that the default table.tolerance of 1e-4 leaves to the series
_BOUND = 2e-5


@dataclass(frozen=True)
class _Study:
    """One surface: mean dE over lit views by series and order at 1500 and 7500 RU, and maps in RU by order.

    bound: N that keeps exp(i k w h) by Lagrange's remainder, centred. bound_raised: the same of heights from 0 up.
    """

    surface: BenchSurface
    errors: dict[str, dict[int, tuple[float, float]]]
    maps: dict[int, Array]
    bound: int
    bound_raised: int

    def enough(self, name: str, exposure: int) -> float:
        """Return the smallest order tried whose mean dE is not noticeable at exposure 0 (1500 RU) or 1 (7500 RU)."""
        return min((n for n, error in self.errors[name].items() if error[exposure] < NOTICEABLE), default=inf)

    @property
    def left_by_bound(self) -> float:
        """Mean dE at 7500 RU of the first order tried at or above the bound."""
        tried = self.errors[_CENTRED]
        return next(error[1] for n, error in tried.items() if n >= min(self.bound, _ORDERS[-1]))

    def orders(self) -> tuple[Cell, ...]:
        """Return its row of the page's table of orders."""
        return self.surface.name, self.bound, self.bound_raised, *(self.enough(name, 1) for name in _SERIES)


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: error by order of Taylor's and Chebyshev's series on three surfaces, and maps by order."""
    views = maps.views_of(bench)
    studies = [_study(surface, views, progress) for surface in (bench.blazed, bench.elaphe, bench.xenopeltis)]
    # luminance of Xenopeltis' first vertical mode below the centre over that above, by N
    modes = {
        n: map_physics.below_over_above(xyz[:, 1], views, maps.NORMAL, maps.XENOPELTIS_RHO)
        for n, xyz in sorted(studies[2].maps.items())
    }
    published = {"blazed": _PUBLISHED_BLAZED, "elaphe": _PUBLISHED_ELAPHE, "all": _PUBLISHED_ALL}
    text = PageText("terms", shown=SHOWN_RU, strict=STRICT_RU, step_nm=STEP_NM, **published)
    return text.page(
        checks=[*_published(text, studies), *_orders(text, studies), *_asymmetry(text, modes)],
        tables=[
            text.table("orders", map(_Study.orders, studies), numbers("{:g}", *_SERIES)),
            _errors_table(text, studies),
            text.table("modes", modes.items()),
        ],
        pictures=_pictures(text, views, studies),
    )


def _study(surface: BenchSurface, views: Map, progress: Progress) -> _Study:
    config, exact = surface.config, surface.reference(progress)
    wi, wr = maps.directions(_CURVE_VIEWS, maps.NORMAL)
    truth = exact.xyz(config.light, config.material, wi, wr, STEP_NM) / surface.unit
    lit = maps.lit_views(truth)

    def errors(found: Array) -> tuple[float, float]:
        shown, strict = (delta_e(found[lit] / surface.unit, truth[lit], ru) for ru in maps.EXPOSURES_RU)
        return float(shown.mean()), float(strict.mean())

    z = expansion.largest_phase(surface.field.half_range_um, config.light.lambda_min_nm)
    bound, bound_raised = (expansion.taylor_order(phase, _BOUND) for phase in (z, 2.0 * z))
    centred = TaylorSeries.centred(surface, max(_ORDERS[-1], bound))
    raised = TaylorSeries.centred(surface, _PUBLISHED_ALL).raised()
    chebyshev = ChebyshevSeries(surface, _ORDERS[-1])
    found = {
        _CENTRED: {n: errors(centred.xyz(n, wi, wr)) for n in _ORDERS},
        _RAISED: {n: errors(raised.xyz(n, wi, wr)) for n in _RAISED_ORDERS},
        _CHEBYSHEV: {n: errors(chebyshev.xyz(n, wi, wr)) for n in _ORDERS},
    }
    pairs = maps.directions(views, maps.NORMAL)
    shown = {n: centred.xyz(n, *pairs) / surface.unit for n in (*_SHOWN_ORDERS, bound)}
    return _Study(surface, found, shown, bound, bound_raised)


def _published(text: PageText, studies: Sequence[_Study]) -> Iterator[Check]:
    for key, study, order in zip(("blazed", "elaphe"), studies, _PUBLISHED, strict=False):
        known = {"key": key, "surface": study.surface.name, "n": order}
        centred, raised = (study.errors[series][order][0] for series in (_CENTRED, _RAISED))
        yield text.check("{key}.centred", centred, **known)
        yield text.check("{key}.raised", raised, **known)
        yield text.check("{key}.enough", study.enough(_CENTRED, 0), bound=order, **known)
    worst = max(study.errors[_RAISED][_PUBLISHED_ALL][1] for study in studies)
    yield text.check("all.raised", worst, bound=NOTICEABLE)


def _orders(text: PageText, studies: Sequence[_Study]) -> Iterator[Check]:
    """The order that our bound chooses, and the orders that the series need at the higher exposure."""
    needed = [[study.enough(name, 1) for name in _SERIES] for study in studies]
    # orders that were not reached are infinite, and their ratio, NaN, passes no bound
    yield text.check("all.bound", max(study.left_by_bound for study in studies))
    yield text.check("all.chebyshev", np.max([chebyshev / centred for centred, _, chebyshev in needed]))
    yield text.check("all.centring", np.max([centred / raised for centred, raised, _ in needed]))


def _asymmetry(text: PageText, modes: dict[int, float]) -> Iterator[Check]:
    first, *_, converged = modes.values()
    yield text.check("modes.first", abs(first - 1.0))
    yield text.check("modes.converged", converged, n=max(modes))


def _errors_table(text: PageText, studies: Sequence[_Study]) -> PageTable:
    both = [(study, name, i) for study in studies for name in _SERIES for i in (0, 1)]
    headings = (f"{study.surface.name}: {name}, {maps.EXPOSURES_RU[i]:g} RU" for study, name, i in both)
    tried = sorted({*_ORDERS, *_RAISED_ORDERS})
    rows = [(n, *(s.errors[name][n][i] if n in s.errors[name] else None for s, name, i in both)) for n in tried]
    return text.table("errors", rows, numbers("{:.2g}", *headings))


def _pictures(text: PageText, views: Map, studies: Sequence[_Study]) -> list[Picture]:
    def chart(study: _Study) -> Chart:
        curves = zip(study.errors.items(), COLOURS, strict=False)
        series = [
            Series(name, list(found), [error[1] for error in found.values()], colour)
            for (name, found), colour in curves
        ]
        marks, level = [(study.bound, f"bound {study.bound}")], (NOTICEABLE, "noticeable")
        return text.chart("orders", series, surface=study.surface.name, marks=marks, level=level)

    rows = [
        [maps.panel(views, xyz, f"N = {n}", "converged" if n == study.bound else "") for n, xyz in study.maps.items()]
        for study in studies
    ]
    names = [study.surface.name for study in studies]
    return [
        text.picture("maps", maps.sheet(rows, "Taylor series cut after N, centred heights", names)),
        text.picture("curves", charts([[chart(study) for study in studies]])),
    ]
