"""[D14] fig. 14: linear (a = 1) against non-linear (a = 5) grids of (u, v) at equal samples, on Elaphe."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Column, Page, PageTable, Picture
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.methods.paper_look_up import PUBLISHED_POWER, PUBLISHED_RESOLUTION
from pipeline.evaluation.methods.paper_reference import TOLERANCE, taylor_stack
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
_WHOLE = (
    "Errors are of the paper's whole table, with its 5 nm steps, float32 and bilinear look-up, against the exact "
    "integral at 1 nm. The detail kept is the correlation of the steps of lightness between neighbouring pixels with "
    "those of the exact map."
)
_WHY = (
    "Nodes 2 |t|^a crowd near the mirror direction, where the map has its finest colours; towards the rim they are "
    "spaced a times wider than even ones. For a whole map the best exponent lies between: at a = 2."
)


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


# by nodes along an axis and exponent a
_Grids = dict[tuple[int, float], _Grid]


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: errors of grids at two resolutions, over the map and by distance from the mirror direction."""
    views, surface = maps.views_of(bench), bench.elaphe
    sizes = (_FIGURE_NODES, _QUICK_NODES if bench.quick else PUBLISHED_RESOLUTION)
    exact = maps.exact_maps(surface, views, [maps.NORMAL], progress)[0] / surface.unit
    found = _measure(surface, views, exact, sizes, progress)
    return Page(
        name="grids",
        title="Linear against non-linear grid of (u, v)",
        source="[D14] fig. 14",
        expected="At equal samples the non-linear grid (a = 5) outperforms the linear one (a = 1), which smooths the "
        "map; [D14] shows 101 x 101 nodes and sets a = 5 by experience.",
        checks=_checks(found, sizes),
        tables=[_table(found)],
        pictures=_pictures(views, exact, found, sizes),
        remarks=[_WHOLE, *(_where_worse(views, found, nodes) for nodes in sizes), _WHY],
    )


def _measure(surface: BenchSurface, views: Map, exact: Array, sizes: Sequence[int], progress: Progress) -> _Grids:
    radiometry = surface.config.radiometry
    rule = radiometry.integrand(PUBLISHED_STEP_NM)
    built = taylor_stack(surface.field, surface.config, TOLERANCE)
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


def _checks(found: _Grids, sizes: Sequence[int]) -> list[Check]:
    fine = sizes[1]
    best = min(_POWERS, key=lambda power: found[fine, power].mean)
    linear, published = (found[_FIGURE_NODES, power] for power in (_LINEAR, PUBLISHED_POWER))
    return [
        *(
            Check(
                f"error.{nodes}",
                f"{nodes} x {nodes} nodes: mean ΔE at {STRICT_RU:g} RU with a = 5, against that with a = 1",
                found[nodes, PUBLISHED_POWER].mean,
                "<",
                found[nodes, _LINEAR].mean,
            )
            for nodes in sizes
        ),
        Check(
            f"detail.{_FIGURE_NODES}",
            f"{_FIGURE_NODES} x {_FIGURE_NODES} nodes: detail kept with a = 1, against that with a = 5",
            linear.detail,
            "<",
            published.detail,
        ),
        Check(f"exponent.{fine}", f"{fine} x {fine} nodes: exponent a of least error", best, "=", PUBLISHED_POWER),
    ]


def _where_worse(views: Map, found: _Grids, nodes: int) -> str:
    linear, published = (_by_ring(views, found[nodes, a].error) for a in (_LINEAR, PUBLISHED_POWER))
    worse = [f"{low:g} to {high:g}" for i, (low, high) in enumerate(_RINGS) if published[i] >= linear[i]]
    where = f"but for sin theta of {', '.join(worse)}" if worse else "at every distance from the mirror direction"
    return f"At {nodes} nodes a = 5 beats a = 1 {where}."


def _by_ring(views: Map, error: Array) -> list[float]:
    """Mean error by sin theta of the view."""
    wr = views.views()
    distance = np.hypot(wr[:, 0], wr[:, 1])
    return [float(error[(distance >= low) & (distance < high)].mean()) for low, high in _RINGS]


def _table(found: _Grids) -> PageTable:
    return PageTable(
        "grids",
        "The paper's table on Elaphe by grid, against the exact map",
        [
            Column("nodes along an axis", "{:g}"),
            Column("a", "{:g}"),
            Column(f"mean ΔE, {SHOWN_RU:g} RU", "{:.2f}"),
            Column(f"mean ΔE, {STRICT_RU:g} RU", "{:.2f}"),
            Column(f"99th percentile, {STRICT_RU:g} RU", "{:.1f}"),
            Column("detail kept", "{:.2f}"),
        ],
        [
            (nodes, power, grid.shown_error, grid.mean, float(np.percentile(grid.error, 99)), grid.detail)
            for (nodes, power), grid in found.items()
        ],
    )


def _pictures(views: Map, exact: Array, found: _Grids, sizes: Sequence[int]) -> list[Picture]:
    row = [maps.panel(views, exact, "exact")]
    for (nodes, power), grid in found.items():
        if power != _BETWEEN:
            note = f"mean ΔE {grid.shown_error:.1f} at {SHOWN_RU:g} RU"
            row.append(maps.panel(views, grid.xyz, f"{nodes} × {nodes}, a = {power:g}", note))
    middle = [0.5 * (low + high) for low, high in _RINGS]
    drawn = [
        Chart(
            f"{nodes} × {nodes} nodes",
            "sin θ of the view",
            f"mean ΔE at {STRICT_RU:g} RU",
            [
                Series(f"a = {a:g}", middle, _by_ring(views, found[nodes, a].error), colour)
                for a, colour in zip(_POWERS, COLOURS, strict=False)
            ],
        )
        for nodes in sizes
    ]
    return [
        Picture(
            maps.sheet([row], "Elaphe, normal incidence"),
            "The exact map, and the paper's table on linear (a = 1) and non-linear (a = 5) grids.",
        ),
        Picture(charts([drawn]), "Mean error by distance from the mirror direction."),
    ]
