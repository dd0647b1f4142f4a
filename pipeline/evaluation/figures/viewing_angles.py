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
from pipeline.evaluation.figures.page import Bench, Cell, Page, PageTable, PageText, Picture, numbers
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
_SPREAD = "{:.2f} ({:.2f})"
_TEXT = PageText(
    "viewing_angles",
    within=_WITHIN_NM,
    true_nm=_TRUE_NM,
    angle_grid=ANGLE_GRID_DEG,
    rare=50 * _RARE,
    common=100 * (1 - _RARE),
    near=100 * _NEAR,
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
    return _TEXT.page(
        checks=[*_blaze_checks(blaze), *snake_checks(snakes, moved)],
        tables=list(_tables(found, shaders, settings, blaze, moved)),
        pictures=_pictures(found, powers, moved, lambda_nm, views),
        remarks=[*_blaze_remarks(found[0], blaze), _TEXT.remark("speckle"), *_snake_remarks(snakes, settings)],
    )


def _blaze_checks(blaze: _Variants) -> Iterator[Check]:
    published = ROWS[0].published[0][0]
    for key, found, bound in (
        ("line", blaze["line"], _TRUE_NM),
        ("extrapolated", blaze["extrapolated"], _TRUE_NM),
        ("peak", blaze["raw"], published),
    ):
        yield _TEXT.check(f"blazed.{key}", found.mean, bound=bound, tolerance=_WITHIN_NM)


def snake_checks(snakes: Sequence[FirstOrder], moved: Sequence[ByPosition]) -> Iterator[Check]:
    """The published periods; of scans also whether these are among those that the window can meet on them."""
    for each, positions in zip(snakes, moved, strict=True):
        for i, ((_, line), (published, _)) in enumerate(
            zip(each.cut.lines, each.row.published, strict=True), start=1
        ):
            yield _TEXT.check("{row.key}.line{i}", line.mean, bound=published, row=each.row, i=i)
            if each.surface.scan:
                shorter = 100.0 * float(np.mean(positions.periods < published))
                yield _TEXT.check("{row.key}.windows{i}", shorter, row=each.row, i=i, published=published)


def _tables(
    found: Sequence[FirstOrder],
    shaders: Sequence[_Variants],
    settings: Sequence[_Variants],
    blaze: _Variants,
    moved: Sequence[ByPosition],
) -> Iterator[PageTable]:
    rows: list[tuple[Cell, ...]] = []
    for each in found:
        azimuth = float(np.degrees(each.cut.plane.azimuth))
        for i, ((raw, line), printed) in enumerate(zip(each.cut.lines, each.row.published, strict=True)):
            brightest, apart = each.cut.brightest.spread if i == 0 else None, 100.0 * (line.mean / printed[0] - 1.0)
            rows.append((each.row.label, azimuth, printed, brightest, raw.spread, line.spread, apart))
    yield _TEXT.table("periods", rows)

    names = _TEXT.words["tables"]["blazed"]
    rows = [(_TEXT.fill(names[key]), *of.spread, of.mean - _TRUE_NM) for key, of in blaze.items()]
    yield _TEXT.table("blazed", rows)

    rows = [
        (each.row.label, each.cut.brightest.spread, *(periods.spread for periods in of.values()))
        for each, of in zip(found, shaders, strict=True)
    ]
    yield _TEXT.table("methods", rows, numbers(_SPREAD, *shaders[0]))

    snakes = [each.row for each in found[1:]]
    rows = [("published", *(", ".join(_SPREAD.format(*each) for each in snake.published) for snake in snakes))]
    for name in dict.fromkeys(name for of in settings for name in of):
        rows.append((name, *(of[name].spread if name in of else None for of in settings)))
    yield _TEXT.table("settings", rows, numbers(_SPREAD, *(snake.label for snake in snakes)))

    rows = []
    for by in moved:
        for mean, _ in by.row.published:
            near = float(np.mean(np.abs(by.periods / mean - 1.0) <= _NEAR))
            rows.append((by.row.label, mean, by.quantiles(0.1), by.quantiles(_RARE), near, tuple(by.mean)))
    yield _TEXT.table("positions", rows, count=len(moved[0].periods))


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
        title = f"{each.row.label}, {each.surface.name}: light at 75°, φ = {np.degrees(each.cut.plane.azimuth):.0f}°"
        png = plots.reflectance(title, fine_nm, whole, close, curves)
        pictures.append(_TEXT.picture("reflectance", png, label=each.row.label))
    panels = [(each.row.label, each.periods, [mean for mean, _ in each.row.published]) for each in moved]
    return [*pictures, _TEXT.picture("positions", plots.histograms(panels))]


def _image(found: FirstOrder, powers: Powers, lambda_nm: Array, angles_deg: Array) -> Array:
    """C |P|^2 (angles, L)."""
    f = (np.sin(THETA_I) - np.sin(np.radians(angles_deg))) / (1e-3 * lambda_nm[:, None])
    return peaks.reflectance(powers.on(found.surface), found.cut.plane, f, lambda_nm).T


def _angles(period_nm: Array, lambda_nm: Array) -> Array:
    """Viewing angles, degrees."""
    return np.degrees(viewing_angle(THETA_I, period_nm, lambda_nm))


def _blaze_remarks(found: FirstOrder, blaze: _Variants) -> list[str]:
    samples = 1e-3 * _TRUE_NM / found.surface.field.pitch_um[0]
    return [
        _TEXT.remark("line", shift=blaze["raw"].mean - _TRUE_NM),
        _TEXT.remark("sampling", left=blaze["line"].mean - _TRUE_NM, samples=samples),
        _TEXT.remark("variance", on_grid=blaze["on_grid"].spread[1], raw=blaze["raw"].spread[1]),
    ]


def _snake_remarks(snakes: Sequence[FirstOrder], settings: Sequence[_Variants]) -> list[str]:
    """Of scans also the settings that come nearest to the published periods."""
    if not any(snake.surface.scan for snake in snakes):
        return [_TEXT.remark("recipes")]
    remarks = [_TEXT.remark("scans")]
    for snake, of in zip(snakes, settings, strict=True):
        nearest = []
        for mean, _ in snake.row.published:
            name = min(of, key=lambda each: abs(of[each].mean - mean))
            nearest.append(f"{mean:g}: {_SPREAD.format(*of[name].spread)} ({name})")
        remarks.append(_TEXT.remark("nearest", label=snake.row.label, nearest="; ".join(nearest)))
    return remarks
