"""The first order of the bench's gratings and snakes at theta_i = 75 deg ([D14] 6.1): what table 1 is made of.

Every estimate of a row's period by the exact |P|^2: with the window and the light where [D14] may have had them, in
several ways for the blazed grating, and as the methods of [S14] find it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.figures import peaks
from pipeline.evaluation.figures.figure import Surface
from pipeline.evaluation.figures.peaks import Band, Plane, Power
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.optics.gratings import period_um, viewing_angle
from pipeline.optics.light import Light
from pipeline.surface.heightfield import HeightField

THETA_I = np.radians(75.0)  # [D14] sec. 6.1
RANGE_NM = (380.0, 780.0)
_MIDDLE_NM = 550.0
# two lines closer than this are one under the window
_APART_SIGMAS = 3.0
BRIGHTER = "light from the brighter side"
_TURNS_DEG = (-2.0, 2.0)
ANGLE_GRID_DEG = 0.01


@dataclass(frozen=True)
class Row:
    """A row of table 1: a surface, the axis its period is along, where to look, and what is printed, nm and nm^2.

    Two printed periods are two lines that the brightest peak toggles between.
    """

    label: str
    surface: Literal["blazed", "elaphe", "xenopeltis"]
    axis: Literal["x", "y"]
    search_um: tuple[float, float]
    published: tuple[tuple[float, float], ...]


ROWS = (
    Row("Blazed grating", "blazed", "x", (2.0, 3.0), ((2500.34, 0.16),)),
    Row("Elaphe", "elaphe", "x", (0.95, 1.35), ((1144.28, 0.15),)),
    Row("Xenopeltis, along fingers", "xenopeltis", "y", (1.35, 1.8), ((1552.27, 0.45),)),
    Row("Xenopeltis, across fingers", "xenopeltis", "x", (0.42, 0.75), ((605.89, 0.12), (536.13, 0.04))),
)


@dataclass(frozen=True)
class Periods:
    """Periods (L,) at the wavelengths, nm."""

    nm: Array

    @property
    def mean(self) -> float:
        return float(self.nm.mean())

    @property
    def variance(self) -> float:
        return float(self.nm.var())

    def __str__(self) -> str:
        return f"{self.mean:.2f} ({self.variance:.2f})"


@dataclass(frozen=True)
class Cut:
    """One plane of incidence on one surface: the reflectance (L, k) over frequencies `f` (k,), and its peaks.

    brightest: of each wavelength, as [D14] takes it. lines: those that persist over all wavelengths, as peaks of the
    reflectance and freed of what multiplies the window's line (pipeline.evaluation.figures.peaks).
    """

    plane: Plane
    f: Array
    reflectance: Array
    brightest: Periods
    lines: tuple[tuple[Periods, Periods], ...]

    @property
    def brightness(self) -> float:
        """Mean over wavelengths of the largest reflectance."""
        return float(self.reflectance.max(axis=1).mean())


@dataclass(frozen=True)
class Case:
    """A row on a surface: the plane whose first order is brighter, and the other side's."""

    row: Row
    surface: Surface
    cut: Cut
    other: Cut


class Powers:
    """The exact |P|^2 of fields, each made once."""

    def __init__(self) -> None:
        self._made: dict[tuple[str, float], tuple[HeightField, Reference]] = {}

    def of(self, name: str, field: HeightField, sigma_um: float) -> Power:
        key = (name, sigma_um)
        if key not in self._made:
            self._made[key] = (field, Reference(field, sigma_um, RANGE_NM[0]))
        return self._made[key][1].power


# --- one surface, one plane --------------------------------------------------------------------------


def case_of(row: Row, surface: Surface, powers: Powers, lambda_nm: Array) -> Case:
    power = powers.of(surface.name, surface.field, surface.config.coherence.sigma_um)
    cuts = [cut_of(power, plane, row, band_for(row, surface), lambda_nm) for plane in sides(row)]
    cuts.sort(key=lambda cut: -cut.brightness)
    return Case(row, surface, *cuts)


def sides(row: Row) -> tuple[Plane, Plane]:
    """Light from either end of the row's axis."""
    along = 0.0 if row.axis == "x" else 0.5 * np.pi
    return Plane(THETA_I, along), Plane(THETA_I, along + np.pi)


def band_for(row: Row, surface: Surface) -> Band:
    return peaks.band_of(row.search_um, surface.config.coherence.sigma_um)


def cut_of(power: Power, plane: Plane, row: Row, band: Band, lambda_nm: Array) -> Cut:
    """The reflectance in one plane, its brightest peaks and the row's persistent lines."""
    f = band.grid()
    values = peaks.reflectance(power, plane, f, lambda_nm)
    best = peaks.peaks(power, plane, peaks.brightest(values, f), lambda_nm, band.sigma_f)
    lines = []
    for start in peaks.persistent(values, f, len(row.published), _APART_SIGMAS * band.sigma_f):
        raw = peaks.peaks(power, plane, np.full(len(lambda_nm), start), lambda_nm, band.sigma_f)
        lines.append((_periods(raw), _periods(peaks.lines(power, plane, raw, lambda_nm, band.sigma_f))))
    # the longer period first, as table 1 has them
    lines.sort(key=lambda pair: -pair[1].mean)
    return Cut(plane, f, values, _periods(best), tuple(lines))


def _periods(f: Array) -> Periods:
    return Periods(1e3 / f)


def _brightest(power: Power, plane: Plane, band: Band, lambda_nm: Array) -> Periods:
    """The period of each wavelength's largest reflectance, refined by a parabola."""
    f = band.grid()
    return _periods(peaks.brightest(peaks.reflectance(power, plane, f, lambda_nm), f))


# --- the blazed grating ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Blaze:
    """The same order, estimated in several ways.

    raw: peaks of eq. 4's reflectance. shadowed: of the surface's material. wide: raw at twice the window.
    extrapolated: of raw and wide, to a line of no width. line: at one s. on_grid: raw, on angles 0.01 deg apart.
    """

    raw: Periods
    shadowed: Periods
    wide: Periods
    extrapolated: Periods
    line: Periods
    on_grid: Periods


def blaze_of(case: Case, powers: Powers, lambda_nm: Array) -> Blaze:
    surface, plane = case.surface, case.cut.plane
    sigma = surface.config.coherence.sigma_um
    band = band_for(case.row, surface)
    narrow, wide = (powers.of(surface.name, surface.field, factor * sigma) for factor in (1.0, 2.0))
    raw, line = case.cut.lines[0]
    start = 1e3 / raw.nm
    shadowed = peaks.peaks(narrow, plane, start, lambda_nm, band.sigma_f, surface.config.material)
    wider = _periods(peaks.peaks(wide, plane, start, lambda_nm, 0.5 * band.sigma_f))
    # the shift goes with sigma_f^2, a quarter at twice the window
    extrapolated = Periods((4.0 * wider.nm - raw.nm) / 3.0)
    angles = np.degrees(viewing_angle(THETA_I, 1e-3 * raw.nm, 1e-3 * lambda_nm))
    rounded = np.radians(ANGLE_GRID_DEG * np.rint(angles / ANGLE_GRID_DEG))
    on_grid = Periods(1e3 * period_um(THETA_I, rounded, 1e-3 * lambda_nm))
    return Blaze(raw, _periods(shadowed), wider, extrapolated, line, on_grid)


# --- where the window stands -------------------------------------------------------------------------


@dataclass(frozen=True)
class Walk:
    """The brightest period at 550 nm with the window at (places, places) places of the patch.

    periods: nm (places, places, 2), with the light at the axis' start and at its other end. mean: nm (2,), of |P|^2
    averaged over all places.
    """

    case: Case
    periods: Array
    mean: Array

    def quantiles(self, share: float) -> tuple[float, float]:
        """What all but `share` of the places lie between, nm, both sides together."""
        low, high = np.quantile(self.periods, [0.5 * share, 1.0 - 0.5 * share])
        return float(low), float(high)


def walk_of(case: Case, places: int) -> Walk:
    row, surface = case.row, case.surface
    band, plane = band_for(row, surface), case.cut.plane
    f = band.grid()
    field = surface.field if row.axis == "x" else _transposed(surface.field)
    s = peaks.phase_rate(plane, float(f.mean()), _MIDDLE_NM)
    values = peaks.walk(field, surface.config.coherence.sigma_um, s, f, places)
    # C at the wavelength decides which of several lines is the brightest
    factor = peaks.reflectance(_mirror, plane, f, np.array([_MIDDLE_NM]))[0]
    periods = 1e3 / peaks.brightest((values * factor).reshape(-1, len(f)), f)
    mean = 1e3 / peaks.brightest(values.mean(axis=(0, 1)) * factor, f)
    return Walk(case, periods.reshape(values.shape[:-1]), mean)


def _mirror(uvw: Array, lambda_nm: Array) -> Array:
    """|P|^2 = 1 everywhere."""
    return np.ones((len(uvw), len(lambda_nm)))


def _transposed(field: HeightField) -> HeightField:
    """The field with x and y changed."""
    return HeightField(np.ascontiguousarray(field.heights_um.T), field.pitch_um[::-1])


def _on_sample_zero(field: HeightField) -> HeightField:
    """The patch with its sample 0 where the window is: the window on the patch's corner, its seams under it."""
    ny, nx = field.shape
    return HeightField(np.roll(field.heights_um, (ny // 2, nx // 2), axis=(0, 1)), field.pitch_um)


def variants(case: Case, powers: Powers, lambda_nm: Array) -> Iterator[tuple[str, Periods]]:
    """The brightest periods under everything that [D14] does not tell."""
    surface, plane, band = case.surface, case.cut.plane, band_for(case.row, case.surface)
    sigma = surface.config.coherence.sigma_um
    sides = {BRIGHTER: case.cut, "light from the other side": case.other}
    for name, cut in sides.items():
        yield name, cut.brightest
    corner = powers.of(f"{surface.name}, corner", _on_sample_zero(surface.field), sigma)
    for name, cut in sides.items():
        yield f"window on sample 0, {name}", _brightest(corner, cut.plane, band, lambda_nm)
    here = powers.of(surface.name, surface.field, sigma)
    for turn in _TURNS_DEG:
        turned = Plane(plane.theta_i, plane.azimuth + np.radians(turn))
        yield f"{BRIGHTER}, plane turned by {turn:+g}°", _brightest(here, turned, band, lambda_nm)
    for level, field in _levelled(surface):
        power = powers.of(f"{surface.name}, {level}", field, sigma)
        yield f"{BRIGHTER}, levelling: {level}", _brightest(power, plane, band, lambda_nm)


def _levelled(surface: Surface) -> Iterator[tuple[str, HeightField]]:
    """The scan under the levellings that its config does not choose; nothing for a recipe."""
    section = surface.config.surface
    if section.path is None:
        return
    from pipeline.surface.conditioning import condition
    from pipeline.surface.load import load_scan

    scan = load_scan(section)[0]
    for level in ("none", "plane", "quadratic"):
        if level != section.levelling:
            yield level, condition(scan, level, section.clip_percentile)[0]


class ShaderPowers:
    """|P|^2 by the methods of [S14] that answer single wavelengths, each made once a surface."""

    def __init__(self) -> None:
        self._made: dict[tuple[str, str], Power] = {}

    def of(self, name: str, surface: Surface) -> Power:
        if (name, surface.name) not in self._made:
            config = surface.config.model_copy(update={"light": Light(range_nm=RANGE_NM)})
            method = METHODS[name](surface.field, config)
            assert isinstance(method, Monochromatic)
            self._made[name, surface.name] = method.power
        return self._made[name, surface.name]


def by_shaders(case: Case, powers: ShaderPowers, lambda_nm: Array) -> dict[str, Periods]:
    """The brightest periods that the methods of [S14] find in the case's plane.

    NMM asks FLSS at the DFT's own frequencies alone, n over the patch's size: one of them is its peak.
    """
    plane, band = case.cut.plane, band_for(case.row, case.surface)
    flss = powers.of("FLSS", case.surface)
    size = case.surface.field.size_um[0 if case.row.axis == "x" else 1]
    coefficients = np.arange(np.ceil(band.low * size), np.floor(band.high * size) + 1.0) / size
    values = peaks.reflectance(flss, plane, coefficients, lambda_nm)
    return {
        "FLSS": _brightest(flss, plane, band, lambda_nm),
        "NMM": _periods(coefficients[np.argmax(values, axis=1)]),
        "PQ": _brightest(powers.of("PQ", case.surface), plane, band, lambda_nm),
    }
