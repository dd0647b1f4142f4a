"""[D14] fig. 12 and 13, [S14] fig. 2.3 and 2.13: BRDF maps of every surface, exact and by this project's table."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import NORMAL, SHOWN_RU, STRICT_RU, XENOPELTIS_RHO, Light, on_elaphe
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageText, Picture
from pipeline.evaluation.methods.catalogue import METHODS, OURS, PAPER
from pipeline.evaluation.plots.map_plots import Panel
from pipeline.optics.coherence import sigma_f
from pipeline.progress import Progress
from pipeline.surface import recipes
from pipeline.surface.recipes.parameters import CompactDisc
from pipeline.surface.source import SurfaceSource
from pipeline.tables.evaluate import Map

# [S14] fig. 2.13's series; light from the right, so that the orders which the tilt brings into view appear there
_INCIDENCES: Sequence[Light] = (NORMAL, (10.0, 0.0), (20.0, 0.0), (30.0, 0.0))
_BLAZE_WITHIN = 0.02
_DISC = CompactDisc(kind="cd")
_DISC_LINES_NM, _DISC_ORDERS = (450.0, 550.0, 650.0), (-2, -1, 1, 2)


@dataclass(frozen=True)
class _Shown:
    """One surface under one light: XYZ (views, 3) by the reference and by a table."""

    surface: BenchSurface
    light: Light
    exact: Array
    table: Array
    suffix: str = ""

    def error(self, exposure_ru: float) -> float:
        """Mean dE of the table."""
        return maps.mean_delta_e(self.surface, self.table, self.exact, exposure_ru)

    def sectors(self, views: Map, *rho: tuple[float, float]) -> tuple[float, float]:
        """Shares of the exact luminance along the horizontal and the vertical."""
        return maps.sectors(self.exact[:, 1], views, self.light, *rho)

    def row(self, views: Map) -> tuple[Cell, ...]:
        """Its row of the page's table."""
        return self.name, *self.sectors(views), *(self.error(ru) for ru in maps.EXPOSURES_RU)

    @property
    def name(self) -> str:
        return f"{self.surface.name}, {self.light[0]:g}°{self.suffix}"


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: maps at normal incidence, Xenopeltis under tilted light, and their checks."""
    views, disc = maps.views_of(bench), _disc(bench)
    blazed, pits, elaphe = (_show(each, views, [NORMAL], progress)[0] for each in (bench.blazed, disc, bench.elaphe))
    xenopeltis = _show(bench.xenopeltis, views, _INCIDENCES, progress)
    shown = [blazed, pits, elaphe, *xenopeltis]
    look_up = _Shown(bench.elaphe, NORMAL, elaphe.exact, on_elaphe(bench, PAPER).xyz, ", the paper's look-up")
    lines = ", ".join(f"{nm:g}" for nm in _DISC_LINES_NM)
    text = PageText(
        "brdf_maps",
        shown=SHOWN_RU,
        strict=STRICT_RU,
        rho=XENOPELTIS_RHO,
        lines=lines,
        disc=_DISC,
        orders=_DISC_ORDERS,
    )
    return text.page(
        checks=_checks(text, bench, shown, look_up, views, progress),
        tables=[text.table("maps", [each.row(views) for each in (*shown, look_up)])],
        pictures=_pictures(text, views, shown, look_up),
    )


def _disc(bench: Bench) -> BenchSurface:
    """Return the synthetic compact disc under the window and light of the bench's grating."""
    section = SurfaceSource(recipe=_DISC)
    config = bench.blazed.config.model_copy(update={"name": "cd", "surface": section})
    return BenchSurface(config, recipes.make(_DISC), scan=False)


def _show(surface: BenchSurface, views: Map, lights: Sequence[Light], progress: Progress) -> list[_Shown]:
    table = METHODS[OURS](surface.field, surface.config)
    exact = maps.exact_maps(surface, views, lights, progress)
    return [
        _Shown(surface, light, truth, table.xyz(*maps.directions(views, light)))
        for light, truth in zip(lights, exact, strict=True)
    ]


def _checks(
    text: PageText, bench: Bench, shown: Sequence[_Shown], look_up: _Shown, views: Map, progress: Progress
) -> Iterator[Check]:
    blazed, disc, elaphe, *xenopeltis = shown
    config, recipe, wr = bench.blazed.config, maps.blazed_recipe(bench), views.views()
    sides = maps.first_orders(wr, recipe, config.light.range_nm)
    left, right = (float(blazed.exact[side, 1].sum()) for side in sides)
    closed_left, closed_right = (maps.blazed_luminance(config, recipe, wr[side]).sum() for side in sides)
    closed = closed_left / closed_right
    yield text.check("blazed.luminance", left / right, bound=closed, tolerance=_BLAZE_WITHIN * closed)
    yield text.check("cd.tracks", _displacement(disc.surface, progress))

    normal = xenopeltis[0]
    (along, off), (across, fingers) = elaphe.sectors(views), normal.sectors(views, XENOPELTIS_RHO)
    growth = np.diff([each.sectors(views)[0] for each in xenopeltis])
    below = maps.below_over_above(normal.exact[:, 1], views, normal.light, XENOPELTIS_RHO)
    yield text.check("elaphe.horizontal", along / off)
    yield text.check("xenopeltis.vertical", fingers / across)
    yield text.check("xenopeltis.across", growth.min())
    yield text.check("xenopeltis.below", below)

    mean, budget = float(np.mean([each.error(STRICT_RU) for each in shown])), bench.elaphe.config.budget_delta_e
    yield text.check("elaphe.table", elaphe.error(STRICT_RU), bound=look_up.error(STRICT_RU))
    yield text.check("table.budget", mean, bound=budget)


def _displacement(disc: BenchSurface, progress: Progress) -> float:
    """The largest distance of an order of the tracks from its place, in sigma_f lambda."""
    exact, away = disc.reference(progress), 0.0
    for nm in _DISC_LINES_NM:
        expected, found = maps.order_sines(exact, disc.sigma_um, _DISC.track_um, nm, _DISC_ORDERS)
        away = max(away, float(np.max(np.abs(found - expected))) / (1e-3 * nm * sigma_f(disc.sigma_um)))
    return away


def _pictures(text: PageText, views: Map, shown: Sequence[_Shown], look_up: _Shown) -> list[Picture]:
    def exact(each: _Shown, title: str) -> Panel:
        return maps.panel(views, each.exact / each.surface.unit, title)

    def table(each: _Shown, title: str = "") -> Panel:
        return maps.panel(views, each.table / each.surface.unit, title, f"mean ΔE {each.error(SHOWN_RU):.2f}")

    def both(chosen: Sequence[_Shown], heading: str) -> bytes:
        rows = [[exact(each, each.name) for each in chosen], [table(each) for each in chosen]]
        return maps.sheet(rows, heading, ["exact", "this project's table"])

    blazed, disc, elaphe, *xenopeltis = shown
    three = [exact(elaphe, "reference"), table(look_up, "the paper's look-up"), table(elaphe, "this project's table")]
    return [
        text.picture("surfaces", both([blazed, disc, elaphe, xenopeltis[0], xenopeltis[2]], "Surfaces")),
        text.picture("incidences", both(xenopeltis, "Xenopeltis by incidence")),
        text.picture("look_up", maps.sheet([three], "Elaphe")),
    ]
