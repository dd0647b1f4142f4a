"""[D14] fig. 15, [S14] fig. 2.11 and 2.12: the number of terms that the series of exp(i k w h) needs."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.diffraction import expansion
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import map_physics, maps
from pipeline.evaluation.figures.maps import NOTICEABLE, SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Column, Page, PageTable, Picture, numbers
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
_CONVERGED, _EVEN = 0.01, 1e-6
# of exp(i k w h): the share that the default table.tolerance of 1e-4 leaves to the series
_BOUND = 2e-5
_ORIGIN = (
    "A constant added to the heights changes no intensity but every term: heights from 0 to their maximum have twice "
    "the phase of heights centred at mid-range, and need about twice the terms. [S14] does not say where its heights "
    "are zero; its N for Elaphe suits centred heights, its N for all surfaces our bound for heights from 0."
)
_ORDER_ONE = (
    "At N = 1 (Born's approximation) |P|^2 is the spectrum of the heights, which is even for real heights: modes on "
    "either side are equally bright. Only the terms of order 2 and above make them differ."
)
_STATED = (
    f"Errors are mean ΔE over views that are not black at {SHOWN_RU:g} RU, of a 41 x 41 map at normal incidence, "
    f"against the exact sum at the same {STEP_NM:g} nm steps."
)


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


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: error by order of Taylor's and Chebyshev's series on three surfaces, and maps by order."""
    views = maps.views_of(bench)
    studies = [_study(surface, views, progress) for surface in (bench.blazed, bench.elaphe, bench.xenopeltis)]
    modes = _modes(studies[2], views)
    return Page(
        name="terms",
        title="Convergence in the number of terms",
        source="[D14] fig. 15, [S14] fig. 2.11 and 2.12",
        expected=f"Visual convergence from N = {_PUBLISHED_BLAZED} on a blazed grating, {_PUBLISHED_ELAPHE} on "
        f"Elaphe and {_PUBLISHED_ALL} on all surfaces ([S14], by trial). Too few terms show Xenopeltis' vertical "
        "modes above and below the centre equally bright; converged, those above are dimmer ([D14]).",
        checks=[*_published(studies), *_orders(studies), *_asymmetry(modes)],
        tables=[_orders_table(studies), _table(studies), _modes_table(modes)],
        pictures=_pictures(views, studies),
        remarks=[_ORIGIN, _ORDER_ONE, _STATED],
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


def _published(studies: Sequence[_Study]) -> list[Check]:
    checks = []
    for key, study, order in zip(("blazed", "elaphe"), studies, _PUBLISHED, strict=False):
        name, at = study.surface.name, f"mean ΔE at {SHOWN_RU:g} RU with N = {order}"
        centred, raised = (study.errors[series][order][0] for series in (_CENTRED, _RAISED))
        enough = study.enough(_CENTRED, 0)
        checks += [
            Check(f"{key}.centred", f"{name}, centred heights: {at}", centred),
            Check(f"{key}.raised", f"{name}, heights from 0: {at}", raised),
            Check(f"{key}.enough", f"{name}, centred heights: smallest N with mean ΔE below 1", enough, "=", order),
        ]
    worst = max(study.errors[_RAISED][_PUBLISHED_ALL][1] for study in studies)
    what = f"all surfaces, heights from 0: mean ΔE at {STRICT_RU:g} RU with N = {_PUBLISHED_ALL}, at most"
    return [*checks, Check("all.raised", what, worst, "<", NOTICEABLE)]


def _orders(studies: Sequence[_Study]) -> list[Check]:
    """The order that our bound chooses, and the orders that the series need at the higher exposure."""
    left = max(study.left_by_bound for study in studies)
    needed = [[study.enough(name, 1) for name in _SERIES] for study in studies]
    # orders that were not reached are infinite, and their ratio, NaN, passes no bound
    above = np.max([chebyshev / centred for centred, _, chebyshev in needed])
    centring = np.max([centred / raised for centred, raised, _ in needed])
    at = f"mean ΔE at {STRICT_RU:g} RU"
    return [
        Check("all.bound", f"all surfaces, N of this project's bound: {at}, at most", left, "<", _CONVERGED),
        Check("all.chebyshev", "smallest N of Chebyshev's series over Taylor's, at most", above, "<=", 1.0),
        Check("all.centring", "smallest N of centred heights over heights from 0, at most", centring, "<", 1.0),
    ]


def _modes(xenopeltis: _Study, views: Map) -> dict[int, float]:
    """Luminance of the first vertical mode below the centre over that above, by N."""
    return {
        n: map_physics.below_over_above(xyz[:, 1], views, maps.NORMAL, maps.XENOPELTIS_RHO)
        for n, xyz in sorted(xenopeltis.maps.items())
    }


def _asymmetry(modes: dict[int, float]) -> list[Check]:
    first, *_, converged = modes.values()
    mode = "Xenopeltis: first vertical mode below the centre over above"
    return [
        Check("modes.first", f"{mode}, N = 1: distance from 1", abs(first - 1.0), "<", _EVEN, source="Born"),
        Check("modes.converged", f"{mode}, N = {max(modes)}", converged, ">", 1.0),
    ]


def _orders_table(studies: Sequence[_Study]) -> PageTable:
    return PageTable(
        "orders",
        f"N of this project's bound, and the smallest N tried with mean ΔE below 1 at {STRICT_RU:g} RU",
        [Column("surface"), *numbers("{:g}", "bound, centred", "bound, 0 to max", *_SERIES)],
        [
            (study.surface.name, study.bound, study.bound_raised, *(study.enough(name, 1) for name in _SERIES))
            for study in studies
        ],
    )


def _table(studies: Sequence[_Study]) -> PageTable:
    both = [(study, name, i) for study in studies for name in _SERIES for i in (0, 1)]
    headings = (f"{study.surface.name}: {name}, {maps.EXPOSURES_RU[i]:g} RU" for study, name, i in both)
    return PageTable(
        "errors",
        "Mean ΔE of lit views by order",
        [Column("N"), *numbers("{:.2g}", *headings)],
        [
            (n, *(study.errors[name][n][i] if n in study.errors[name] else None for study, name, i in both))
            for n in sorted({*_ORDERS, *_RAISED_ORDERS})
        ],
    )


def _modes_table(modes: dict[int, float]) -> PageTable:
    caption = "Xenopeltis: luminance of the first vertical mode below the centre over above"
    return PageTable("modes", caption, [Column("N"), Column("ratio", "{:.3f}")], list(modes.items()))


def _pictures(views: Map, studies: Sequence[_Study]) -> list[Picture]:
    rows = [
        [maps.panel(views, xyz, f"N = {n}", "converged" if n == study.bound else "") for n, xyz in study.maps.items()]
        for study in studies
    ]
    drawn = [
        Chart(
            study.surface.name,
            "order N",
            f"mean ΔE of lit views at {STRICT_RU:g} RU",
            [
                Series(name, list(found), [error[1] for error in found.values()], colour)
                for (name, found), colour in zip(study.errors.items(), COLOURS, strict=False)
            ],
            marks=[(study.bound, f"bound {study.bound}")],
            level=(NOTICEABLE, "noticeable"),
        )
        for study in studies
    ]
    names = [study.surface.name for study in studies]
    return [
        Picture(maps.sheet(rows, "Taylor series cut after N, centred heights", names), "Maps by order."),
        Picture(charts([drawn]), "Error by order of the series, and the order that the bound chooses."),
    ]
