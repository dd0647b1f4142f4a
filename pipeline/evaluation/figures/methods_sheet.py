"""[S14] fig. 2.4 and 2.7-2.9, [D14] fig. 11: all methods of the literature in one sheet a surface."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures import method_traits as traits
from pipeline.evaluation.figures.bands import VISIBLE_CONTRAST
from pipeline.evaluation.figures.maps import SHOWN_RU
from pipeline.evaluation.figures.method_runs import on_elaphe, run
from pipeline.evaluation.figures.page import Bench, BenchSurface, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.methods.catalogue import BUMPS, EXACT, FLSS, GEMS, METHODS, NMM, PQ, STAM
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Method
from pipeline.evaluation.methods.nmm import Nmm
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour import delta_e
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_COMPARED = [name for name in METHODS if name != EXACT]
_COLUMNS = 5
# a grating's light stays within this many widths of its line
_STRIP_WIDTHS = 4.0
_FLSS_ERROR = 1e-3
_WHITE_WITHIN, _EXACT_BELOW = 1e-6, 0.9
_FRINGES_LEAST = 5.0
_SYMMETRIC = 1e-9
_LIT_AT_MOST = 0.5
_GAUSSIAN_BANDS = (
    "In the limit of low heights Stam's Gaussian formula is the heights' power spectrum, and the scan's own "
    "correlation holds all of that: its bands cannot vanish altogether. They are the mean of both sides, for a "
    "correlation is even. [D14] sees none at all and finds its correlation to vary little along y. A recipe's "
    "fingers have a firm period along their length, which the correlation has too: of a recipe bands are reported."
)
_PQ_FRINGES = (
    f"PQ's patches end sharply, so an order has side lobes; steps of {PUBLISHED_STEP_NM:g} nm do not follow them far "
    "from the mirror direction, where they become fringes. FLSS at the same step has next to none. Fringes are given "
    f"as rms over the smoothed luminance beyond sin theta = {traits.FRINGE_FROM:g}."
)
_GEMS_STRIP = (
    "GPU Gems knows the spacing of one axis alone: it is shown and measured where such a grating has light, in the "
    "strip that [S14] cuts out as well. It has no radiometry: its colours are taken as shown at the map's exposure."
)


@dataclass(frozen=True)
class _Sheet:
    """One surface: methods and their XYZ in RU (views, 3) by name; strip: views that a one-dimensional model has."""

    surface: BenchSurface
    methods: dict[str, Method]
    xyz: dict[str, Array]
    strip: np.ndarray

    def error(self, name: str, exposure_ru: float) -> float:
        """Mean dE from the exact map, of a one-dimensional model over the strip."""
        difference = delta_e(self.xyz[name], self.xyz[EXACT], exposure_ru)
        return float(np.mean(difference[self.strip] if name == GEMS else difference))

    def luminance(self, name: str) -> Array:
        return self.xyz[name][:, 1]

    def some(self, *names: str) -> dict[str, Method]:
        return {name: self.methods[name] for name in names}


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: every method's map of three surfaces (quick: two) at normal incidence, and its traits."""
    views = maps.views_of(bench)
    surfaces = (bench.blazed, bench.elaphe, *(() if bench.quick else (bench.xenopeltis,)))
    sheets = [_sheet(bench, surface, views, progress) for surface in surfaces]
    blazed, elaphe = sheets[:2]
    nmm = elaphe.methods[NMM]
    assert isinstance(nmm, Nmm)
    centre = traits.across_the_centre(elaphe.surface, elaphe.some(EXACT, NMM), nmm.white_radius)
    fringes = traits.along_the_first_order(elaphe.surface, elaphe.some(EXACT, FLSS, PQ))
    return Page(
        name="methods_sheet",
        title="All methods in one sheet",
        source="[S14] fig. 2.4 and 2.7-2.9, [D14] fig. 11",
        expected="FLSS is the reference; NMM resembles it but for a white spot at the centre; PQ adds fringes; GPU "
        "Gems, given a spacing alone, is symmetric whatever the grating; periodic bumps leave gaps in the bands; "
        "Stam's Gaussian surface shows no secondary horizontal bands on Elaphe.",
        checks=[
            *_flss(sheets),
            *_white(centre, nmm.white_radius),
            *_fringes(fringes),
            *_symmetry("gems", "GPU Gems on the blazed grating", GEMS, blazed, views),
            _gaps(elaphe),
            *_bands(elaphe, views),
            *_symmetry("gaussian", "Stam's Gaussian surface on Elaphe", STAM, elaphe, views),
        ],
        tables=[_table(sheets)],
        pictures=[*(_picture(views, each) for each in sheets), _curves(centre, nmm.white_radius, fringes)],
        remarks=[_GAUSSIAN_BANDS, _PQ_FRINGES, _GEMS_STRIP],
    )


def _sheet(bench: Bench, surface: BenchSurface, views: Map, progress: Progress) -> _Sheet:
    methods, xyz = {}, {}
    for done, name in enumerate(METHODS, start=1):
        made = on_elaphe(bench, name) if surface is bench.elaphe else run(name, surface, views)
        methods[name], xyz[name] = made.method, made.xyz / surface.unit
        progress(f"methods on {surface.name}", done / len(METHODS))
    width = sigma_f(surface.sigma_um) * 1e-3 * surface.config.light.range_nm[1]
    # at least the middle row of pixels
    strip = np.abs(views.views()[:, 1]) < max(_STRIP_WIDTHS * width, 1.0 / views.size)
    xyz[GEMS] = np.where(strip[:, None], xyz[GEMS], 0.0)
    return _Sheet(surface, methods, xyz, strip)


def _flss(sheets: Sequence[_Sheet]) -> Iterator[Check]:
    for each in sheets:
        name, error = each.surface.name, traits.flss_error(each.surface, each.methods[EXACT])
        what = f"FLSS with full reach at 1 nm on {name}: worst relative error on 1000 random directions"
        yield Check(f"flss.{name}", what, error, "<", _FLSS_ERROR, source="[S14] 1.3.2")


def _white(centre: traits.Profile, radius: float) -> list[Check]:
    inside = np.abs(centre.sin_theta) < 0.999 * radius
    white, truth = centre.luminance[NMM][inside], centre.luminance[EXACT][inside]
    within = f"luminance over a mirror's within {radius:.3f} of the mirror direction"
    departure = np.max(np.abs(white - 1.0))
    return [
        Check("nmm.white", f"NMM on Elaphe: {within}, largest departure from 1", departure, "<", _WHITE_WITHIN),
        Check("nmm.exact", f"exact on Elaphe: {within}, largest", truth.max(), "<", _EXACT_BELOW),
    ]


def _fringes(profile: traits.Profile) -> list[Check]:
    exact, flss, pq = (traits.oscillation(profile, name) for name in (EXACT, FLSS, PQ))
    return [
        Check("pq.fringes", "PQ on Elaphe: fringes over those of the exact map", pq / exact, ">", _FRINGES_LEAST),
        Check("flss.fringes", "FLSS on Elaphe: fringes over those of the exact map", flss / exact),
    ]


def _symmetry(key: str, what: str, name: str, sheet: _Sheet, views: Map) -> list[Check]:
    """Of a method that is even by construction, and of the surface, which is not."""
    found, exact = (traits.lopsided(sheet.luminance(each), views) for each in (name, EXACT))
    difference = "difference between opposite views over the largest luminance"
    return [
        Check(f"{key}.even", f"{what}: {difference}", found, "<", _SYMMETRIC),
        Check(f"{key}.exact", f"exact on {sheet.surface.name}: {difference}", exact, ">", _SYMMETRIC),
    ]


def _gaps(elaphe: _Sheet) -> Check:
    bumps, exact = (traits.lit_share(elaphe.surface, elaphe.methods[name]) for name in (BUMPS, EXACT))
    what = f"Stam's bumps on Elaphe, epsilon 0.01: share of the primary band that is not black at {SHOWN_RU:g} RU"
    return Check("bumps.gaps", what, bumps, "<=", _LIT_AT_MOST * exact, source="half of the exact map's")


def _bands(elaphe: _Sheet, views: Map) -> list[Check]:
    stam, exact = (traits.band_contrast(elaphe.luminance(name), views) for name in (STAM, EXACT))
    bound, contrast = VISIBLE_CONTRAST if elaphe.surface.scan else None, "contrast of the strongest secondary band"
    return [
        Check("gaussian.bands", f"Stam's Gaussian surface on Elaphe: {contrast}", stam, "<=", bound),
        Check("exact.bands", f"exact on Elaphe: {contrast}", exact),
    ]


def _table(sheets: Sequence[_Sheet]) -> PageTable:
    both = [(each, ru) for each in sheets for ru in maps.EXPOSURES_RU]
    return PageTable(
        "errors",
        "Mean ΔE from the exact map at normal incidence; GPU Gems over its strip",
        [Column("method"), *numbers("{:.3g}", *(f"{each.surface.name}, {ru:g} RU" for each, ru in both))],
        [(name, *(each.error(name, ru) for each, ru in both)) for name in _COMPARED],
    )


def _picture(views: Map, sheet: _Sheet) -> Picture:
    def note(name: str) -> str:
        where = " in its strip" if name == GEMS else ""
        return "" if name == EXACT else f"mean ΔE {sheet.error(name, SHOWN_RU):.2f}{where}"

    panels = [maps.panel(views, xyz, name, note(name)) for name, xyz in sheet.xyz.items()]
    rows = [panels[first : first + _COLUMNS] for first in range(0, len(panels), _COLUMNS)]
    name = sheet.surface.name
    return Picture(maps.sheet(rows, f"{name}, normal incidence"), f"Every method on {name}.")


def _curves(centre: traits.Profile, radius: float, fringes: traits.Profile) -> Picture:
    def chart(title: str, found: traits.Profile, styles: Sequence[str], **look: Any) -> Chart:
        series = [
            Series(name, found.sin_theta, values, colour, style)
            for (name, values), colour, style in zip(found.luminance.items(), COLOURS, styles, strict=False)
        ]
        return Chart(title, "sin θ", "luminance over a mirror's", series, **look)

    white = [(-radius, ""), (radius, "white radius")]
    middle = chart("Across the mirror direction: NMM's white spot", centre, ("-", "-"), y_scale="linear", marks=white)
    along = chart("Along the first order: PQ's fringes", fringes, ("-", "--", "-"), floor=1e-7)
    return Picture(charts([[middle, along]]), "Elaphe in the plane of incidence.")
