"""[D14] fig. 14: linear (a = 1) against non-linear (a = 5) grids of (u, v) at equal samples, on Elaphe."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Page, PageText, Picture
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.methods.paper_shaders import PUBLISHED_POWER, PUBLISHED_RESOLUTION, taylor_stack
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics.colour import delta_e, displayed_srgb
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map, table_evaluator
from pipeline.tables.taylor import table as taylor

_LINEAR, _BETWEEN = 1.0, 2.0
_POWERS = (_LINEAR, _BETWEEN, PUBLISHED_POWER)
_FIGURE_NODES, _QUICK_NODES = 101, 201
# of sin theta of the view
_RINGS = tuple(pairwise((0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.98)))
# Y of linear sRGB's red, green and blue (IEC 61966-2-1)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class _Grid:
    """One table's map: XYZ in RU (views, 3), its CIELAB error at each view at 7500 RU, and the mean at 1500 RU.

    detail: correlation with the exact map of the steps between neighbouring pixels.
    """

    xyz: Array
    error: Array
    shown_error: float
    detail: float

    @property
    def mean(self) -> float:
        return float(self.error.mean())

    @property
    def numbers(self) -> tuple[float, ...]:
        """Those of the page's table."""
        return self.shown_error, self.mean, float(np.percentile(self.error, 99)), self.detail


# by nodes along an axis and exponent a
_Grids = dict[tuple[int, float], _Grid]


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: errors of grids at two resolutions, over the map and by distance from the mirror direction."""
    views, surface = maps.views_of(bench), bench.elaphe
    sizes = (_FIGURE_NODES, _QUICK_NODES if bench.quick else PUBLISHED_RESOLUTION)
    exact = maps.exact_maps(surface, views, [maps.NORMAL], progress)[0] / surface.unit
    found = _measure(surface, views, exact, sizes, progress)
    text = PageText("grids", shown=SHOWN_RU, strict=STRICT_RU)
    worse = (text.remark("worse", nodes=nodes, where=_where_worse(views, found, nodes)) for nodes in sizes)
    return text.page(
        checks=_checks(text, found, sizes),
        tables=[text.table("grids", [(*grid, *of.numbers) for grid, of in found.items()])],
        pictures=_pictures(text, views, exact, found, sizes),
        remarks=[text.remark("whole"), *worse, text.remark("why")],
    )


def _measure(surface: BenchSurface, views: Map, exact: Array, sizes: Sequence[int], progress: Progress) -> _Grids:
    radiometry = surface.config.radiometry
    rule = radiometry.integrand(PUBLISHED_STEP_NM)
    built = taylor_stack(surface.field, surface.config)
    wi, wr = maps.directions(views, maps.NORMAL)
    fine, found = _steps(views, exact), {}
    for nodes in sizes:
        for power in _POWERS:
            table = taylor.build(built, rule, nodes, power, progress=progress)
            xyz = table_evaluator(table, radiometry)(wi, wr) / radiometry.unit
            shown = float(np.mean(delta_e(xyz, exact, SHOWN_RU)))
            detail = float(np.corrcoef(_steps(views, xyz), fine)[0, 1])
            found[nodes, power] = _Grid(xyz, delta_e(xyz, exact, STRICT_RU), shown, detail)
    return found


def _steps(views: Map, xyz: Array) -> Array:
    """Steps of displayed lightness (cube root of luminance) between neighbours of a map's rows, at 1500 RU."""
    lightness = np.cbrt(displayed_srgb(xyz, SHOWN_RU) @ _LUMINANCE)
    image, inside = views.image(lightness), views.inside
    both = inside[:, 1:] & inside[:, :-1]
    return np.asarray((image[:, 1:] - image[:, :-1])[both])


def _checks(text: PageText, found: _Grids, sizes: Sequence[int]) -> Iterator[Check]:
    for nodes in sizes:
        linear, published = (found[nodes, power] for power in (_LINEAR, PUBLISHED_POWER))
        yield text.check("error.{nodes}", published.mean, bound=linear.mean, nodes=nodes)
    linear, published = (found[_FIGURE_NODES, power] for power in (_LINEAR, PUBLISHED_POWER))
    yield text.check("detail.{nodes}", linear.detail, bound=published.detail, nodes=_FIGURE_NODES)
    best = min(_POWERS, key=lambda power: found[sizes[1], power].mean)
    yield text.check("exponent.{nodes}", best, bound=PUBLISHED_POWER, nodes=sizes[1])


def _where_worse(views: Map, found: _Grids, nodes: int) -> str:
    linear, published = (_by_ring(views, found[nodes, a].error) for a in (_LINEAR, PUBLISHED_POWER))
    worse = [f"{low:g} to {high:g}" for i, (low, high) in enumerate(_RINGS) if published[i] >= linear[i]]
    return f"but for sin theta of {', '.join(worse)}" if worse else "at every distance from the mirror direction"


def _by_ring(views: Map, error: Array) -> list[float]:
    """Mean error by sin theta of the view."""
    wr = views.views()
    distance = np.hypot(wr[:, 0], wr[:, 1])
    return [float(error[(distance >= low) & (distance < high)].mean()) for low, high in _RINGS]


def _pictures(text: PageText, views: Map, exact: Array, found: _Grids, sizes: Sequence[int]) -> list[Picture]:
    row = [maps.panel(views, exact, "exact")]
    for (nodes, power), grid in found.items():
        if power != _BETWEEN:
            note = f"mean ΔE {grid.shown_error:.1f} at {SHOWN_RU:g} RU"
            row.append(maps.panel(views, grid.xyz, f"{nodes} × {nodes}, a = {power:g}", note))
    middle = [0.5 * (low + high) for low, high in _RINGS]

    def chart(nodes: int) -> Chart:
        errors = {a: _by_ring(views, found[nodes, a].error) for a in _POWERS}
        curves = zip(errors.items(), COLOURS, strict=False)
        series = [Series(f"a = {a:g}", middle, error, colour) for (a, error), colour in curves]
        return text.chart("rings", series, nodes=nodes)

    return [
        text.picture("maps", maps.sheet([row], "Elaphe, normal incidence")),
        text.picture("curves", charts([[chart(nodes) for nodes in sizes]])),
    ]
