"""[S14] fig. 2.4 and 2.7-2.9, [D14] fig. 11: all methods of the literature in one sheet a surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures import method_traits as traits
from pipeline.evaluation.figures.maps import SHOWN_RU, VISIBLE_CONTRAST, on_elaphe, run
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageTable, PageText, Picture, numbers
from pipeline.evaluation.methods.catalogue import BUMPS, EXACT, FLSS, GEMS, METHODS, NMM, PQ, STAM
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Method
from pipeline.evaluation.methods.nmm import Nmm
from pipeline.evaluation.plots.charts import Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour import delta_e
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_COLUMNS = 5
# a grating's light stays within this many widths of its line
_STRIP_WIDTHS = 4.0
_LIT_AT_MOST = 0.5


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

    def flss_error(self) -> float:
        return traits.flss_error(self.surface, self.methods[EXACT])

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
    text = PageText(
        "methods_sheet",
        shown=SHOWN_RU,
        step_nm=PUBLISHED_STEP_NM,
        fringe_from=traits.FRINGE_FROM,
        radius=nmm.white_radius,
    )
    return text.page(
        checks=[
            *(text.check("flss.{surface}", each.flss_error(), surface=each.surface.name) for each in sheets),
            *_white(text, centre, nmm.white_radius),
            *_fringes(text, fringes),
            *_symmetry(text, "gems", GEMS, blazed, views),
            _gaps(text, elaphe),
            *_bands(text, elaphe, views),
            *_symmetry(text, "gaussian", STAM, elaphe, views),
        ],
        tables=[_table(text, sheets)],
        pictures=[
            *(_picture(text, views, each) for each in sheets),
            text.picture("curves", _curves(text, centre, nmm.white_radius, fringes)),
        ],
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


def _white(text: PageText, centre: traits.Profile, radius: float) -> list[Check]:
    inside = np.abs(centre.sin_theta) < 0.999 * radius
    white, truth = centre.luminance[NMM][inside], centre.luminance[EXACT][inside]
    return [text.check("nmm.white", np.max(np.abs(white - 1.0))), text.check("nmm.exact", truth.max())]


def _fringes(text: PageText, profile: traits.Profile) -> list[Check]:
    exact, flss, pq = (traits.oscillation(profile, name) for name in (EXACT, FLSS, PQ))
    return [text.check("pq.fringes", pq / exact), text.check("flss.fringes", flss / exact)]


def _symmetry(text: PageText, key: str, name: str, sheet: _Sheet, views: Map) -> list[Check]:
    """Of a method that is even by construction, and of the surface, which is not."""
    found, exact = (traits.lopsided(sheet.luminance(each), views) for each in (name, EXACT))
    surface = sheet.surface.name
    return [text.check(f"{key}.even", found), text.check(f"{key}.exact", exact, surface=surface)]


def _gaps(text: PageText, elaphe: _Sheet) -> Check:
    bumps, exact = (traits.lit_share(elaphe.surface, elaphe.methods[name]) for name in (BUMPS, EXACT))
    return text.check("bumps.gaps", bumps, bound=_LIT_AT_MOST * exact)


def _bands(text: PageText, elaphe: _Sheet, views: Map) -> list[Check]:
    stam, exact = (traits.band_contrast(elaphe.luminance(name), views) for name in (STAM, EXACT))
    bound = VISIBLE_CONTRAST if elaphe.surface.scan else None
    return [text.check("gaussian.bands", stam, bound=bound), text.check("exact.bands", exact)]


def _table(text: PageText, sheets: Sequence[_Sheet]) -> PageTable:
    both = [(each, ru) for each in sheets for ru in maps.EXPOSURES_RU]
    compared = [name for name in METHODS if name != EXACT]
    rows: list[tuple[Cell, ...]] = [(name, *(each.error(name, ru) for each, ru in both)) for name in compared]
    return text.table("errors", rows, numbers("{:.3g}", *(f"{each.surface.name}, {ru:g} RU" for each, ru in both)))


def _picture(text: PageText, views: Map, sheet: _Sheet) -> Picture:
    def note(name: str) -> str:
        where = " in its strip" if name == GEMS else ""
        return "" if name == EXACT else f"mean ΔE {sheet.error(name, SHOWN_RU):.2f}{where}"

    panels = [maps.panel(views, xyz, name, note(name)) for name, xyz in sheet.xyz.items()]
    rows = [panels[first : first + _COLUMNS] for first in range(0, len(panels), _COLUMNS)]
    name = sheet.surface.name
    return text.picture("sheet", maps.sheet(rows, f"{name}, normal incidence"), surface=name)


def _curves(text: PageText, centre: traits.Profile, radius: float, fringes: traits.Profile) -> bytes:
    def series(found: traits.Profile, *styles: str) -> list[Series]:
        looks = zip(found.luminance.items(), COLOURS, styles, strict=False)
        return [Series(name, found.sin_theta, values, colour, style) for (name, values), colour, style in looks]

    white = [(-radius, ""), (radius, "white radius")]
    middle = text.chart("centre", series(centre, "-", "-"), marks=white)
    return charts([[middle, text.chart("fringes", series(fringes, "-", "--", "-"))]])
