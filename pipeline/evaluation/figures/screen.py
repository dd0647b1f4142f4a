"""[D14] table 2, sec. 6.2 and 6.3: a gold-coated Elaphe throws a supercontinuum laser onto a screen."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import DEFAULT_DELTA_E, Accuracy
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import planes
from pipeline.evaluation.figures.bands import VISIBLE_CONTRAST, Bands
from pipeline.evaluation.figures.laser_screen import DELTA_E, LIGHT, Colour, Screen, experiment, screen_bands
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.methods.catalogue import BUMPS, EXACT, METHODS, OURS, PAPER, STAM
from pipeline.evaluation.methods.paper_look_up import PaperLookUp
from pipeline.evaluation.methods.stam_gaussian import DiscWindow, StamGaussian
from pipeline.evaluation.plots import screen_plots
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics import geometry
from pipeline.optics.colour import EXPOSURES_RU, delta_e
from pipeline.progress import Progress

OURS_DEFAULT, PAPER_AT_ZERO, STAM_DISC = "polar table, default", "D14 look-up, sample 0", "Stam Gaussian, disc"
_NAMES = {
    OURS: f"ours: polar table, budget {DELTA_E:g}",
    OURS_DEFAULT: f"ours, default budget {DEFAULT_DELTA_E:g}",
    PAPER: "[D14]'s table, 501 x 501",
    PAPER_AT_ZERO: "[D14]'s table, its window on sample 0",
    STAM: "Stam, Gaussian surface",
    STAM_DISC: "Stam, Gaussian surface, 50 µm disc",
    BUMPS: "Stam, periodic bumps",
}
# published means of table 2, by exposure
PUBLISHED = {
    PAPER: dict(zip(EXPOSURES_RU, (0.039, 4.295, 11.544), strict=True)),
    STAM: dict(zip(EXPOSURES_RU, (0.067, 7.843, 23.704), strict=True)),
}
_RU_COLUMNS = [f"{ru:g} RU" for ru in EXPOSURES_RU]
_BETTER = 10.0
_AVERAGED = 3
_OTHER_SIDE_MM = 100.0
_CHECKED_PIXELS, _CHECKED_NM, _SEED = 5, (450.0, 550.0, 700.0), 4
_BENCHMARK_ERROR = 1e-9
_MODELLED = (
    "Errors are of the radiance that the shader shows; neither the screen's own cosine nor a white balance "
    "is applied. The laser's spectrum is a model (supercontinuum.csv), and the screen's size is not published. "
    "On a smaller screen all pixels are nearer to the spot, brighter, and err more."
)
_ON_A_SCAN = (
    "Stam's Gaussian surface knows the heights by their correlation alone, which is the same along and "
    "against the fingers: its image is symmetric and without speckle. Of the secondary bands a faint pair is "
    "left, where [D14] sees none: this scan's correlation has the period along its fingers, and for low "
    "heights the formula is their power spectrum. A vertical band appears next to the spot, as in [D14] 6.3."
)
_ON_A_RECIPE = (
    "This Elaphe is a recipe whose fingers have a firm period along their length. Their correlation has "
    "it too, so Stam's Gaussian surface does show horizontal bands here, unlike on the scan."
)

# CIELAB errors (pixels, pixels) of methods by name, at exposures
_Errors = Mapping[str, Mapping[float, Array]]


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page, on the bench's Elaphe."""
    surface = replace(bench.elaphe, config=experiment(bench.elaphe.config))
    config, screen = surface.config, Screen(LIGHT, 31 if bench.quick else 101)
    reference = surface.reference()

    def exact(wi: Array, wr: Array) -> Array:
        return reference.xyz(config.light, config.material, wi, wr)

    colours = _colours(surface)
    truth = screen.show(exact)
    progress("screen", 0.1)
    images = {name: screen.show(colour) for name, colour in colours.items()}
    errors = _errors(images, truth)
    progress("screen", 0.4)
    averaged = _compared(replace(screen, samples=_AVERAGED), exact, colours, (OURS, PAPER, STAM, BUMPS))
    progress("screen", 0.8)
    smaller = replace(screen, side_mm=_OTHER_SIDE_MM)
    nearer = {} if bench.quick else _compared(smaller, exact, colours, (OURS, PAPER, PAPER_AT_ZERO, STAM))
    # periodic bumps leave dots, and no bands
    banded = {EXACT: truth, **{name: image for name, image in images.items() if name != BUMPS}}
    bands = {name: screen_bands(image[..., 1], screen.axis_mm()) for name, image in banded.items()}
    worst = _benchmark_error(reference, surface, screen)
    progress("screen", 1.0)
    pixels = f"{screen.pixels} x {screen.pixels} pixels"
    tables = [
        _errors_table("errors", f"Mean CIELAB error, {pixels}, each its middle", errors),
        _errors_table("averaged", f"The same, each pixel the mean of {_AVERAGED} x {_AVERAGED} directions", averaged),
        _tails_table(errors),
        _bands_table(bands),
    ]
    if nearer:
        caption = f"Mean CIELAB error on a screen of {_OTHER_SIDE_MM:g} mm: nearer to the spot"
        tables.insert(2, _errors_table("nearer", caption, nearer))
    return Page(
        name="screen",
        title="A laser on gold-coated Elaphe, seen on a screen",
        source="[D14] table 2, fig. 10, 11, sec. 6.2, 6.3",
        expected="Mean CIELAB error a pixel at exposures of 1 / 1000 / 7500 RU against windowing in space: published "
        "0.039 / 4.295 / 11.544 for [D14]'s table and 0.067 / 7.843 / 23.704 for Stam's correlation method. Our "
        f"table is to stay {_BETTER:g} times below the paper's layout at every exposure, and Stam's Gaussian surface "
        "to show no secondary horizontal bands.",
        checks=[
            *_error_checks(errors),
            *_nearer_checks(nearer),
            Check(
                "benchmark",
                "largest difference of |P|² between the benchmark and the sum over samples under the window in space",
                worst,
                "<=",
                _BENCHMARK_ERROR,
                source="the reference's tolerance",
                remark=f"on {_CHECKED_PIXELS + 1} pixels and {len(_CHECKED_NM)} wavelengths",
            ),
            *_band_checks(bands, surface),
        ],
        tables=tables,
        pictures=_pictures(truth, images, bands, screen),
        remarks=_remarks(errors, images, truth, surface),
    )


def _colours(surface: BenchSurface) -> dict[str, Colour]:
    """Prepare every method of the page."""
    field, config = surface.field, surface.config
    return {
        OURS: METHODS[OURS](field, config).xyz,
        OURS_DEFAULT: METHODS[OURS](field, config.model_copy(update={"accuracy": Accuracy()})).xyz,
        PAPER: METHODS[PAPER](field, config).xyz,
        PAPER_AT_ZERO: PaperLookUp(planes.window_on_sample_zero(field), config).xyz,
        STAM: METHODS[STAM](field, config).xyz,
        STAM_DISC: StamGaussian(field, config, DiscWindow()).xyz,
        BUMPS: METHODS[BUMPS](field, config).xyz,
    }


def _errors(images: Mapping[str, Array], truth: Array) -> dict[str, dict[float, Array]]:
    return {name: {ru: delta_e(image, truth, ru) for ru in EXPOSURES_RU} for name, image in images.items()}


def _compared(screen: Screen, exact: Colour, colours: Mapping[str, Colour], names: tuple[str, ...]) -> _Errors:
    """Errors of some methods on another screen."""
    return _errors({name: screen.show(colours[name]) for name in names}, screen.show(exact))


def _benchmark_error(reference: Reference, surface: BenchSurface, screen: Screen) -> float:
    """The largest difference of |P|^2 between reference and sum over samples, on a few pixels and the spot."""
    wi, wr = screen.directions()
    some = np.random.default_rng(_SEED).integers(len(wr), size=_CHECKED_PIXELS)
    chosen = np.append(some, len(wr) // 2)
    uvw = geometry.uvw(wi[chosen], wr[chosen])
    summed = np.stack([power_direct(surface.field, surface.sigma_um, uvw, nm) for nm in _CHECKED_NM], axis=-1)
    found = reference.power(uvw, np.array(_CHECKED_NM))
    return float(np.max(np.abs(np.nan_to_num(found) - np.nan_to_num(summed))))


def _mean(errors: _Errors, name: str, ru: float) -> float:
    return float(errors[name][ru].mean())


def _times_below(errors: _Errors, name: str, ru: float) -> float:
    """How many times a method's mean error is below that of the paper's layout."""
    return _mean(errors, PAPER, ru) / _mean(errors, name, ru)


def _error_checks(errors: _Errors) -> Iterator[Check]:
    for ru in EXPOSURES_RU:
        what, ratio = f"mean error of the paper's layout over ours at {ru:g} RU", _times_below(errors, OURS, ru)
        yield Check(f"paper_over_ours.{ru:g}", what, ratio, ">=", _BETTER, source="this project's aim")
        for key, name in (("paper", PAPER), ("stam", STAM)):
            what, mean = f"mean error of {_NAMES[name]}, at {ru:g} RU", _mean(errors, name, ru)
            yield Check(f"{key}.{ru:g}", what, mean, "=", PUBLISHED[name][ru], source="[D14] table 2")


def _nearer_checks(errors: _Errors) -> Iterator[Check]:
    """The same on another screen, reported: [D14] does not state how large its screen is."""
    for ru in EXPOSURES_RU if errors else ():
        what = f"screen of {_OTHER_SIDE_MM:g} mm: mean error of the paper's layout over ours at {ru:g} RU"
        yield Check(f"nearer.paper_over_ours.{ru:g}", what, _times_below(errors, OURS, ru))


def _band_checks(bands: Mapping[str, Bands], surface: BenchSurface) -> Iterator[Check]:
    # a recipe's fingers have a firm period along their length, which the correlation knows as well
    visible = VISIBLE_CONTRAST if surface.scan else None
    what = "contrast of the secondary horizontal bands"
    for key, name in (("gaussian", STAM), ("disc", STAM_DISC)):
        contrast, source = bands[name].contrast, "[D14] 6.3: no bands"
        yield Check(f"bands.{key}", f"{what}: {_NAMES[name]}", contrast, "<=", visible, source=source)
    yield Check("bands.exact", f"{what}: exact", bands[EXACT].contrast)


def _errors_table(key: str, caption: str, errors: _Errors) -> PageTable:
    def row(name: str) -> tuple[Cell, ...]:
        published = PUBLISHED.get(name)
        printed = None if published is None else tuple(published.values())
        return _NAMES[name], *(_mean(errors, name, ru) for ru in EXPOSURES_RU), printed

    columns = [Column("method"), *numbers("{:.3g}", *_RU_COLUMNS), Column("published", "{:g} / {:g} / {:g}")]
    return PageTable(key, caption, columns, [row(name) for name in errors])


def _tails_table(errors: _Errors) -> PageTable:
    return PageTable(
        "tails",
        "99th percentile / maximum",
        [Column("method"), *numbers("{:.3g} / {:.3g}", *_RU_COLUMNS)],
        [
            (_NAMES[name], *((float(np.percentile(each, 99)), float(each.max())) for each in found.values()))
            for name, found in errors.items()
        ],
    )


def _bands_table(bands: Mapping[str, Bands]) -> PageTable:
    return PageTable(
        "bands",
        "Secondary horizontal bands: the strongest one's contrast, and their share of the light outside the primary",
        [Column("image"), Column("contrast", "{:.2f}"), Column("share", "{:.1%}")],
        [(_NAMES.get(name, name), found.contrast, found.share) for name, found in bands.items()],
    )


def _pictures(truth: Array, images: Mapping[str, Array], bands: Mapping[str, Bands], screen: Screen) -> list[Picture]:
    shown = {_NAMES[name]: images[name] for name in (OURS, PAPER, STAM, BUMPS)}
    dim, bright = EXPOSURES_RU[1:]
    sheet = screen_plots.sheet(truth, shown, screen.side_mm, dim, bright)
    upwards = screen.axis_mm()[::-1]
    series = [
        Series(_NAMES.get(name, name), upwards, bands[name].profile, colour, ":" if name == EXACT else "-")
        for name, colour in zip((OURS, PAPER, STAM, STAM_DISC, EXACT), (*COLOURS[:4], COLOURS[-1]), strict=True)
    ]
    rows = Chart("Rows of the screen", "y on the screen (mm)", "mean Y of the row under 1 RU", series, floor=0.0)
    return [
        Picture(sheet, f"The screen at {dim:g} and {bright:g} RU, and each method's CIELAB error at {bright:g} RU"),
        Picture(
            charts([[rows]], (8.6, 4.2)),
            "Rows of the screen without the spot's columns: primary band, and secondary bands where there are any",
        ),
    ]


def _remarks(errors: _Errors, images: Mapping[str, Array], truth: Array, surface: BenchSurface) -> list[str]:
    ours = errors[OURS][EXPOSURES_RU[0]]
    middle = len(ours) // 2
    nearest = ours[middle - 1 : middle + 2, middle - 1 : middle + 2]
    spot = 100.0 * (images[OURS][middle, middle] / truth[middle, middle] - 1.0)
    zero, paper = (" / ".join(f"{_mean(errors, n, ru):.3g}" for ru in EXPOSURES_RU) for n in (PAPER_AT_ZERO, PAPER))
    default = " / ".join(f"{_times_below(errors, OURS_DEFAULT, ru):.1f}" for ru in EXPOSURES_RU)
    return [
        (
            f"Our table is planned for a mean error of {DELTA_E:g} on random views at 7500 RU, tighter than the "
            f"default {DEFAULT_DELTA_E:g}, with which it is {default} times below the paper's layout: random views "
            "hardly meet the few pixels about the mirror direction that count at 1 RU."
        ),
        (
            "At 1 RU the screen is black but for the spot: of our table's error the nine pixels about the mirror "
            f"direction hold {100 * nearest.sum() / ours.sum():.0f} %, the spot alone "
            f"{100 * ours[middle, middle] / ours.sum():.0f} % (X, Y, Z off by {spot[0]:+.2f}, {spot[1]:+.2f}, "
            f"{spot[2]:+.2f} %)."
        ),
        (
            f"The paper's layout is made here with the window that the benchmark has, and errs by {paper}. With the "
            "window on sample 0, as in public codes, it is the table of another part of the skin and errs by "
            f"{zero}, against the published 0.039 / 4.295 / 11.544: much of the published error may be that, and not "
            "the table's grid."
        ),
        _MODELLED,
        _ON_A_SCAN if surface.scan else _ON_A_RECIPE,
    ]
