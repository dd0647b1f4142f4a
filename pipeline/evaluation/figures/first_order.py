"""The first order of the bench's gratings and snakes at theta_i = 75 deg ([D14] 6.1), from which table 1 is made.

Every estimate of a row's period by the exact |P|^2: with the window and the light where [D14] may have had them, by
several definitions for the blazed grating, and by the methods of [S14].
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.figures import peaks
from pipeline.evaluation.figures.maps import window_on_sample_zero
from pipeline.evaluation.figures.page import BenchSurface
from pipeline.evaluation.figures.peaks import Band, Plane, Power
from pipeline.evaluation.methods.catalogue import FLSS, NMM, PQ
from pipeline.evaluation.methods.flss import Flss, Pq
from pipeline.optics.gratings import period_um, viewing_angle
from pipeline.optics.light import Light
from pipeline.surface.conditioning import condition
from pipeline.surface.heightfield import HeightField
from pipeline.surface.load import load_scan

THETA_I = np.radians(75.0)  # [D14] sec. 6.1
RANGE_NM = (380.0, 780.0)
_MIDDLE_NM = 550.0
# two lines closer than this are one under the window
_APART_SIGMAS = 3.0
_BRIGHTER = "light from the brighter side"
_TURNS_DEG = (-2.0, 2.0)
ANGLE_GRID_DEG = 0.01
_SHADERS: dict[str, type[Flss] | type[Pq]] = {FLSS: Flss, PQ: Pq}


@dataclass(frozen=True)
class Row:
    """A row of table 1: a surface, the axis of its period, the range to search, and the printed periods.

    key: its name in ids. published: mean and variance, nm and nm^2. Two printed periods are two lines that the
    brightest peak toggles between.
    """

    key: str
    label: str
    surface: Literal["blazed", "elaphe", "xenopeltis"]
    axis: Literal["x", "y"]
    search_um: tuple[float, float]
    published: tuple[tuple[float, float], ...]

    @property
    def planes(self) -> tuple[Plane, Plane]:
        """Light from either end of the axis."""
        along = 0.0 if self.axis == "x" else 0.5 * np.pi
        return Plane(THETA_I, along), Plane(THETA_I, along + np.pi)


ROWS = (
    Row("blazed", "Blazed grating", "blazed", "x", (2.0, 3.0), ((2500.34, 0.16),)),
    Row("elaphe", "Elaphe", "elaphe", "x", (0.95, 1.35), ((1144.28, 0.15),)),
    Row("along", "Xenopeltis, along fingers", "xenopeltis", "y", (1.35, 1.8), ((1552.27, 0.45),)),
    Row("across", "Xenopeltis, across fingers", "xenopeltis", "x", (0.42, 0.75), ((605.89, 0.12), (536.13, 0.04))),
)


@dataclass(frozen=True)
class Periods:
    """Periods (L,) at the wavelengths, nm."""

    nm: Array

    @property
    def mean(self) -> float:
        return float(self.nm.mean())

    @property
    def spread(self) -> tuple[float, float]:
        """Mean, nm, and variance, nm^2, as table 1 prints them."""
        return self.mean, float(self.nm.var())


@dataclass(frozen=True)
class Cut:
    """One plane of incidence on one surface: the reflectance (L, k) over frequencies (k,), and its peaks.

    brightest: of each wavelength, as [D14] takes it. lines: those that persist over all wavelengths, as peaks of the
    reflectance and freed of the factors on the window's line (pipeline.evaluation.figures.peaks).
    """

    plane: Plane
    reflectance: Array
    brightest: Periods
    lines: tuple[tuple[Periods, Periods], ...]

    @property
    def brightness(self) -> float:
        """Mean over wavelengths of the largest reflectance."""
        return float(self.reflectance.max(axis=1).mean())


@dataclass(frozen=True)
class FirstOrder:
    """A row on a surface: the plane whose first order is brighter, and the other side's."""

    row: Row
    surface: BenchSurface
    cut: Cut
    other: Cut

    @property
    def band(self) -> Band:
        return peaks.band_of(self.row.search_um, self.surface.sigma_um)


class Powers:
    """|P|^2 of height fields, exact and by the methods of [S14], each prepared once."""

    def __init__(self) -> None:
        self._made: dict[tuple[str, float | str], Power] = {}

    def of(self, name: str, field: HeightField, sigma_um: float) -> Power:
        """Return the power of a field under a window; each name must belong to one field."""
        return self._once((name, sigma_um), lambda: Reference(field, sigma_um, RANGE_NM[0]).power)

    def on(self, surface: BenchSurface, widths: float = 1.0) -> Power:
        """Return the power of a surface under its window, made wider by a factor."""
        return self.of(surface.name, surface.field, widths * surface.sigma_um)

    def by(self, name: str, surface: BenchSurface) -> Power:
        """Return the power of a surface by a method of [S14], over the range of table 1."""
        config = surface.config.model_copy(update={"light": Light(range_nm=RANGE_NM)})
        return self._once((surface.name, name), lambda: _SHADERS[name](surface.field, config).power)

    def _once(self, key: tuple[str, float | str], make: Callable[[], Power]) -> Power:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]


def first_order(row: Row, surface: BenchSurface, powers: Powers, lambda_nm: Array) -> FirstOrder:
    """Find a row's period on a surface with the light from both sides."""
    band = peaks.band_of(row.search_um, surface.sigma_um)
    cuts = [cut_of(powers.on(surface), plane, row, band, lambda_nm) for plane in row.planes]
    return FirstOrder(row, surface, *sorted(cuts, key=lambda cut: -cut.brightness))


def cut_of(power: Power, plane: Plane, row: Row, band: Band, lambda_nm: Array) -> Cut:
    """Compute the reflectance in one plane, its brightest peaks and the row's persistent lines."""
    f = band.grid()
    values = peaks.reflectance(power, plane, f, lambda_nm)
    best = peaks.peaks(power, plane, peaks.brightest(values, f), lambda_nm, band.sigma_f)
    lines = []
    for start in peaks.persistent(values, f, len(row.published), _APART_SIGMAS * band.sigma_f):
        raw = peaks.peaks(power, plane, np.full(len(lambda_nm), start), lambda_nm, band.sigma_f)
        lines.append((Periods(1e3 / raw), Periods(1e3 / peaks.lines(power, plane, raw, lambda_nm, band.sigma_f))))
    # the longer period first, as table 1 has them
    lines.sort(key=lambda pair: -pair[1].mean)
    return Cut(plane, values, Periods(1e3 / best), tuple(lines))


def _brightest(power: Power, plane: Plane, band: Band, lambda_nm: Array) -> Periods:
    """The period of each wavelength's largest reflectance, refined by a parabola."""
    f = band.grid()
    return Periods(1e3 / peaks.brightest(peaks.reflectance(power, plane, f, lambda_nm), f))


def blaze_of(found: FirstOrder, powers: Powers, lambda_nm: Array) -> dict[str, Periods]:
    """Estimate the period of the blazed grating by every definition.

    raw: peaks of eq. 4's reflectance. on_grid: raw, on angles 0.01 deg apart. shadowed: of the surface's material.
    wide: raw at twice the window. extrapolated: of raw and wide, to a line of no width. line: at one s.
    """
    surface, plane, width = found.surface, found.cut.plane, found.band.sigma_f
    raw, line = found.cut.lines[0]
    start, material = 1e3 / raw.nm, surface.config.material
    angles = np.degrees(viewing_angle(THETA_I, 1e-3 * raw.nm, 1e-3 * lambda_nm))
    rounded = np.radians(ANGLE_GRID_DEG * np.rint(angles / ANGLE_GRID_DEG))
    wide = Periods(1e3 / peaks.peaks(powers.on(surface, 2.0), plane, start, lambda_nm, 0.5 * width))
    return {
        "raw": raw,
        "on_grid": Periods(1e3 * period_um(THETA_I, rounded, 1e-3 * lambda_nm)),
        "shadowed": Periods(1e3 / peaks.peaks(powers.on(surface), plane, start, lambda_nm, width, material)),
        "wide": wide,
        # the shift is proportional to sigma_f^2, a quarter at twice the window
        "extrapolated": Periods((4.0 * wide.nm - raw.nm) / 3.0),
        "line": line,
    }


@dataclass(frozen=True)
class ByPosition:
    """The brightest period at 550 nm with the window at (count, count) positions on the patch.

    periods: nm (count, count, 2), with the light at the axis' start and at its other end. mean: nm (2,), of |P|^2
    averaged over all positions.
    """

    row: Row
    periods: Array
    mean: Array

    def quantiles(self, share: float) -> tuple[float, float]:
        """Return the ends, nm, between which all but a share of the positions lie, both sides together."""
        low, high = np.quantile(self.periods, [0.5 * share, 1.0 - 0.5 * share])
        return float(low), float(high)


def by_position(found: FirstOrder, count: int) -> ByPosition:
    """Move the window over the patch of a surface."""
    row, surface, plane, f, field = found.row, found.surface, found.cut.plane, found.band.grid(), found.surface.field
    if row.axis == "y":
        field = HeightField(np.ascontiguousarray(field.heights_um.T), field.pitch_um[::-1])
    s = peaks.phase_rate(plane, float(f.mean()), _MIDDLE_NM)
    values = peaks.by_position(field, surface.sigma_um, s, f, count)
    # C at the wavelength decides which of several lines is the brightest
    factor = peaks.reflectance(lambda uvw, nm: np.ones((len(uvw), len(nm))), plane, f, np.array([_MIDDLE_NM]))[0]
    periods = 1e3 / peaks.brightest((values * factor).reshape(-1, len(f)), f)
    mean = 1e3 / peaks.brightest(values.mean(axis=(0, 1)) * factor, f)
    return ByPosition(row, periods.reshape(values.shape[:-1]), mean)


def variants(found: FirstOrder, powers: Powers, lambda_nm: Array) -> Iterator[tuple[str, Periods]]:
    """Yield the brightest periods under every setting that [D14] leaves open."""
    surface, plane, band = found.surface, found.cut.plane, found.band
    sides = {_BRIGHTER: found.cut, "light from the other side": found.other}
    for name, cut in sides.items():
        yield name, cut.brightest
    corner = powers.of(f"{surface.name}, corner", window_on_sample_zero(surface.field), surface.sigma_um)
    for name, cut in sides.items():
        yield f"window on sample 0, {name}", _brightest(corner, cut.plane, band, lambda_nm)
    for turn in _TURNS_DEG:
        turned = Plane(plane.theta_i, plane.azimuth + np.radians(turn))
        periods = _brightest(powers.on(surface), turned, band, lambda_nm)
        yield f"{_BRIGHTER}, plane turned by {turn:+g}°", periods
    for level, field in _levelled(surface):
        power = powers.of(f"{surface.name}, {level}", field, surface.sigma_um)
        yield f"{_BRIGHTER}, levelling: {level}", _brightest(power, plane, band, lambda_nm)


def _levelled(surface: BenchSurface) -> Iterator[tuple[str, HeightField]]:
    """The scan under the levellings that its config does not choose; nothing for a recipe."""
    section = surface.config.surface
    if section.path is None:
        return
    scan = load_scan(section)[0]
    for level in ("none", "plane", "quadratic"):
        if level != section.levelling:
            yield level, condition(scan, level, section.clip_percentile)[0]


def by_shaders(found: FirstOrder, powers: Powers, lambda_nm: Array) -> dict[str, Periods]:
    """Return the brightest periods that the methods of [S14] find in the plane.

    NMM asks FLSS at the DFT's own frequencies alone, n over the patch's size: one of them is its peak.
    """
    plane, band, surface = found.cut.plane, found.band, found.surface
    flss, pq = (powers.by(name, surface) for name in (FLSS, PQ))
    size = surface.field.size_um[0 if found.row.axis == "x" else 1]
    coefficients = np.arange(np.ceil(band.low * size), np.floor(band.high * size) + 1.0) / size
    values = peaks.reflectance(flss, plane, coefficients, lambda_nm)
    return {
        FLSS: _brightest(flss, plane, band, lambda_nm),
        NMM: Periods(1e3 / coefficients[np.argmax(values, axis=1)]),
        PQ: _brightest(pq, plane, band, lambda_nm),
    }
