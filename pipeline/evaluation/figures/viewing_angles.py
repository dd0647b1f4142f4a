"""[D14] table 1 and fig. 7: peak viewing angles of gratings and snakes at theta_i = 75 deg, and their periods."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import peaks
from pipeline.evaluation.figures.first_order import (
    ANGLE_GRID_DEG,
    RANGE_NM,
    ROWS,
    THETA_I,
    Blaze,
    ByPosition,
    FirstOrder,
    Periods,
    Powers,
    blaze_of,
    by_position,
    by_shaders,
    first_order,
    variants,
)
from pipeline.evaluation.figures.page import Bench, Cell, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.plots import viewing_angle_plots as plots
from pipeline.evaluation.plots.charts import Series
from pipeline.evaluation.plots.palette import ORANGE, SKY, VERMILION
from pipeline.optics.gratings import viewing_angle
from pipeline.progress import Progress

_STEP_NM, _QUICK_STEP_NM = 5.0, 20.0
_POSITIONS, _QUICK_POSITIONS = 24, 10
_TRUE_NM = 2500.0
_WITHIN_NM = 0.05  # of the blazed grating's period, as this bench asks
# positions of the window left out on either side: a published period beyond all others is none of this scan's
_RARE = 0.02
_NEAR = 0.01
_SHOWN_DEG, _VIEWS, _QUICK_VIEWS = 89.0, 1200, 500
_IMAGE_STEP_NM = 2.5  # at 5 nm the steps of narrow lines would be seen
_MARGIN_DEG = 4.0
_HEADING, _SPREAD = "mean (variance), nm (nm²)", "{:.2f} ({:.2f})"
_SPECKLE = (
    "A snake's first order is no line but speckle: grains as wide as the window's line, of which one is the "
    "brightest at most wavelengths. Which one depends on the position of the window and on the side of the light. "
    "The small variance shows that a grain stays where it is, not how well the skin's period is known."
)
_RECIPES = "The snakes are recipes here: their periods are their own, not those of the published scans."
_SCANS = (
    "The scans are public copies, and how the published ones were cut and levelled is not stated. Levelling moves "
    "a grain by a few nm at most; the position of the window and the side of the light choose another. Public codes "
    "have the window on sample 0, with the patch's seams under its middle; this project has it on the middle. "
    f"A published period is among those of a scan if at least {50 * _RARE:g} % of the windows have a shorter one, "
    "and as many a longer one."
)

_Variants = Mapping[str, Periods]


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page. Snakes without a scan are their recipes, whose periods are reported and not judged."""
    lambda_nm = np.arange(RANGE_NM[0], RANGE_NM[1] + 1.0, _QUICK_STEP_NM if bench.quick else _STEP_NM)
    positions, views = (_QUICK_POSITIONS, _QUICK_VIEWS) if bench.quick else (_POSITIONS, _VIEWS)
    powers = Powers()
    found, shaders, settings, moved = [], [], [], []
    for done, row in enumerate(ROWS, start=1):
        each = first_order(row, getattr(bench, row.surface), powers, lambda_nm)
        found.append(each)
        shaders.append(by_shaders(each, powers, lambda_nm))
        if row.surface != "blazed":
            settings.append(dict(variants(each, powers, lambda_nm)))
            moved.append(by_position(each, positions))
        progress("viewing angles", done / len(ROWS))
    snakes, blaze = found[1:], blaze_of(found[0], powers, lambda_nm)
    return Page(
        name="viewing_angles",
        title="Peak viewing angles at 75 degrees and the periods in them",
        source="[D14] table 1, fig. 7, eq. 13",
        expected="The angle of the largest reflectance follows the grating equation. The periods it gives, one a "
        "wavelength, have mean (variance) 2500.34 (0.16) nm for the blazed grating of 2500 nm, 1144.28 (0.15) for "
        "Elaphe, 1552.27 (0.45) along and 605.89 (0.12), 536.13 (0.04) across the fingers of Xenopeltis. The blazed "
        f"grating must come out within {_WITHIN_NM} nm.",
        checks=[*_blaze_checks(blaze), *snake_checks(snakes, moved)],
        tables=[
            _periods_table(found),
            _blaze_table(blaze),
            _shaders_table(found, shaders),
            _variants_table(snakes, settings),
            _positions_table(moved),
        ],
        pictures=_pictures(found, powers, moved, lambda_nm, views),
        remarks=[*_blaze_remarks(found[0], blaze), _SPECKLE, *_snake_remarks(snakes, settings)],
    )


def _blaze_checks(blaze: Blaze) -> Iterator[Check]:
    published = ROWS[0].published[0][0]
    for key, what, found, bound, source in (
        ("line", "the order's line, at one s", blaze.line, _TRUE_NM, "the recipe"),
        ("extrapolated", "peaks under sigma and 2 sigma, extrapolated", blaze.extrapolated, _TRUE_NM, "the recipe"),
        ("peak", "peaks as published (eq. 4)", blaze.raw, published, "[D14] table 1"),
    ):
        what = f"Blazed grating, mean period: {what}"
        yield Check(f"blazed.{key}", what, found.mean, "=", bound, _WITHIN_NM, unit="nm", source=source)


def snake_checks(snakes: Sequence[FirstOrder], moved: Sequence[ByPosition]) -> Iterator[Check]:
    """The published periods; of scans also whether these are among those that the window can meet on them."""
    for each, positions in zip(snakes, moved, strict=True):
        row, source = each.row, "[D14] table 1"
        for i, ((_, line), (published, _)) in enumerate(zip(each.cut.lines, row.published, strict=True), start=1):
            what = f"{row.label}: mean period of line {i}"
            yield Check(f"{row.key}.line{i}", what, line.mean, "=", published, unit="nm", source=source)
            if each.surface.scan:
                shorter = 100.0 * float(np.mean(positions.periods < published))
                what = f"{row.label}: windows on this scan with a brightest period shorter than {published:g} nm"
                yield Check(f"{row.key}.windows{i}", what, shorter, unit="%", source=source)


def _periods_table(found: Sequence[FirstOrder]) -> PageTable:
    rows = []
    for each in found:
        for i, ((raw, line), printed) in enumerate(zip(each.cut.lines, each.row.published, strict=True)):
            brightest = each.cut.brightest.spread if i == 0 else None
            apart = 100.0 * (line.mean / printed[0] - 1.0)
            rows.append((each.row.label, _light_deg(each), printed, brightest, raw.spread, line.spread, apart))
    return PageTable(
        "periods",
        f"Periods by eq. 13 over 380-780 nm: {_HEADING}. Light from the side whose first order is brighter",
        [
            Column("surface"),
            Column("light at φ", "{:.0f}°"),
            *numbers(_SPREAD, "published", "brightest of each wavelength", "peak", "line"),
            Column("line to published", "{:+.2f} %"),
        ],
        rows,
    )


def _light_deg(found: FirstOrder) -> float:
    return float(np.degrees(found.cut.plane.azimuth))


def _blaze_table(blaze: Blaze) -> PageTable:
    estimates = {
        "peak of C |P|², eq. 4: as published": blaze.raw,
        f"the same, on angles {ANGLE_GRID_DEG}° apart": blaze.on_grid,
        "peak of C |P|², C of the surface's material": blaze.shadowed,
        "peak of C |P|², eq. 4, under 2 sigma": blaze.wide,
        "peaks under sigma and 2 sigma, extrapolated": blaze.extrapolated,
        "line: peak of |P(f; s)|² at one s": blaze.line,
    }
    return PageTable(
        "blazed",
        f"The blazed grating of {_TRUE_NM:g} nm: one order, six estimates; published 2500.34 (0.16)",
        [
            Column("estimate"),
            Column("mean, nm", "{:.4f}"),
            Column("variance, nm²", "{:.1e}"),
            Column("off by, nm", "{:+.4f}"),
        ],
        [(name, *found.spread, found.mean - _TRUE_NM) for name, found in estimates.items()],
    )


def _shaders_table(found: Sequence[FirstOrder], shaders: Sequence[_Variants]) -> PageTable:
    return PageTable(
        "methods",
        f"Brightest of each wavelength, by the shaders of [S14] on the same data: {_HEADING}. The parts of [S14] at "
        "hand print no such table",
        [Column("surface"), *numbers(_SPREAD, "exact", *shaders[0])],
        [
            (each.row.label, each.cut.brightest.spread, *(periods.spread for periods in of.values()))
            for each, of in zip(found, shaders, strict=True)
        ],
    )


def _variants_table(snakes: Sequence[FirstOrder], settings: Sequence[_Variants]) -> PageTable:
    names = list(dict.fromkeys(name for of in settings for name in of))
    printed = [", ".join(_SPREAD.format(*each) for each in snake.row.published) for snake in snakes]
    rows: list[tuple[Cell, ...]] = [("published", *printed)]
    rows += [(name, *(of[name].spread if name in of else None for of in settings)) for name in names]
    return PageTable(
        "settings",
        f"Settings that [D14] does not state: brightest of each wavelength, {_HEADING}. Where the variance is large, "
        "the peak toggles between lines",
        [Column("setting"), *numbers(_SPREAD, *(snake.row.label for snake in snakes))],
        rows,
    )


def _positions_table(moved: Sequence[ByPosition]) -> PageTable:
    count = len(moved[0].periods)
    return PageTable(
        "positions",
        f"Brightest period at 550 nm, nm: the window at {count} x {count} positions, light from both sides",
        [
            Column("surface"),
            Column("published", "{:g}"),
            *numbers("{:.0f} to {:.0f}", "90 % of positions", f"{100 * (1 - _RARE):.0f} % of positions"),
            Column(f"within {100 * _NEAR:g} %", "{:.0%}"),
            Column("of |P|² averaged over positions, by side", "{:.0f}, {:.0f}"),
        ],
        [
            (
                each.row.label,
                mean,
                each.quantiles(0.1),
                each.quantiles(_RARE),
                float(np.mean(np.abs(each.periods / mean - 1.0) <= _NEAR)),
                tuple(each.mean),
            )
            for each in moved
            for mean, _ in each.row.published
        ],
    )


def _pictures(
    found: Sequence[FirstOrder], powers: Powers, moved: Sequence[ByPosition], lambda_nm: Array, views: int
) -> list[Picture]:
    pictures, fine_nm = [], np.arange(RANGE_NM[0], RANGE_NM[1] + 1.0, _IMAGE_STEP_NM)
    angles = np.linspace(-_SHOWN_DEG, _SHOWN_DEG, views)
    for each in found:
        peak = _angles(each.cut.brightest.nm, lambda_nm)
        curves = [Series("peak of each wavelength", lambda_nm, peak, VERMILION, "-")]
        for (_, line), colour in zip(each.cut.lines, (SKY, ORANGE), strict=False):
            ideal = _angles(np.full(len(lambda_nm), line.mean), lambda_nm)
            curves.append(Series(f"eq. 13, {line.mean:.2f} nm", lambda_nm, ideal, colour, ":"))
        seen = np.concatenate([curve.y for curve in curves])
        near = np.linspace(np.nanmin(seen) - _MARGIN_DEG, np.nanmax(seen) + _MARGIN_DEG, views // 2)
        whole, close = ((at, _image(each, powers, fine_nm, at)) for at in (angles, near))
        title = f"{each.row.label}, {each.surface.name}: light at 75°, φ = {_light_deg(each):.0f}°"
        png = plots.reflectance(title, fine_nm, whole, close, curves)
        pictures.append(Picture(png, f"Reflectance over viewing angle and wavelength: {each.row.label}"))
    panels = [
        plots.Histogram(each.row.label, each.periods, [mean for mean, _ in each.row.published]) for each in moved
    ]
    caption = "The brightest period at 550 nm by the position of the window on the patch, light from either side"
    return [*pictures, Picture(plots.histograms(panels), caption)]


def _image(found: FirstOrder, powers: Powers, lambda_nm: Array, angles_deg: Array) -> Array:
    """C |P|^2 (angles, L)."""
    f = (np.sin(THETA_I) - np.sin(np.radians(angles_deg))) / (1e-3 * lambda_nm[:, None])
    return peaks.reflectance(powers.on(found.surface), found.cut.plane, f, lambda_nm).T


def _angles(period_nm: Array, lambda_nm: Array) -> Array:
    """Viewing angles, degrees."""
    return np.degrees(viewing_angle(THETA_I, period_nm, lambda_nm))


def _blaze_remarks(found: FirstOrder, blaze: Blaze) -> list[str]:
    samples = 1e-3 * _TRUE_NM / found.surface.field.pitch_um[0]
    shift, left = blaze.raw.mean - _TRUE_NM, blaze.line.mean - _TRUE_NM
    return [
        (
            "An order under the window is a line exp(-(f - f0)² / σ_f²), and every factor on it moves its peak by "
            "σ_f² / 2 times the logarithmic slope: Fresnel's term, G / w², and the order's own strength, which "
            f"changes with w. For the blazed grating that is {shift:+.3f} nm; published is +0.34 nm. A line is the "
            "largest |P(f; s)|² at the fixed s = k |w| of its own peak: no factor is left, so nothing moves it. "
            "Peaks under twice the window move a quarter as far; extrapolated, they give the same without using s."
        ),
        (
            f"The line's remaining {left:+.4f} nm are the grating's sampling: at {samples:.2f} samples a period, "
            "orders beyond the Nyquist limit fold back next to the first."
        ),
        (
            f"The published variance of 0.16 nm² is that of angles {ANGLE_GRID_DEG}° apart "
            f"({blaze.on_grid.spread[1]:.2f}); exact peaks have {blaze.raw.spread[1]:.4f}."
        ),
    ]


def _snake_remarks(snakes: Sequence[FirstOrder], settings: Sequence[_Variants]) -> list[str]:
    """Of scans also the settings that come nearest to the published periods."""
    if not any(snake.surface.scan for snake in snakes):
        return [_RECIPES]
    remarks = [_SCANS]
    for snake, of in zip(snakes, settings, strict=True):
        nearest = []
        for mean, _ in snake.row.published:
            name = min(of, key=lambda each: abs(of[each].mean - mean))
            nearest.append(f"{mean:g}: {_SPREAD.format(*of[name].spread)} ({name})")
        remarks.append(f"{snake.row.label}, the settings nearest to the published means: {'; '.join(nearest)}.")
    return remarks
