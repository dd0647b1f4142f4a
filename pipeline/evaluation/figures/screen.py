"""[D14] table 2, sec. 6.2 and 6.3: a gold-coated Elaphe throws a supercontinuum laser onto a screen."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import DEFAULT_DELTA_E, Accuracy, Config
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.figures.laser_screen import (
    DELTA_E,
    LIGHT,
    VISIBLE_CONTRAST,
    Bands,
    Colour,
    Screen,
    bands_of,
    experiment,
)
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.paper_look_up import PaperLookUp
from pipeline.evaluation.methods.stam_gaussian import DiscWindow, StamGaussian
from pipeline.optics import geometry
from pipeline.optics.colour import EXPOSURES_RU, delta_e
from pipeline.progress import Progress
from pipeline.surface.heightfield import HeightField

# published means of table 2, by exposure
PUBLISHED_TABLE = dict(zip(EXPOSURES_RU, (0.039, 4.295, 11.544), strict=True))
PUBLISHED_STAM = dict(zip(EXPOSURES_RU, (0.067, 7.843, 23.704), strict=True))
_BETTER = 10.0
_AVERAGED = 3
_OTHER_SIDES_MM = (100.0,)
_CHECKED_PIXELS, _CHECKED_NM, _SEED = 5, (450.0, 550.0, 700.0), 4
_BENCHMARK_ERROR = 1e-9

OURS, PAPER, STAM, BUMPS = "polar table", "D14 look-up", "Stam Gaussian", "Stam bumps"
OURS_DEFAULT = "polar table, default budget"
PAPER_AT_ZERO, STAM_DISC = "D14 look-up, window on sample 0", "Stam Gaussian, disc of 50 µm"
_NAMES = {
    OURS: f"ours: polar table, budget {DELTA_E:g}",
    OURS_DEFAULT: f"ours, default budget {DEFAULT_DELTA_E:g}",
    PAPER: "[D14]'s table, 501 x 501",
    PAPER_AT_ZERO: "[D14]'s table, its window on sample 0",
    STAM: "Stam, Gaussian surface",
    STAM_DISC: "Stam, Gaussian surface, 50 µm disc",
    BUMPS: "Stam, periodic bumps",
}


def make(bench: Bench, progress: Progress) -> Figure:
    """The page, on the bench's Elaphe."""
    surface = replace(bench.elaphe, config=experiment(bench.elaphe.config))
    screen = Screen(LIGHT, 31 if bench.quick else 101)
    averaged = replace(screen, samples=_AVERAGED)
    reference = _reference(surface)
    exact = _exact(reference, surface.config)
    truth = screen.show(exact)
    progress("screen", 0.1)
    colours = _colours(surface)
    images = {name: screen.show(colour) for name, colour in colours.items()}
    progress("screen", 0.4)
    errors = _errors(images, truth)
    plain = (OURS, PAPER, STAM, BUMPS)
    means_truth = averaged.show(exact)
    means = _errors({name: averaged.show(colours[name]) for name in plain}, means_truth)
    progress("screen", 0.8)
    sides = {} if bench.quick else _other_sides(screen, exact, colours)
    # what periodic bumps leave are dots, and no bands
    banded = {"exact": truth, **{name: image for name, image in images.items() if name != BUMPS}}
    bands = {name: bands_of(image[..., 1], screen.axis_mm()) for name, image in banded.items()}
    worst = _benchmark_error(reference, surface, screen)
    progress("screen", 1.0)
    return Figure(
        name="screen",
        title="A laser on gold-coated Elaphe, seen on a screen",
        source="[D14] table 2, fig. 10, 11, sec. 6.2, 6.3",
        expected="Mean CIELAB error a pixel at exposures of 1 / 1000 / 7500 RU against windowing in space: published "
        "0.039 / 4.295 / 11.544 for [D14]'s table and 0.067 / 7.843 / 23.704 for Stam's correlation method. Our "
        f"table is to stay {_BETTER:g} times below the paper's layout at every exposure, and Stam's Gaussian surface "
        "to show no secondary horizontal bands.",
        checks=[
            *_error_checks(errors),
            *_side_checks(sides),
            _benchmark_check(worst),
            _band_check(bands, surface),
        ],
        tables=[
            _errors_table(f"Mean CIELAB error, {screen.pixels} x {screen.pixels} pixels, each its middle", errors),
            _errors_table(
                f"The same, each pixel the mean of {_AVERAGED} x {_AVERAGED} directions, exact as well", means
            ),
            *_sides_tables(sides),
            _tails_table(errors),
            _bands_table(bands),
        ],
        pictures=_pictures(truth, images, screen),
        remarks=_remarks(errors, images, truth, surface),
        numbers=_numbers(errors, means, sides, bands, worst),
    )


# --- colours on the screen ---------------------------------------------------------------------------


def _reference(surface: Surface) -> Reference:
    config = surface.config
    return Reference(surface.field, config.coherence.sigma_um, config.light.range_nm[0])


def _exact(reference: Reference, config: Config) -> Colour:
    """At every nanometre."""
    return lambda wi, wr: reference.xyz(config.light, config.material, wi, wr)


def _colours(surface: Surface) -> dict[str, Colour]:
    """Every method of the page, made ready."""
    field, config = surface.field, surface.config
    ny, nx = field.shape
    # the window on sample 0, with the patch's seams under its middle, where public codes have it
    on_zero = HeightField(np.roll(field.heights_um, (ny // 2, nx // 2), axis=(0, 1)), field.pitch_um)
    return {
        OURS: METHODS[OURS](field, config).xyz,
        OURS_DEFAULT: METHODS[OURS](field, config.model_copy(update={"accuracy": Accuracy()})).xyz,
        PAPER: METHODS[PAPER](field, config).xyz,
        PAPER_AT_ZERO: PaperLookUp(on_zero, config).xyz,
        STAM: METHODS[STAM](field, config).xyz,
        STAM_DISC: StamGaussian(field, config, DiscWindow()).xyz,
        BUMPS: METHODS[BUMPS](field, config).xyz,
    }


# CIELAB errors (pixels, pixels) of a method at an exposure
Errors = Mapping[str, Mapping[float, Array]]


def _errors(images: Mapping[str, Array], truth: Array) -> dict[str, dict[float, Array]]:
    return {name: {ru: delta_e(image, truth, ru) for ru in EXPOSURES_RU} for name, image in images.items()}


def _other_sides(
    screen: Screen, exact: Colour, colours: Mapping[str, Colour]
) -> dict[float, dict[str, dict[float, Array]]]:
    """Errors on smaller screens, whose pixels are nearer to the spot."""
    found = {}
    for side in _OTHER_SIDES_MM:
        smaller = replace(screen, side_mm=side)
        images = {name: smaller.show(colours[name]) for name in (OURS, PAPER, PAPER_AT_ZERO, STAM)}
        found[side] = _errors(images, smaller.show(exact))
    return found


def _benchmark_error(reference: Reference, surface: Surface, screen: Screen) -> float:
    """The largest difference of |P|^2 between reference and sum over samples, on a few pixels and the spot."""
    wi, wr = screen.directions()
    some = np.random.default_rng(_SEED).integers(len(wr), size=_CHECKED_PIXELS)
    chosen = np.append(some, len(wr) // 2)
    uvw = geometry.uvw(wi[chosen], wr[chosen])
    sigma = surface.config.coherence.sigma_um
    summed = np.stack([power_direct(surface.field, sigma, uvw, nm) for nm in _CHECKED_NM], axis=-1)
    found = reference.power(uvw, np.array(_CHECKED_NM))
    return float(np.max(np.abs(np.nan_to_num(found) - np.nan_to_num(summed))))


# --- checks ------------------------------------------------------------------------------------------


def _mean(errors: Errors, name: str, ru: float) -> float:
    return float(errors[name][ru].mean())


def _error_checks(errors: Errors) -> list[Check]:
    checks = []
    for ru in EXPOSURES_RU:
        ours, paper, stam = (_mean(errors, name, ru) for name in (OURS, PAPER, STAM))
        checks.append(
            Check(
                f"Mean error of our table at {ru:g} RU",
                f"{_BETTER:g} times below the paper's layout, {paper:.3g}",
                f"{ours:.3g}, {paper / ours:.1f} times below",
                paper >= _BETTER * ours,
            )
        )
        checks.append(
            Check(
                f"Mean error of [D14]'s table and of Stam's Gaussian surface at {ru:g} RU",
                f"published: {PUBLISHED_TABLE[ru]:g} and {PUBLISHED_STAM[ru]:g}",
                f"{paper:.3g} and {stam:.3g}",
                None,
            )
        )
    return checks


def _side_checks(sides: Mapping[float, Errors]) -> list[Check]:
    """The same on other screens, told: [D14] does not say how large its screen is."""
    return [
        Check(
            f"Our table on a screen of {side:g} mm, at {' / '.join(f'{ru:g}' for ru in EXPOSURES_RU)} RU",
            "the paper's layout; [D14] does not tell its screen's size",
            f"{_times_below(errors, OURS)} times below",
            None,
        )
        for side, errors in sides.items()
    ]


def _times_below(errors: Errors, name: str) -> str:
    """By how much a method's mean error is below that of the paper's layout, at every exposure."""
    return " / ".join(f"{_mean(errors, PAPER, ru) / _mean(errors, name, ru):.1f}" for ru in EXPOSURES_RU)


def _benchmark_check(worst: float) -> Check:
    return Check(
        "The benchmark against the sum over samples under the window in space",
        f"|P|² within {_BENCHMARK_ERROR:g} of the mirror",
        f"{worst:.1e} at most, on {_CHECKED_PIXELS + 1} pixels and {len(_CHECKED_NM)} wavelengths",
        worst <= _BENCHMARK_ERROR,
    )


def _band_check(bands: Mapping[str, Bands], surface: Surface) -> Check:
    exact, stam, disc = (bands[name] for name in ("exact", STAM, STAM_DISC))
    return Check(
        "Secondary horizontal bands of Stam's Gaussian surface",
        f"none: contrast at most {VISIBLE_CONTRAST:g}, which is barely seen",
        f"{stam.contrast:.2f}, and {disc.contrast:.2f} with the text's disc; exact {exact.contrast:.2f}",
        # a recipe's fingers have a firm period along their length, which the correlation knows as well
        max(stam.contrast, disc.contrast) <= VISIBLE_CONTRAST if surface.scan else None,
    )


# --- tables ------------------------------------------------------------------------------------------


def _errors_table(caption: str, errors: Errors) -> Table:
    rows = [
        (_NAMES[name], *(f"{_mean(errors, name, ru):.3g}" for ru in EXPOSURES_RU), _beside(name)) for name in errors
    ]
    return Table(caption, ("method", *(f"{ru:g} RU" for ru in EXPOSURES_RU), "published"), rows)


def _beside(name: str) -> str:
    published = {PAPER: PUBLISHED_TABLE, STAM: PUBLISHED_STAM}.get(name)
    return " / ".join(f"{value:g}" for value in published.values()) if published else ""


def _sides_tables(sides: Mapping[float, Errors]) -> list[Table]:
    return [
        _errors_table(f"Mean CIELAB error on a screen of {side:g} mm: nearer to the spot", errors)
        for side, errors in sides.items()
    ]


def _tails_table(errors: Errors) -> Table:
    rows = []
    for name, by_exposure in errors.items():
        tails = [f"{np.percentile(found, 99):.3g} / {found.max():.3g}" for found in by_exposure.values()]
        rows.append((_NAMES[name], *tails))
    return Table("99th percentile / maximum", ("method", *(f"{ru:g} RU" for ru in EXPOSURES_RU)), rows)


def _bands_table(bands: Mapping[str, Bands]) -> Table:
    rows = [
        (_NAMES.get(name, name), f"{found.contrast:.2f}", f"{100 * found.share:.1f} %")
        for name, found in bands.items()
    ]
    return Table(
        "Secondary horizontal bands: the strongest one's contrast, and their share of the light outside the primary",
        ("image", "contrast", "share"),
        rows,
    )


# --- pictures, words, numbers ------------------------------------------------------------------------


def _pictures(truth: Array, images: Mapping[str, Array], screen: Screen) -> list[Picture]:
    from pipeline.evaluation.plots import screen_plots as plots

    shown = {_NAMES[name]: images[name] for name in (OURS, PAPER, STAM, BUMPS)}
    dim, bright = EXPOSURES_RU[1:]
    sheet = plots.sheet(truth, shown, screen.side_mm, dim, bright)
    lined = {"exact": truth, **{_NAMES[name]: images[name] for name in (OURS, PAPER, STAM, STAM_DISC)}}
    axis = screen.axis_mm()
    profiles = plots.profiles({name: bands_of(each[..., 1], axis).profile for name, each in lined.items()}, axis)
    return [
        Picture(sheet, f"The screen at {dim:g} and {bright:g} RU, and each method's CIELAB error at {bright:g} RU"),
        Picture(
            profiles, "Rows of the screen beside the spot: primary band, and secondary bands where there are any"
        ),
    ]


def _remarks(errors: Errors, images: Mapping[str, Array], truth: Array, surface: Surface) -> list[str]:
    ours = errors[OURS][EXPOSURES_RU[0]]
    middle = len(ours) // 2
    nearest = ours[middle - 1 : middle + 2, middle - 1 : middle + 2]
    spot = 100.0 * (images[OURS][middle, middle] / truth[middle, middle] - 1.0)
    zero, paper = ([f"{_mean(errors, n, ru):.3g}" for ru in EXPOSURES_RU] for n in (PAPER_AT_ZERO, PAPER))
    return [
        (
            f"Our table is planned for a mean error of {DELTA_E:g} on random views at 7500 RU, tighter than the "
            f"default {DEFAULT_DELTA_E:g}, with which it is {_times_below(errors, OURS_DEFAULT)} times below the "
            "paper's layout: random views hardly meet the few pixels about the mirror direction that count at 1 RU."
        ),
        (
            "At 1 RU the screen is black but for the spot: of our table's error the nine pixels about the mirror "
            f"direction hold {100 * nearest.sum() / ours.sum():.0f} %, the spot alone "
            f"{100 * ours[middle, middle] / ours.sum():.0f} % (X, Y, Z off by {spot[0]:+.2f}, {spot[1]:+.2f}, "
            f"{spot[2]:+.2f} %)."
        ),
        (
            "The paper's layout is made here with the window that the benchmark has, and errs by "
            f"{' / '.join(paper)}. With the window on sample 0, where public codes have it, it is the table of "
            f"another place of the skin and errs by {' / '.join(zero)}, beside the published 0.039 / 4.295 / 11.544: "
            "much of the published error may be that, and not the table's grid."
        ),
        (
            "Errors are of the radiance that the shader shows; neither the screen's own cosine nor a white balance "
            "is applied. The laser's spectrum is a model (supercontinuum.csv), and the screen's size is not told. "
            "On a smaller screen all pixels are nearer to the spot, brighter, and err more."
        ),
        (
            "Stam's Gaussian surface knows the heights by their correlation alone, which is the same along and "
            "against the fingers: its image is symmetric and without speckle. Of the secondary bands a faint pair is "
            "left, where [D14] sees none: this scan's correlation has the period along its fingers, and for low "
            "heights the formula is their power spectrum. A vertical band stands beside the spot, as [D14] 6.3 tells."
            if surface.scan
            else "This Elaphe is a recipe whose fingers have a firm period along their length. Their correlation has "
            "it too, so Stam's Gaussian surface does show horizontal bands here, unlike on the scan."
        ),
    ]


def _numbers(
    errors: Errors, means: Errors, sides: Mapping[float, Errors], bands: Mapping[str, Bands], worst: float
) -> dict[str, Any]:
    def told(found: Errors) -> dict[str, dict[str, float]]:
        return {name: {f"{ru:g}": _mean(found, name, ru) for ru in EXPOSURES_RU} for name in found}

    return {
        "mean_delta_e": told(errors),
        f"mean_delta_e_averaged_{_AVERAGED}x{_AVERAGED}": told(means),
        "mean_delta_e_by_side_mm": {f"{side:g}": told(found) for side, found in sides.items()},
        "published": {
            PAPER: {f"{ru:g}": value for ru, value in PUBLISHED_TABLE.items()},
            STAM: {f"{ru:g}": value for ru, value in PUBLISHED_STAM.items()},
        },
        "bands": {name: {"contrast": found.contrast, "share": found.share} for name, found in bands.items()},
        "benchmark_error": worst,
    }
