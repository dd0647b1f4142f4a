"""[D14] fig. 15, [S14] fig. 2.11 and 2.12: the number of terms that the series of exp(i k w h) needs.

Taylor's series about two origins and Chebyshev's are summed at the views themselves, at the same wavelengths, so what
differs is the order alone. Light falls at normal incidence: of the frequencies no more than 1 / lambda is kept.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np
from scipy.special import comb

from kernels import windowed_dft
from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.dft_stack import Basis, Stack
from pipeline.diffraction.reference import integrate
from pipeline.diffraction.upload import upload
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import NOTICEABLE, SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageTable, PageText, Picture, numbers
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics import brdf, geometry
from pipeline.optics.colour import delta_e
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map
from pipeline.tables.taylor import table as taylor

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
# of the window's transform: far below what any order here leaves
_WINDOW_CUT = 1e-5


@dataclass(frozen=True)
class TaylorSeries:
    """sum_(n <= N) (i k w h)^n / n! ([D14] eq. 6), heights from -H to H as the stack has them."""

    surface: BenchSurface
    stack: Stack

    @classmethod
    def centred(cls, surface: BenchSurface, order: int) -> "TaylorSeries":
        """About the heights' mid-range, as this project has them, up to an order."""
        return cls(surface, _stack(surface, "taylor", order))

    def raised(self) -> "TaylorSeries":
        """The same about the lowest height, heights from 0 to 2 H as scans come: twice the phase at the top.

        ((h + H) / 2H)^n = 2^-n sum_j C(n, j) t^j, so every transform is a mean of those about mid-range.
        """
        n = np.arange(self.stack.terms)
        mixing = comb(n[:, None], n) / 2.0 ** n[:, None]
        coefficients = np.ascontiguousarray(self.stack.coefficients @ mixing.T)
        half_range = 2.0 * self.stack.half_range_um
        return replace(self, stack=replace(self.stack, coefficients=coefficients, half_range_um=half_range))

    def xyz(self, order: int, wi: Array, wr: Array) -> Array:
        """XYZ (directions, 3) of the terms up to `order`."""
        config = self.surface.config
        summed = taylor.at_directions(
            _cut(self.stack, order), config.radiometry.integrand(PUBLISHED_STEP_NM), geometry.uvw(wi, wr)
        )
        factor = brdf.direction_factor(config.material, trapezoid(config.light, PUBLISHED_STEP_NM), wi, wr)
        return np.asarray(factor[:, None] * summed)


@dataclass(frozen=True)
class ChebyshevSeries:
    """sum_(n <= N) (2 - [n = 0]) i^n J_n(k w H) T_n(h / H)."""

    surface: BenchSurface
    order: int

    @cached_property
    def _stack(self) -> Stack:
        return _stack(self.surface, "chebyshev", self.order)

    def xyz(self, order: int, wi: Array, wr: Array) -> Array:
        """XYZ (directions, 3) of the terms up to `order`."""
        config, rule = self.surface.config, trapezoid(self.surface.config.light, PUBLISHED_STEP_NM)
        terms = upload(_cut(self._stack, order))
        power = windowed_dft.exact_power(terms, geometry.uvw(wi, wr), 1e-3 * rule.lambda_nm)
        return integrate(power, rule, config.material, config.coherence.sigma_um, wi, wr)


def _stack(surface: BenchSurface, basis: Basis, order: int) -> Stack:
    config = surface.config
    reachable = 1e3 / config.light.lambda_min_nm
    return dft_stack.build(surface.field, basis, order + 1, config.coherence.sigma_um, reachable, _WINDOW_CUT)


def _cut(whole: Stack, order: int) -> Stack:
    """The same without the terms above `order`; they stay as zeros, so that one kernel serves every order."""
    coefficients = whole.coefficients.copy()
    coefficients[..., order + 1 :] = 0.0
    return replace(whole, coefficients=coefficients)


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
        n: maps.below_over_above(xyz[:, 1], views, maps.NORMAL, maps.XENOPELTIS_RHO)
        for n, xyz in sorted(studies[2].maps.items())
    }
    published = {"blazed": _PUBLISHED_BLAZED, "elaphe": _PUBLISHED_ELAPHE, "all": _PUBLISHED_ALL}
    text = PageText("terms", shown=SHOWN_RU, strict=STRICT_RU, step_nm=PUBLISHED_STEP_NM, **published)
    return text.page(
        checks=_checks(text, studies, modes),
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
    truth = exact.xyz(config.light, config.material, wi, wr, PUBLISHED_STEP_NM) / surface.unit
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


def _checks(text: PageText, studies: Sequence[_Study], modes: dict[int, float]) -> Iterator[Check]:
    for key, study, order in zip(("blazed", "elaphe"), studies, _PUBLISHED, strict=False):
        known = {"key": key, "surface": study.surface.name, "n": order}
        centred, raised = (study.errors[series][order][0] for series in (_CENTRED, _RAISED))
        yield text.check("{key}.centred", centred, **known)
        yield text.check("{key}.raised", raised, **known)
        yield text.check("{key}.enough", study.enough(_CENTRED, 0), bound=order, **known)
    worst = max(study.errors[_RAISED][_PUBLISHED_ALL][1] for study in studies)
    yield text.check("all.raised", worst, bound=NOTICEABLE)
    needed = [[study.enough(name, 1) for name in _SERIES] for study in studies]
    # orders that were not reached are infinite, and their ratio, NaN, passes no bound
    yield text.check("all.bound", max(study.left_by_bound for study in studies))
    yield text.check("all.chebyshev", np.max([chebyshev / centred for centred, _, chebyshev in needed]))
    yield text.check("all.centring", np.max([centred / raised for centred, raised, _ in needed]))
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
