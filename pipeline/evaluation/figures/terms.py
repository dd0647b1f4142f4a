"""[D14] fig. 15, [S14] fig. 2.11 and 2.12: how many terms the series of exp(i k w h) needs."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.diffraction import expansion
from pipeline.evaluation.figures import map_physics
from pipeline.evaluation.figures.exact_maps import (
    NORMAL,
    SHOWN_RU,
    STRICT_RU,
    directions,
    lit_views,
    reference,
    views_of,
)
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.figures.truncated_series import STEP_NM, ChebyshevSeries, TaylorSeries
from pipeline.optics.colour import delta_e, pixels
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_CENTRED, _RAISED, _CHEBYSHEV = "Taylor, centred", "Taylor, 0 to max", "Chebyshev"
# [S14] 2.1: N that it found enough for the blazed grating, for Elaphe, and for all its surfaces
_PUBLISHED_BLAZED, _PUBLISHED_ELAPHE, _PUBLISHED_ALL = 7, 9, 39
_ORDERS = tuple(range(1, 24, 2))
_RAISED_ORDERS = (1, 3, 5, 7, 9, 13, 17, 21, 25, 29, 33, _PUBLISHED_ALL)
_SHOWN_ORDERS = (1, 3, 5, 7, 9)
# curves need no pictures' resolution
_CURVE_VIEWS = Map(41, MAP_RADIUS)
_NOTICEABLE, _CONVERGED = 1.0, 0.01
# of exp(i k w h): the share that the default table.tolerance of 1e-4 leaves to the series
_BOUND = 2e-5
# (u, v) of Xenopeltis' first order along its fingers, 1.5 um apart, in visible light
_ALONG_RHO = (0.25, 0.5)
_EXPECTED = (
    f"Visual convergence from N = {_PUBLISHED_BLAZED} on a blazed grating, {_PUBLISHED_ELAPHE} on Elaphe and "
    f"{_PUBLISHED_ALL} on all surfaces ([S14], by trial). Too few terms show Xenopeltis' vertical modes above and "
    "below the centre equally bright; converged, those above are dimmer ([D14])."
)
_ORIGIN = (
    "A constant added to the heights changes no intensity but every term: heights from 0 to their maximum have twice "
    "the phase of heights centred at mid-range, and need about twice the terms. [S14] does not say where its heights "
    "are zero; its N for Elaphe suits centred heights, its N for all surfaces our bound for heights from 0."
)
_ORDER_ONE = (
    "At N = 1 (Born's approximation) |P|^2 is the spectrum of the heights, which is even for real heights: modes on "
    "either side are equally bright. What parts them are the terms of order 2 and above, against those below."
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

    surface: Surface
    errors: dict[str, dict[int, tuple[float, float]]]
    maps: dict[int, Array]
    bound: int
    bound_raised: int

    def enough(self, name: str, exposure: int) -> float:
        """The smallest order tried whose mean dE is below a noticeable one at exposure 0 (1500 RU) or 1 (7500 RU)."""
        return min((n for n, error in self.errors[name].items() if error[exposure] < _NOTICEABLE), default=inf)


def make(bench: Bench, progress: Progress) -> Figure:
    """The page: error by order of Taylor's and Chebyshev's series on three surfaces, and maps by order."""
    views = views_of(bench)
    studies = [_study(surface, views, progress) for surface in (bench.blazed, bench.elaphe, bench.xenopeltis)]
    modes = _modes(studies[2], views)
    return Figure(
        name="terms",
        title="Convergence in the number of terms",
        source="[D14] fig. 15, [S14] fig. 2.11 and 2.12",
        expected=_EXPECTED,
        checks=[
            *_published(studies),
            _bounds(studies),
            _fewer(studies),
            *_asymmetry(modes),
        ],
        tables=[_table(studies), _modes_table(modes)],
        pictures=_pictures(views, studies),
        remarks=[_ORIGIN, _ORDER_ONE, _STATED],
        numbers={
            study.surface.name: {name: {str(n): e for n, e in found.items()} for name, found in study.errors.items()}
            for study in studies
        },
    )


def _study(surface: Surface, views: Map, progress: Progress) -> _Study:
    config, exact = surface.config, reference(surface, progress)
    unit = config.radiometry.unit
    wi, wr = directions(_CURVE_VIEWS, NORMAL)
    truth = exact.xyz(config.light, config.material, wi, wr, STEP_NM) / unit
    lit = lit_views(truth)

    def errors(found: Array) -> tuple[float, float]:
        shown, strict = (delta_e(found[lit] / unit, truth[lit], ru) for ru in (SHOWN_RU, STRICT_RU))
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
    pairs = directions(views, NORMAL)
    maps = {n: centred.xyz(n, *pairs) / unit for n in (*_SHOWN_ORDERS, bound)}
    return _Study(surface, found, maps, bound, bound_raised)


def _published(studies: Sequence[_Study]) -> list[Check]:
    checks = []
    for study, order in zip(studies, (_PUBLISHED_BLAZED, _PUBLISHED_ELAPHE), strict=False):
        centred, raised = (study.errors[name][order][0] for name in (_CENTRED, _RAISED))
        enough = study.enough(_CENTRED, 0)
        checks.append(
            Check(
                f"{study.surface.name}: mean ΔE of lit views at {SHOWN_RU:g} RU with N = {order}",
                f"visually converged at N = {order}",
                f"{centred:.2f} centred (below 1 from N = {enough:g}), {raised:.3g} with heights from 0",
                None,
            )
        )
    worst = max(study.errors[_RAISED][_PUBLISHED_ALL][1] for study in studies)
    checks.append(
        Check(
            f"all surfaces, heights from 0: mean ΔE of lit views at {STRICT_RU:g} RU with N = {_PUBLISHED_ALL}",
            "visually converged: below 1",
            f"at most {worst:.2g}; our bound asks for N = "
            + ", ".join(f"{study.bound_raised} ({study.surface.name})" for study in studies),
            worst < _NOTICEABLE,
        )
    )
    return checks


def _bounds(studies: Sequence[_Study]) -> Check:
    """At the first order tried at or above the bound, nothing must be left to see."""
    left = {
        study.surface.name: next(
            e[1] for n, e in study.errors[_CENTRED].items() if n >= min(study.bound, _ORDERS[-1])
        )
        for study in studies
    }
    chosen = ", ".join(f"{study.surface.name} N = {study.bound}" for study in studies)
    return Check(
        f"the N that this project's bound chooses: mean ΔE of lit views at {STRICT_RU:g} RU",
        f"below {_CONVERGED:g}",
        f"{chosen}: at most {max(left.values()):.1g}",
        max(left.values()) < _CONVERGED,
    )


def _fewer(studies: Sequence[_Study]) -> Check:
    orders = [[study.enough(name, 1) for name in (_CHEBYSHEV, _CENTRED, _RAISED)] for study in studies]
    told = [
        f"{study.surface.name} {chebyshev:g} / {centred:g} / {raised:g}"
        for study, (chebyshev, centred, raised) in zip(studies, orders, strict=True)
    ]
    return Check(
        f"smallest N tried with mean ΔE below 1 at {STRICT_RU:g} RU: Chebyshev / Taylor centred / Taylor from 0",
        "ascending",
        "; ".join(told),
        all(chebyshev <= centred < raised for chebyshev, centred, raised in orders),
    )


def _modes(xenopeltis: _Study, views: Map) -> dict[int, float]:
    """Luminance of the first vertical mode below the centre over that above, by N."""
    return {
        n: map_physics.below_over_above(xyz[:, 1], views, NORMAL, _ALONG_RHO) for n, xyz in xenopeltis.maps.items()
    }


def _asymmetry(modes: dict[int, float]) -> list[Check]:
    orders = sorted(modes)
    first, converged = modes[orders[0]], modes[orders[-1]]
    return [
        Check(
            "Xenopeltis at N = 1: first vertical mode below the centre over that above",
            "1: the height's spectrum is even",
            f"{first:.8f}",
            abs(first - 1.0) < 1e-6,
        ),
        Check(
            f"Xenopeltis converged, N = {orders[-1]}: below over above",
            "above 1: dimmer above the centre",
            f"{converged:.2f}",
            converged > 1.0,
        ),
    ]


def _table(studies: Sequence[_Study]) -> Table:
    names = (_CENTRED, _RAISED, _CHEBYSHEV)
    orders = sorted({*_ORDERS, *_RAISED_ORDERS})
    rows = [
        [
            str(n),
            *(
                f"{study.errors[name][n][1]:.2g}" if n in study.errors[name] else ""
                for study in studies
                for name in names
            ),
        ]
        for n in orders
    ]
    columns = ["N", *(f"{study.surface.name}: {name}" for study in studies for name in names)]
    return Table(f"Mean ΔE of lit views at {STRICT_RU:g} RU by order", columns, rows)


def _modes_table(modes: dict[int, float]) -> Table:
    rows = [[str(n), f"{modes[n]:.3f}"] for n in sorted(modes)]
    return Table("Xenopeltis: luminance of the first vertical mode below the centre over above", ["N", "ratio"], rows)


def _pictures(views: Map, studies: Sequence[_Study]) -> list[Picture]:
    from pipeline.evaluation.plots import map_plots

    rows = [
        [
            map_plots.Panel(pixels(views.image(xyz), SHOWN_RU), f"N = {n}", "converged" if n == study.bound else "")
            for n, xyz in study.maps.items()
        ]
        for study in studies
    ]
    names = [study.surface.name for study in studies]
    sheet = map_plots.sheet(rows, f"Taylor series cut after N, centred heights, {SHOWN_RU:g} RU", names)
    charts = [
        map_plots.Chart(
            study.surface.name,
            "order N",
            f"mean ΔE of lit views at {STRICT_RU:g} RU",
            [
                map_plots.Line(name, list(found), [error[1] for error in found.values()], colour)
                for (name, found), colour in zip(study.errors.items(), map_plots.COLOURS, strict=False)
            ],
            marks=[(study.bound, f"bound {study.bound}")],
            level=(_NOTICEABLE, "noticeable"),
        )
        for study in studies
    ]
    return [
        Picture(sheet, "Maps by order."),
        Picture(map_plots.charts(charts), "Error by order of the series, and the order that the bound chooses."),
    ]
