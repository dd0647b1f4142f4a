"""[D14] fig. 12 and 13, [S14] fig. 2.3 and 2.13: BRDF maps of every surface, exact beside this project's table."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.figures import map_physics
from pipeline.evaluation.figures.exact_maps import (
    NORMAL,
    SHOWN_RU,
    STRICT_RU,
    Light,
    blazed_recipe,
    directions,
    exact_maps,
    mean_delta_e,
    reference,
    views_of,
)
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.figures.method_runs import OURS, PAPER, on_elaphe
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour import pixels
from pipeline.progress import Progress
from pipeline.surface import recipes
from pipeline.surface.recipes.parameters import Blazed, CompactDisc
from pipeline.surface.source import SurfaceSource
from pipeline.tables.evaluate import Map

# [S14] fig. 2.13's series; light from the right, so that what the tilt brings into view appears there
_INCIDENCES: Sequence[Light] = (NORMAL, (10.0, 0.0), (20.0, 0.0), (30.0, 0.0))
_BLAZE_WITHIN = 0.02
_DISC = CompactDisc(kind="cd")
_DISC_LINES_NM, _DISC_ORDERS = (450.0, 550.0, 650.0), (-2, -1, 1, 2)
# of sigma_f: neighbouring speckle of the pits may pull a peak by a small part of its width
_PEAK_WITHIN = 0.1
_ELAPHE_LEAST, _XENOPELTIS_LEAST = 10.0, 5.0
# (u, v) of Xenopeltis' first order along its fingers, 1.5 um apart, in visible light
_ALONG_RHO = (0.25, 0.5)
_ORIENTATION = (
    "Maps are seen with +x to the right and +y up, the surface as its scan lies. The grating rises towards +x, so "
    "its blaze is on the left; tilted light comes from the right (phi = 0), its mirror direction lies on the left."
)


@dataclass(frozen=True)
class _Shown:
    """One surface under one light: XYZ (views, 3) exact and by this project's table."""

    surface: Surface
    light: Light
    exact: Array
    table: Array

    def error(self, exposure_ru: float) -> float:
        """Mean dE of the table."""
        return mean_delta_e(self.surface.config, self.table, self.exact, exposure_ru)

    @property
    def name(self) -> str:
        return f"{self.surface.name}, {self.light[0]:g}°"


def make(bench: Bench, progress: Progress) -> Figure:
    """The page: maps at normal incidence, Xenopeltis under tilted light, and what physics says of each."""
    views, disc = views_of(bench), _disc(bench)
    blazed, pits, elaphe = (_show(each, views, [NORMAL], progress)[0] for each in (bench.blazed, disc, bench.elaphe))
    xenopeltis = _show(bench.xenopeltis, views, _INCIDENCES, progress)
    shown = [blazed, pits, elaphe, *xenopeltis]
    look_up = on_elaphe(bench, PAPER).xyz
    return Figure(
        name="brdf_maps",
        title="BRDF maps",
        source="[D14] fig. 12 and 13, [S14] fig. 2.3 and 2.13",
        expected="Blazed: the first order of one side far brighter than the other's. CD: sharp orders of the tracks "
        "along the vertical. Elaphe: diffraction along the horizontal only. Xenopeltis: along almost vertical bands, "
        "and across its fingers once light is tilted. The look-up shader resembles the reference.",
        checks=[
            _one_sided(blazed, blazed_recipe(bench), views),
            _tracks(disc, progress),
            _horizontal(elaphe, views),
            *_vertical_then_across(xenopeltis, views),
            _resembles(elaphe, look_up),
            _within_budget(shown),
        ],
        tables=[_table(shown, views)],
        pictures=_pictures(views, shown, look_up),
        remarks=[_ORIENTATION],
        numbers={each.name: {"mean_delta_e_7500": each.error(STRICT_RU)} for each in shown},
    )


def _disc(bench: Bench) -> Surface:
    """The synthetic compact disc under the window and light of the bench's grating."""
    section = SurfaceSource(recipe=_DISC)
    config = bench.blazed.config.model_copy(update={"name": "cd", "surface": section})
    return Surface(config, recipes.make(_DISC), scan=False)


def _show(surface: Surface, views: Map, lights: Sequence[Light], progress: Progress) -> list[_Shown]:
    table = METHODS[OURS](surface.field, surface.config)
    exact = exact_maps(surface, views, lights, progress)
    return [
        _Shown(surface, light, truth, table.xyz(*directions(views, light)))
        for light, truth in zip(lights, exact, strict=True)
    ]


def _one_sided(blazed: _Shown, recipe: Blazed, views: Map) -> Check:
    config, wr = blazed.surface.config, views.views()
    left, right = map_physics.first_orders(wr, recipe, config.light.range_nm)
    measured = float(blazed.exact[left, 1].sum() / blazed.exact[right, 1].sum())
    sides = (map_physics.blazed_luminance(config, recipe, wr[side]).sum() for side in (left, right))
    closed = float(next(sides) / next(sides))
    return Check(
        "blazed: luminance of the first order on the blazed side over the opposite one",
        f"{closed:.2f} by sinc^2(m - |w| h / lambda), within {100 * _BLAZE_WITHIN:g} %",
        f"{measured:.2f}",
        abs(measured / closed - 1.0) < _BLAZE_WITHIN,
    )


def _tracks(disc: Surface, progress: Progress) -> Check:
    """Places of the tracks' orders along the vertical at three wavelengths, both sides."""
    exact, sigma_um = reference(disc, progress), disc.config.coherence.sigma_um
    away = 0.0
    for nm in _DISC_LINES_NM:
        expected, found = map_physics.order_places(exact, sigma_um, _DISC.track_um, nm, _DISC_ORDERS)
        away = max(away, float(np.max(np.abs(found - expected))) / (1e-3 * nm * sigma_f(sigma_um)))
    lines = ", ".join(f"{nm:g}" for nm in _DISC_LINES_NM)
    return Check(
        f"CD: orders {_DISC_ORDERS[0]} to {_DISC_ORDERS[-1]} of the tracks along the vertical at {lines} nm",
        f"sin θ = m λ / {_DISC.track_um:g} µm, within {_PEAK_WITHIN:g} of a line's width σ_f λ",
        f"at most {away:.3f} of it away",
        away < _PEAK_WITHIN,
    )


def _horizontal(elaphe: _Shown, views: Map) -> Check:
    horizontal, vertical = map_physics.sectors(elaphe.exact[:, 1], views, NORMAL)
    return Check(
        "Elaphe: luminance within 22.5 degrees of the horizontal over that of the vertical, specular lobe left out",
        f"along the horizontal only: above {_ELAPHE_LEAST:g}",
        f"{horizontal / vertical:.1f}",
        horizontal / vertical > _ELAPHE_LEAST,
    )


def _vertical_then_across(xenopeltis: Sequence[_Shown], views: Map) -> list[Check]:
    normal = xenopeltis[0]
    horizontal, vertical = map_physics.sectors(normal.exact[:, 1], views, normal.light, _ALONG_RHO)
    across = [map_physics.sectors(each.exact[:, 1], views, each.light)[0] for each in xenopeltis]
    below = map_physics.below_over_above(normal.exact[:, 1], views, normal.light, _ALONG_RHO)
    low, high = _ALONG_RHO
    return [
        Check(
            f"Xenopeltis: vertical over horizontal luminance at {low:g} to {high:g} from the mirror direction, where "
            "the first order along its fingers lies",
            f"almost vertical bands: above {_XENOPELTIS_LEAST:g}",
            f"{vertical / horizontal:.1f}",
            vertical / horizontal > _XENOPELTIS_LEAST,
        ),
        Check(
            "Xenopeltis: share of the diffracted luminance across the fingers, by incidence",
            "more conspicuous at 20 degrees, growing with the angle",
            ", ".join(f"{each.light[0]:g}°: {share:.3f}" for each, share in zip(xenopeltis, across, strict=True)),
            across == sorted(across),
        ),
        Check(
            "Xenopeltis: luminance of the first vertical mode below the centre over that above",
            "above 1: brighter below",
            f"{below:.2f}",
            below > 1.0,
        ),
    ]


def _resembles(elaphe: _Shown, look_up: Array) -> Check:
    config = elaphe.surface.config
    paper = [mean_delta_e(config, look_up, elaphe.exact, ru) for ru in (SHOWN_RU, STRICT_RU)]
    ours = [elaphe.error(ru) for ru in (SHOWN_RU, STRICT_RU)]
    return Check(
        f"Elaphe: mean ΔE of the paper's look-up from the reference at {SHOWN_RU:g} and {STRICT_RU:g} RU",
        "visually similar (fig. 13); this project's table nearer at the higher exposure",
        f"{paper[0]:.2f} and {paper[1]:.2f}; this project's table {ours[0]:.3f} and {ours[1]:.3f}",
        ours[1] < paper[1],
    )


def _within_budget(shown: Sequence[_Shown]) -> Check:
    budget = shown[0].surface.config.budget_delta_e
    errors = {each.name: each.error(STRICT_RU) for each in shown}
    mean, worst = sum(errors.values()) / len(errors), max(errors, key=lambda name: errors[name])
    return Check(
        f"this project's table against the exact maps, mean ΔE at {STRICT_RU:g} RU",
        f"at most {budget:g} in the mean over maps, what it is planned for",
        f"{mean:.3f}; of single maps at most {errors[worst]:.3f} ({worst})",
        mean <= budget,
    )


def _table(shown: Sequence[_Shown], views: Map) -> Table:
    rows = []
    for each in shown:
        horizontal, vertical = map_physics.sectors(each.exact[:, 1], views, each.light)
        errors = [f"{each.error(ru):.3f}" for ru in (SHOWN_RU, STRICT_RU)]
        rows.append([each.name, f"{horizontal:.3f}", f"{vertical:.3f}", *errors])
    columns = ["map", "share horizontal", "share vertical", "mean ΔE, 1500 RU", "mean ΔE, 7500 RU"]
    caption = "Where the diffracted luminance goes, and this project's table against the exact map"
    return Table(caption, columns, rows)


def _pictures(views: Map, shown: Sequence[_Shown], look_up: Array) -> list[Picture]:
    from pipeline.evaluation.plots import map_plots

    def panel(each: _Shown, xyz: Array, title: str, note: str = "") -> map_plots.Panel:
        image = views.image(xyz / each.surface.config.radiometry.unit)
        return map_plots.Panel(pixels(image, SHOWN_RU), title, note)

    def rows(chosen: Sequence[_Shown]) -> list[list[map_plots.Panel]]:
        notes = [f"mean ΔE {each.error(SHOWN_RU):.2f}" for each in chosen]
        exact = [panel(each, each.exact, each.name) for each in chosen]
        return [exact, [panel(each, each.table, "", note) for each, note in zip(chosen, notes, strict=True)]]

    blazed, disc, elaphe, *xenopeltis = shown
    names = ["exact", "this project's table"]
    surfaces = map_plots.sheet(
        rows([blazed, disc, elaphe, xenopeltis[0], xenopeltis[2]]), _heading("Surfaces"), names
    )
    tilts = map_plots.sheet(rows(xenopeltis), _heading("Xenopeltis by incidence"), names)
    paper = mean_delta_e(elaphe.surface.config, look_up, elaphe.exact, SHOWN_RU)
    three = [
        panel(elaphe, elaphe.exact, "reference"),
        panel(elaphe, look_up, "the paper's look-up", f"mean ΔE {paper:.2f}"),
        panel(elaphe, elaphe.table, "this project's table", f"mean ΔE {elaphe.error(SHOWN_RU):.2f}"),
    ]
    return [
        Picture(surfaces, "[D14] fig. 12: every surface, exact above and by this project's table below."),
        Picture(tilts, "[S14] fig. 2.13: Xenopeltis as the light is tilted to the right."),
        Picture(map_plots.sheet([three], _heading("Elaphe")), "[D14] fig. 13: reference and look-up on Elaphe."),
    ]


def _heading(what: str) -> str:
    return f"{what}, {SHOWN_RU:g} RU, gamma 2.2"
