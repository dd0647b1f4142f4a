"""[D14] fig. 12 and 13, [S14] fig. 2.3 and 2.13: BRDF maps of every surface, exact and by this project's table."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import map_physics, maps
from pipeline.evaluation.figures.maps import NORMAL, SHOWN_RU, STRICT_RU, XENOPELTIS_RHO, Light
from pipeline.evaluation.figures.method_runs import on_elaphe
from pipeline.evaluation.figures.page import Bench, BenchSurface, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.methods.catalogue import METHODS, OURS, PAPER
from pipeline.evaluation.plots import map_plots
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
# of sigma_f: neighbouring speckle of the pits may pull a peak by a small part of its width
_PEAK_WITHIN = 0.1
_ELAPHE_LEAST, _XENOPELTIS_LEAST = 10.0, 5.0
_ORIENTATION = (
    "Maps show +x to the right and +y up, in the axes of the scan. The grating rises towards +x, so its blaze is on "
    "the left; tilted light comes from the right (phi = 0), its mirror direction lies on the left."
)
_SECTORS = (
    "Horizontal and vertical luminance lie within 22.5° of the axes about the mirror direction, without the specular "
    "lobe. Xenopeltis' first order along its fingers is seen "
    f"{XENOPELTIS_RHO[0]:g} to {XENOPELTIS_RHO[1]:g} from the mirror direction. "
    "The blazed grating's closed form is sinc²(m - |w| h / λ); the orders of the CD's tracks are looked for at "
    f"{', '.join(f'{nm:g}' for nm in _DISC_LINES_NM)} nm, where sin θ = m λ / {_DISC.track_um:g} µm."
)


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
    return Page(
        name="brdf_maps",
        title="BRDF maps",
        source="[D14] fig. 12 and 13, [S14] fig. 2.3 and 2.13",
        expected="Blazed: the first order of one side far brighter than the other's. CD: sharp orders of the tracks "
        "along the vertical. Elaphe: diffraction along the horizontal only. Xenopeltis: along almost vertical bands, "
        "and across its fingers once light is tilted. The look-up shader resembles the reference.",
        checks=[
            _one_sided(bench, blazed, views),
            _tracks(disc, progress),
            *_sectors(elaphe, xenopeltis, views),
            *_budgets(shown, look_up),
        ],
        tables=[_table([*shown, look_up], views)],
        pictures=_pictures(views, shown, look_up),
        remarks=[_ORIENTATION, _SECTORS],
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


def _one_sided(bench: Bench, blazed: _Shown, views: Map) -> Check:
    config, recipe, wr = blazed.surface.config, maps.blazed_recipe(bench), views.views()
    sides = map_physics.first_orders(wr, recipe, config.light.range_nm)
    left, right = (float(blazed.exact[side, 1].sum()) for side in sides)
    closed_left, closed_right = (map_physics.blazed_luminance(config, recipe, wr[side]).sum() for side in sides)
    closed = closed_left / closed_right
    what = "blazed grating: luminance of the first order on the blazed side over the opposite one"
    return Check("blazed.luminance", what, left / right, "=", closed, _BLAZE_WITHIN * closed, source="closed form")


def _tracks(disc: BenchSurface, progress: Progress) -> Check:
    exact, away = disc.reference(progress), 0.0
    for nm in _DISC_LINES_NM:
        expected, found = map_physics.order_sines(exact, disc.sigma_um, _DISC.track_um, nm, _DISC_ORDERS)
        away = max(away, float(np.max(np.abs(found - expected))) / (1e-3 * nm * sigma_f(disc.sigma_um)))
    what = (
        f"CD: orders {_DISC_ORDERS[0]} to {_DISC_ORDERS[-1]} of the tracks along the vertical, largest displacement"
    )
    return Check("cd.tracks", what, away, "<", _PEAK_WITHIN, unit="σ_f λ", source="grating equation")


def _sectors(elaphe: _Shown, xenopeltis: Sequence[_Shown], views: Map) -> list[Check]:
    def share(shown: _Shown, *rho: tuple[float, float]) -> tuple[float, float]:
        return map_physics.sectors(shown.exact[:, 1], views, shown.light, *rho)

    normal = xenopeltis[0]
    (along, off), (across, fingers) = share(elaphe), share(normal, XENOPELTIS_RHO)
    growth = np.diff([share(each)[0] for each in xenopeltis])
    below = map_physics.below_over_above(normal.exact[:, 1], views, normal.light, XENOPELTIS_RHO)
    return [
        Check("elaphe.horizontal", "Elaphe: horizontal over vertical luminance", along / off, ">", _ELAPHE_LEAST),
        Check(
            "xenopeltis.vertical",
            "Xenopeltis: vertical over horizontal luminance, along the fingers",
            fingers / across,
            ">",
            _XENOPELTIS_LEAST,
        ),
        Check(
            "xenopeltis.across",
            "Xenopeltis: least growth of the horizontal share from one incidence to the next",
            growth.min(),
            ">=",
            0.0,
        ),
        Check("xenopeltis.below", "Xenopeltis: first vertical mode below the centre over above", below, ">", 1.0),
    ]


def _budgets(shown: Sequence[_Shown], look_up: _Shown) -> list[Check]:
    elaphe = next(each for each in shown if each.surface is look_up.surface)
    ours, paper = elaphe.error(STRICT_RU), look_up.error(STRICT_RU)
    mean, budget = float(np.mean([each.error(STRICT_RU) for each in shown])), elaphe.surface.config.budget_delta_e
    at = f"mean ΔE at {STRICT_RU:g} RU"
    return [
        Check("elaphe.table", f"Elaphe: {at} of this project's table, below the paper's look-up", ours, "<", paper),
        Check("table.budget", f"this project's table: {at} over all maps", mean, "<=", budget, source="its budget"),
    ]


def _table(shown: Sequence[_Shown], views: Map) -> PageTable:
    return PageTable(
        "maps",
        "Where the diffracted luminance goes, and this project's table against the exact map",
        [Column("map"), *numbers("{:.3f}", "share horizontal", "share vertical", *maps.ERROR_COLUMNS)],
        [
            (
                each.name,
                *map_physics.sectors(each.exact[:, 1], views, each.light),
                *(each.error(ru) for ru in maps.EXPOSURES_RU),
            )
            for each in shown
        ],
    )


def _pictures(views: Map, shown: Sequence[_Shown], look_up: _Shown) -> list[Picture]:
    def exact(each: _Shown, title: str) -> map_plots.Panel:
        return maps.panel(views, each.exact / each.surface.unit, title)

    def table(each: _Shown, title: str = "") -> map_plots.Panel:
        return maps.panel(views, each.table / each.surface.unit, title, f"mean ΔE {each.error(SHOWN_RU):.2f}")

    def both(chosen: Sequence[_Shown], heading: str, caption: str) -> Picture:
        rows = [[exact(each, each.name) for each in chosen], [table(each) for each in chosen]]
        return Picture(maps.sheet(rows, heading, ["exact", "this project's table"]), caption)

    blazed, disc, elaphe, *xenopeltis = shown
    three = [exact(elaphe, "reference"), table(look_up, "the paper's look-up"), table(elaphe, "this project's table")]
    return [
        both(
            [blazed, disc, elaphe, xenopeltis[0], xenopeltis[2]],
            "Surfaces",
            "[D14] fig. 12: every surface, exact above and by this project's table below.",
        ),
        both(
            xenopeltis,
            "Xenopeltis by incidence",
            "[S14] fig. 2.13: Xenopeltis as the light is tilted to the right.",
        ),
        Picture(maps.sheet([three], "Elaphe"), "[D14] fig. 13: reference and look-up on Elaphe."),
    ]
