"""[S14] fig. 2.4 and 2.7-2.9, [D14] fig. 11: all methods of the literature in one sheet a surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.figures import method_traits as traits
from pipeline.evaluation.figures.exact_maps import SHOWN_RU, STRICT_RU, views_of
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.figures.laser_screen import VISIBLE_CONTRAST
from pipeline.evaluation.figures.method_runs import EXACT_NAME, OURS, on_elaphe, run
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Method
from pipeline.evaluation.methods.nmm import Nmm
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour import delta_e, pixels
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_GEMS, _BUMPS, _GAUSSIAN = "GPU Gems", "Stam bumps", "Stam Gaussian"
# ours first, then from the nearest relative to the farthest
_ORDER = (EXACT_NAME, OURS, "D14 reference", "D14 look-up", "FLSS", "NMM", "PQ", _GAUSSIAN, _BUMPS, _GEMS)
_COMPARED = _ORDER[1:]
_COLUMNS = 5
# a grating's light stays within so many widths of its line
_STRIP_WIDTHS = 4.0
_FLSS_ERROR = 1e-3
_WHITE_WITHIN = 1e-6
_FRINGES_LEAST = 5.0
_SYMMETRIC = 1e-9
_GAUSSIAN_BANDS = (
    "In the limit of low heights Stam's Gaussian formula is the heights' power spectrum, and the scan's own "
    "correlation holds all of that: its bands cannot vanish altogether. They are the mean of both sides, for a "
    "correlation is even. [D14] sees none at all and finds its correlation to vary little along y."
)
_PQ_FRINGES = (
    f"PQ's patches end sharply, so an order has side lobes; steps of {PUBLISHED_STEP_NM:g} nm do not follow them far "
    "from the mirror direction, and they stand as fringes. FLSS at the same step has next to none."
)
_GEMS_STRIP = (
    "GPU Gems knows the spacing of one axis alone: it is shown and measured where such a grating has light, in the "
    "strip that [S14] cuts out as well. It has no radiometry: its colours are taken as shown at the map's exposure."
)


@dataclass(frozen=True)
class _Sheet:
    """One surface: methods and their XYZ in RU (views, 3) by name; strip: views that a one-dimensional model has."""

    surface: Surface
    methods: dict[str, Method]
    maps: dict[str, Array]
    strip: np.ndarray

    def error(self, name: str, exposure_ru: float) -> float:
        """Mean dE from the exact map, over the strip for what knows no more."""
        difference = delta_e(self.maps[name], self.maps[EXACT_NAME], exposure_ru)
        return float(np.mean(difference[self.strip] if name == _GEMS else difference))

    def luminance(self, name: str) -> Array:
        return self.maps[name][:, 1]

    def some(self, *names: str) -> dict[str, Method]:
        return {name: self.methods[name] for name in names}


def make(bench: Bench, progress: Progress) -> Figure:
    """The page: every method's map of three surfaces (quick: two) at normal incidence, and what marks each."""
    views = views_of(bench)
    surfaces = (bench.blazed, bench.elaphe, *(() if bench.quick else (bench.xenopeltis,)))
    sheets = [_sheet(bench, surface, views, progress) for surface in surfaces]
    blazed, elaphe = sheets[:2]
    radius = _white_radius(elaphe)
    centre = traits.across_the_centre(elaphe.surface, elaphe.some(EXACT_NAME, "NMM"), radius)
    line = traits.along_the_first_order(elaphe.surface, elaphe.some(EXACT_NAME, "FLSS", "PQ"))
    return Figure(
        name="methods_sheet",
        title="All methods in one sheet",
        source="[S14] fig. 2.4 and 2.7-2.9, [D14] fig. 11",
        expected="FLSS is the reference; NMM resembles it but for a white spot at the centre; PQ adds fringes; GPU "
        "Gems, given a spacing alone, is symmetric whatever the grating; periodic bumps leave gaps in the bands; "
        "Stam's Gaussian surface shows no secondary horizontal bands on Elaphe.",
        checks=[
            _flss(sheets),
            _white(centre, radius),
            _fringes(line),
            _symmetric(blazed, views),
            _gaps(elaphe),
            _bands(elaphe, views),
            _even(elaphe, views),
        ],
        tables=[_table(sheets)],
        pictures=[*(_picture(views, each) for each in sheets), _lines(centre, radius, line)],
        remarks=[_GAUSSIAN_BANDS, _PQ_FRINGES, _GEMS_STRIP],
        numbers={
            each.surface.name: {name: {"mean_delta_e_7500": each.error(name, STRICT_RU)} for name in _COMPARED}
            for each in sheets
        },
    )


def _sheet(bench: Bench, surface: Surface, views: Map, progress: Progress) -> _Sheet:
    unit, methods, maps = surface.config.radiometry.unit, {}, {}
    for done, name in enumerate(_ORDER, start=1):
        made = on_elaphe(bench, name) if surface is bench.elaphe else run(name, surface, views)
        methods[name], maps[name] = made.method, made.xyz / unit
        progress(f"methods on {surface.name}", done / len(_ORDER))
    width = sigma_f(surface.config.coherence.sigma_um) * 1e-3 * surface.config.light.range_nm[1]
    # at least the middle row of pixels
    strip = np.abs(views.views()[:, 1]) < max(_STRIP_WIDTHS * width, 1.0 / views.size)
    maps[_GEMS] = np.where(strip[:, None], maps[_GEMS], 0.0)
    return _Sheet(surface, methods, maps, strip)


def _flss(sheets: Sequence[_Sheet]) -> Check:
    errors = {each.surface.name: traits.flss_error(each.surface, each.methods[EXACT_NAME]) for each in sheets}
    return Check(
        "FLSS with full reach and enough Taylor terms, at 1 nm: worst relative error on 1000 random directions",
        f"the exact reference within {_FLSS_ERROR:g}",
        ", ".join(f"{name} {error:.1e}" for name, error in errors.items()),
        max(errors.values()) < _FLSS_ERROR,
    )


def _white_radius(sheet: _Sheet) -> float:
    method = sheet.methods["NMM"]
    assert isinstance(method, Nmm)
    return method.white_radius


def _white(centre: traits.Line, radius: float) -> Check:
    inside = np.abs(centre.sin_theta) < 0.999 * radius
    white, truth = centre.luminance["NMM"][inside], centre.luminance["exact"][inside]
    return Check(
        f"NMM on Elaphe: luminance over a mirror's within {radius:.3f} of the mirror direction",
        "a white spot: 1 throughout",
        f"{white.min():.6f} to {white.max():.6f}; exact {truth.min():.3f} to {truth.max():.3f}",
        bool(np.all(np.abs(white - 1.0) < _WHITE_WITHIN) and truth.max() < 0.9),
    )


def _fringes(line: traits.Line) -> Check:
    found = {name: traits.oscillation(line, name) for name in line.luminance}
    return Check(
        f"PQ on Elaphe: rms of fringes over the luminance between them, beyond sin theta = {traits.FRINGE_FROM:g}",
        f"fringes: at least {_FRINGES_LEAST:g} times what the exact map has",
        ", ".join(f"{name} {value:.3f}" for name, value in found.items()),
        found["PQ"] > _FRINGES_LEAST * found["exact"],
    )


def _symmetric(blazed: _Sheet, views: Map) -> Check:
    found = {name: traits.lopsided(blazed.luminance(name), views) for name in (_GEMS, EXACT_NAME)}
    return Check(
        "GPU Gems on the blazed grating: difference between opposite views, over the largest luminance",
        "0: highly symmetric",
        f"{found[_GEMS]:.1g}; exact {found[EXACT_NAME]:.2f}",
        found[_GEMS] < _SYMMETRIC < found[EXACT_NAME],
    )


def _gaps(elaphe: _Sheet) -> Check:
    lit = {name: traits.lit_share(elaphe.surface, method) for name, method in elaphe.some(_BUMPS, EXACT_NAME).items()}
    return Check(
        f"Stam's bumps on Elaphe, epsilon 0.01: share of the primary band that is not black at {SHOWN_RU:g} RU",
        "no continuous bands: at most half of it",
        f"{lit[_BUMPS]:.2f}; exact {lit[EXACT_NAME]:.2f}",
        lit[_BUMPS] <= 0.5 * lit[EXACT_NAME],
    )


def _bands(elaphe: _Sheet, views: Map) -> Check:
    exact, stam = (traits.band_contrast(elaphe.luminance(name), views) for name in (EXACT_NAME, _GAUSSIAN))
    return Check(
        "Stam's Gaussian surface on Elaphe: contrast of the strongest secondary horizontal band",
        f"none: at most {VISIBLE_CONTRAST:g}, which is barely seen",
        f"{stam:.2f}; exact {exact:.2f}",
        # a recipe's fingers have a firm period along their length, which the correlation knows as well
        stam <= VISIBLE_CONTRAST if elaphe.surface.scan else None,
    )


def _even(elaphe: _Sheet, views: Map) -> Check:
    found = {name: traits.lopsided(elaphe.luminance(name), views) for name in (_GAUSSIAN, EXACT_NAME)}
    return Check(
        "Stam's Gaussian surface on Elaphe: difference between opposite views, over the largest luminance",
        "0: a correlation is even",
        f"{found[_GAUSSIAN]:.1g}; exact {found[EXACT_NAME]:.2f}",
        found[_GAUSSIAN] < _SYMMETRIC < found[EXACT_NAME],
    )


def _table(sheets: Sequence[_Sheet]) -> Table:
    rows = [
        [name, *(f"{each.error(name, ru):.3g}" for each in sheets for ru in (SHOWN_RU, STRICT_RU))]
        for name in _COMPARED
    ]
    columns = ["method", *(f"{each.surface.name}, {ru:g} RU" for each in sheets for ru in (SHOWN_RU, STRICT_RU))]
    return Table("Mean ΔE from the exact map at normal incidence; GPU Gems over its strip", columns, rows)


def _picture(views: Map, sheet: _Sheet) -> Picture:
    from pipeline.evaluation.plots import map_plots

    def note(name: str) -> str:
        if name == EXACT_NAME:
            return ""
        where = " in its strip" if name == _GEMS else ""
        return f"mean ΔE {sheet.error(name, SHOWN_RU):.2f}{where}"

    panels = [
        map_plots.Panel(pixels(views.image(xyz), SHOWN_RU), name, note(name)) for name, xyz in sheet.maps.items()
    ]
    rows = [panels[first : first + _COLUMNS] for first in range(0, len(panels), _COLUMNS)]
    name = sheet.surface.name
    png = map_plots.sheet(rows, f"{name}, normal incidence, {SHOWN_RU:g} RU")
    return Picture(png, f"Every method on {name}.")


def _lines(centre: traits.Line, radius: float, line: traits.Line) -> Picture:
    from pipeline.evaluation.plots import map_plots

    def curves(found: traits.Line, styles: Sequence[str]) -> list[map_plots.Line]:
        return [
            map_plots.Line(name, list(found.sin_theta), list(values), colour, style)
            for (name, values), colour, style in zip(found.luminance.items(), map_plots.COLOURS, styles, strict=False)
        ]

    middle = map_plots.Chart(
        "Across the mirror direction: NMM's white spot",
        "sin θ",
        "luminance over a mirror's",
        curves(centre, ("-", "-")),
        y_scale="linear",
        marks=[(-radius, ""), (radius, "white radius")],
    )
    fringes = map_plots.Chart(
        "Along the first order: PQ's fringes",
        "sin θ",
        "luminance over a mirror's",
        curves(line, ("-", "--", "-")),
        floor=1e-7,
    )
    return Picture(map_plots.charts([middle, fringes]), "Elaphe in the plane of incidence.")
