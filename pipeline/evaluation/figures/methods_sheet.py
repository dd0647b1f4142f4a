"""[S14] fig. 2.4 and 2.7-2.9, [D14] fig. 11: all methods of the literature in one sheet a surface.

Their traits are numbers for what [S14] or [D14] says of its pictures: agreement of FLSS, NMM's white centre, PQ's
fringes, bands.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import (
    SHOWN_RU,
    VISIBLE_CONTRAST,
    bands_of,
    lit_views,
    on_elaphe,
    run,
    under_normal_light,
)
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageTable, PageText, Picture, numbers
from pipeline.evaluation.methods.catalogue import BUMPS, EXACT, FLSS, GEMS, METHODS, NMM, PQ, STAM
from pipeline.evaluation.methods.dft_terms import FULL
from pipeline.evaluation.methods.flss import Flss
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Method
from pipeline.evaluation.methods.nmm import Nmm
from pipeline.evaluation.plots.charts import Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics import brdf
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour import delta_e
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress
from pipeline.scene.pairs import random_pairs
from pipeline.tables.evaluate import Map

_COLUMNS = 5
# a grating's light stays within this many widths of its line
_STRIP_WIDTHS = 4.0
_LIT_AT_MOST = 0.5
_DIRECTIONS, _SEED = 1000, 20140701
# of the mirror: a decade below black at 7500 RU
_DARK = 1e-7
_CENTRE_RADII, _CENTRE_SAMPLES = 3.0, 121
# along the plane of incidence, where Elaphe's first order fades
_FRINGE_RANGE, _FRINGE_SAMPLES, _SMOOTH = (0.3, 0.95), 1301, 0.01
FRINGE_FROM = 0.7
# of Elaphe's primary band: where the first order lies in visible light, and how wide it is seen
_PRIMARY_X, _PRIMARY_Y, _PRIMARY_SAMPLES = (0.35, 0.65), 0.03, (61, 25)
_BAND_X, _BAND_Y = (0.25, 0.75), 0.05


@dataclass(frozen=True)
class Profile:
    """Luminance over a mirror's, (views,), at sin theta of views in the plane of incidence, by method."""

    sin_theta: Array
    luminance: dict[str, Array]


def profile_of(surface: BenchSurface, methods: Mapping[str, Method], sin_theta: Array) -> Profile:
    """Compute the luminance of methods at views in the plane of incidence."""
    wi, wr = under_normal_light(sin_theta)
    # Y that |P|^2 = 1 would give
    mirror = brdf.direction_factor(surface.config.material, trapezoid(surface.config.light, STEP_NM), wi, wr)
    return Profile(sin_theta, {name: method.xyz(wi, wr)[:, 1] / mirror for name, method in methods.items()})


def oscillation(profile: Profile, name: str) -> float:
    """Return the rms of fringes over the smoothed luminance, beyond sin theta = 0.7.

    Fringes are what a Gaussian of 0.01 in sin theta removes.
    """
    values, sine = profile.luminance[name], profile.sin_theta
    smooth = gaussian_filter1d(values, _SMOOTH / (sine[1] - sine[0]))
    # the filter sees less than its width at the ends
    inner = (sine > FRINGE_FROM) & (sine < _FRINGE_RANGE[1] - 3.0 * _SMOOTH)
    return float(np.sqrt(np.mean((values / smooth - 1.0)[inner] ** 2)))


def lit_share(surface: BenchSurface, method: Method) -> float:
    """Return the share of views in the right half of the primary horizontal band that are not black at 1500 RU."""
    along, across = _PRIMARY_SAMPLES
    x, y = np.meshgrid(np.linspace(*_PRIMARY_X, along), np.linspace(-_PRIMARY_Y, _PRIMARY_Y, across))
    xyz = method.xyz(*under_normal_light(x.ravel(), y.ravel()))
    return float(np.mean(lit_views(xyz / surface.unit)))


def band_contrast(luminance: Array, views: Map) -> float:
    """Return the contrast of the strongest secondary horizontal band of a map's luminance (views,).

    Rows are means over the columns outside the specular lobe.
    """
    axis = (np.arange(views.size) + 0.5) / views.size * 2.0 - 1.0
    columns = (np.abs(axis) > _BAND_X[0]) & (np.abs(axis) < _BAND_X[1])
    profile = views.image(luminance)[:, columns].mean(axis=1)
    return bands_of(profile, axis, _BAND_Y, _BAND_X[1]).contrast


def lopsided(luminance: Array, views: Map) -> float:
    """Return the largest |Y(x, y) - Y(-x, -y)| of a map at normal incidence, over its largest Y."""
    image = views.image(luminance)
    return float(np.max(np.abs(image - image[::-1, ::-1])) / np.max(image))


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

    def profile(self, sin_theta: Array, *names: str) -> Profile:
        return profile_of(self.surface, {name: self.methods[name] for name in names}, sin_theta)


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: every method's map of three surfaces (quick: two) at normal incidence, and its traits."""
    views = maps.views_of(bench)
    surfaces = (bench.blazed, bench.elaphe, *(() if bench.quick else (bench.xenopeltis,)))
    sheets = [_sheet(bench, surface, views, progress) for surface in surfaces]
    elaphe = sheets[1]
    nmm = elaphe.methods[NMM]
    assert isinstance(nmm, Nmm)
    across = np.linspace(-1.0, 1.0, _CENTRE_SAMPLES) * _CENTRE_RADII * nmm.white_radius
    along = np.linspace(*_FRINGE_RANGE, _FRINGE_SAMPLES)
    centre, fringes = elaphe.profile(across, EXACT, NMM), elaphe.profile(along, EXACT, FLSS, PQ)
    text = PageText(
        "methods_sheet",
        shown=SHOWN_RU,
        step_nm=PUBLISHED_STEP_NM,
        fringe_from=FRINGE_FROM,
        radius=nmm.white_radius,
    )
    return text.page(
        checks=_checks(text, sheets, centre, fringes, nmm.white_radius, views),
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


def _checks(
    text: PageText, sheets: Sequence[_Sheet], centre: Profile, fringes: Profile, radius: float, views: Map
) -> Iterator[Check]:
    (wi, wr), (blazed, elaphe) = random_pairs(None, _DIRECTIONS, _SEED), sheets[:2]
    for each in sheets:
        surface, exact = each.surface, each.methods[EXACT].xyz(wi, wr)
        found = Flss(surface.field, surface.config, reach=FULL, step_nm=STEP_NM).xyz(wi, wr)
        worst = np.max(np.abs(found - exact) / np.maximum(exact, _DARK))
        yield text.check("flss.{surface}", worst, surface=surface.name)
    inside = np.abs(centre.sin_theta) < 0.999 * radius
    yield text.check("nmm.white", np.max(np.abs(centre.luminance[NMM][inside] - 1.0)))
    yield text.check("nmm.exact", centre.luminance[EXACT][inside].max())
    swing = {name: oscillation(fringes, name) for name in (EXACT, FLSS, PQ)}
    yield text.check("pq.fringes", swing[PQ] / swing[EXACT])
    yield text.check("flss.fringes", swing[FLSS] / swing[EXACT])
    yield from _symmetry(text, "gems", GEMS, blazed, views)
    bumps, lit = (lit_share(elaphe.surface, elaphe.methods[name]) for name in (BUMPS, EXACT))
    yield text.check("bumps.gaps", bumps, bound=_LIT_AT_MOST * lit)
    stam, exact_bands = (band_contrast(elaphe.luminance(name), views) for name in (STAM, EXACT))
    bound = VISIBLE_CONTRAST if elaphe.surface.scan else None
    yield text.check("gaussian.bands", stam, bound=bound)
    yield text.check("exact.bands", exact_bands)
    yield from _symmetry(text, "gaussian", STAM, elaphe, views)


def _symmetry(text: PageText, key: str, name: str, sheet: _Sheet, views: Map) -> Iterator[Check]:
    """Of a method that is even by construction, and of the surface, which is not."""
    found, exact = (lopsided(sheet.luminance(each), views) for each in (name, EXACT))
    yield text.check(f"{key}.even", found)
    yield text.check(f"{key}.exact", exact, surface=sheet.surface.name)


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


def _curves(text: PageText, centre: Profile, radius: float, fringes: Profile) -> bytes:
    def series(found: Profile, *styles: str) -> list[Series]:
        looks = zip(found.luminance.items(), COLOURS, styles, strict=False)
        return [Series(name, found.sin_theta, values, colour, style) for (name, values), colour, style in looks]

    white = [(-radius, ""), (radius, "white radius")]
    middle = text.chart("centre", series(centre, "-", "-"), marks=white)
    return charts([[middle, text.chart("fringes", series(fringes, "-", "--", "-"))]])
