"""[D14] table 2, sec. 6.2 and 6.3: a gold-coated Elaphe throws a supercontinuum laser onto a screen.

The beam meets the sample at 45 deg. The screen is 100 mm from it, parallel to the incoming beam and thus square to
the mirror direction, whose spot is its middle. [D14] does not state its size: 200 mm a side fills the plane of
incidence from the normal to the horizon.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import DEFAULT_DELTA_E, Accuracy, Config
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.maps import VISIBLE_CONTRAST, Bands, bands_of, window_on_sample_zero
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageText, Picture
from pipeline.evaluation.methods.catalogue import BUMPS, EXACT, METHODS, OURS, PAPER, STAM
from pipeline.evaluation.methods.paper_shaders import PaperLookUp
from pipeline.evaluation.methods.stam_gaussian import DiscWindow, StamGaussian
from pipeline.evaluation.plots import screen_plots
from pipeline.evaluation.plots.charts import Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.colour import EXPOSURES_RU, delta_e
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.progress import Progress
from pipeline.scene.lights import Direction, Parallel
from pipeline.scene.model import Scene
from pipeline.tables.polar.layout import PolarLayout

LIGHT = Direction(theta_deg=45.0, phi_deg=180.0)
APERTURE_UM = 65.0
# the screen shows little else but the light near the mirror direction, which random directions seldom meet
DELTA_E = 0.04
# columns this near the middle hold the spot and a vertical band; rows this near it hold the primary band
_SPOT_MM, _PRIMARY_MM = 15.0, 8.0
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
_BETTER = 10.0
_AVERAGED = 3
_OTHER_SIDE_MM = 100.0
_CHECKED_PIXELS, _CHECKED_NM, _SEED = 5, (450.0, 550.0, 700.0), 4

# XYZ (directions, 3) under 1 RU for wi, wr (directions, 3)
Colour = Callable[[Array, Array], Array]
# CIELAB errors (pixels, pixels) of methods by name, at exposures
_Errors = Mapping[str, Mapping[float, Array]]


@dataclass(frozen=True)
class Screen:
    """A square screen, square to the mirror direction of `light` and centred on it.

    samples: directions a side of every pixel, whose XYZ are averaged: 1 takes its middle alone ([D14] 6.2 averages
    over the solid angle of a pixel).
    """

    light: Direction
    pixels: int
    side_mm: float = 200.0
    distance_mm: float = 100.0
    samples: int = 1

    def axis_mm(self) -> Array:
        """Return the middles of the pixels along x, and along y upwards, from the spot."""
        return _middles(self.pixels, self.side_mm)

    def directions(self) -> tuple[Array, Array]:
        """Return wi and wr (directions, 3), row by row from the top.

        +x leans away from the normal, in the plane of incidence; +y lies in the sample's plane, a quarter turn on
        from the mirror direction's azimuth.
        """
        wi = geometry.direction(np.radians(self.light.theta_deg), np.radians(self.light.phi_deg))
        mirror = np.array([-wi[0], -wi[1], wi[2]])
        along_y = np.cross([0.0, 0.0, 1.0], mirror)
        along_y /= np.linalg.norm(along_y)
        along_x = np.cross(along_y, mirror)
        along = _middles(self.pixels * self.samples, self.side_mm)
        x, y = np.meshgrid(along, -along)
        place = self.distance_mm * mirror + x[..., None] * along_x + y[..., None] * along_y
        wr = (place / np.linalg.norm(place, axis=-1, keepdims=True)).reshape(-1, 3)
        return np.broadcast_to(wi, wr.shape), wr

    def image(self, values: Array) -> Array:
        """Return pixels (pixels, pixels, channels): the mean of each one's directions (directions, channels)."""
        n, k = self.pixels, self.samples
        return np.asarray(values.reshape(n, k, n, k, -1).mean(axis=(1, 3)))

    def show(self, colour: Colour) -> Array:
        """Return XYZ (pixels, pixels, 3) of a method."""
        return self.image(colour(*self.directions()))


def _middles(count: int, side_mm: float) -> Array:
    return ((np.arange(count) + 0.5) / count - 0.5) * side_mm


def experiment(config: Config) -> Config:
    """Return the config of a surface under [D14]'s laser, aperture and gold."""
    laser = str(files("pipeline.optics").joinpath("data", "supercontinuum.csv"))
    return config.model_copy(
        update={
            "coherence": Coherence(sigma_um=APERTURE_UM / 4.0),
            "light": Light(illuminant=laser),
            "material": Material(fresnel="conductor", metal="Au", normalisation="relative"),
            "table": PolarLayout(),
            "accuracy": Accuracy(delta_e=DELTA_E),
            "scene": Scene(lights=[Parallel(theta_deg=LIGHT.theta_deg, phi_deg=LIGHT.phi_deg)]),
        }
    )


def screen_bands(luminance: Array, axis_mm: Array) -> Bands:
    """Find the bands of an image of Y (pixels, pixels) without the spot's columns; `axis_mm` (pixels,) is from it."""
    return bands_of(luminance[:, np.abs(axis_mm) > _SPOT_MM].mean(axis=1), axis_mm, _PRIMARY_MM)


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
    text = PageText(
        "screen",
        better=_BETTER,
        budget=DELTA_E,
        default_budget=DEFAULT_DELTA_E,
        averaged=_AVERAGED,
        pixels=screen.pixels,
        side_mm=_OTHER_SIDE_MM,
        dim=EXPOSURES_RU[1],
        bright=EXPOSURES_RU[2],
        checked=(_CHECKED_PIXELS + 1, len(_CHECKED_NM)),
    )
    compared = {"errors": errors, "averaged": averaged, **({"nearer": nearer} if nearer else {})}
    return text.page(
        checks=_checks(text, errors, nearer, worst, bands, surface),
        tables=[
            *(text.table(key, _error_rows(each)) for key, each in compared.items()),
            text.table("tails", _tail_rows(errors)),
            text.table("bands", ((_NAMES.get(name, name), of.contrast, of.share) for name, of in bands.items())),
        ],
        pictures=_pictures(text, truth, images, bands, screen),
        remarks=_remarks(text, errors, images, truth, surface),
    )


def _colours(surface: BenchSurface) -> dict[str, Colour]:
    """Prepare every method of the page."""
    field, config = surface.field, surface.config
    return {
        OURS: METHODS[OURS](field, config).xyz,
        OURS_DEFAULT: METHODS[OURS](field, config.model_copy(update={"accuracy": Accuracy()})).xyz,
        PAPER: METHODS[PAPER](field, config).xyz,
        PAPER_AT_ZERO: PaperLookUp(window_on_sample_zero(field), config).xyz,
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


def _checks(
    text: PageText, errors: _Errors, nearer: _Errors, worst: float, bands: Mapping[str, Bands], surface: BenchSurface
) -> Iterator[Check]:
    for ru in EXPOSURES_RU:
        yield text.check("paper_over_ours.{ru:g}", _times_below(errors, OURS, ru), bound=_BETTER, ru=ru)
        for key, name in (("paper", PAPER), ("stam", STAM)):
            known = {"method": _NAMES[name], "ru": ru, "bound": PUBLISHED[name][ru]}
            yield text.check(f"{key}.{{ru:g}}", _mean(errors, name, ru), **known)
    for ru in EXPOSURES_RU if nearer else ():
        yield text.check("nearer.paper_over_ours.{ru:g}", _times_below(nearer, OURS, ru), ru=ru)
    yield text.check("benchmark", worst)
    # a recipe's fingers have a firm period along their length, which the correlation knows as well
    visible = VISIBLE_CONTRAST if surface.scan else None
    for key, name in (("bands.gaussian", STAM), ("bands.disc", STAM_DISC)):
        yield text.check(key, bands[name].contrast, bound=visible, method=_NAMES[name])
    yield text.check("bands.exact", bands[EXACT].contrast)


def _error_rows(errors: _Errors) -> Iterator[tuple[Cell, ...]]:
    for name in errors:
        printed = tuple(PUBLISHED[name].values()) if name in PUBLISHED else None
        yield _NAMES[name], *(_mean(errors, name, ru) for ru in EXPOSURES_RU), printed


def _tail_rows(errors: _Errors) -> Iterator[tuple[Cell, ...]]:
    for name, found in errors.items():
        yield _NAMES[name], *((float(np.percentile(each, 99)), float(each.max())) for each in found.values())


def _pictures(
    text: PageText, truth: Array, images: Mapping[str, Array], bands: Mapping[str, Bands], screen: Screen
) -> list[Picture]:
    shown = {_NAMES[name]: images[name] for name in (OURS, PAPER, STAM, BUMPS)}
    upwards = screen.axis_mm()[::-1]
    series = [
        Series(_NAMES.get(name, name), upwards, bands[name].profile, colour, ":" if name == EXACT else "-")
        for name, colour in zip((OURS, PAPER, STAM, STAM_DISC, EXACT), (*COLOURS[:4], COLOURS[-1]), strict=True)
    ]
    return [
        text.picture("sheet", screen_plots.sheet(truth, shown, screen.side_mm, *EXPOSURES_RU[1:])),
        text.picture("rows", charts([[text.chart("rows", series)]], (8.6, 4.2))),
    ]


def _remarks(
    text: PageText, errors: _Errors, images: Mapping[str, Array], truth: Array, surface: BenchSurface
) -> list[str]:
    ours = errors[OURS][EXPOSURES_RU[0]]
    middle = len(ours) // 2
    nearest = ours[middle - 1 : middle + 2, middle - 1 : middle + 2]
    shares = {"nearest": 100 * nearest.sum() / ours.sum(), "spot": 100 * ours[middle, middle] / ours.sum()}
    off = 100.0 * (images[OURS][middle, middle] / truth[middle, middle] - 1.0)
    zero, paper = (" / ".join(f"{_mean(errors, n, ru):.3g}" for ru in EXPOSURES_RU) for n in (PAPER_AT_ZERO, PAPER))
    default = " / ".join(f"{_times_below(errors, OURS_DEFAULT, ru):.1f}" for ru in EXPOSURES_RU)
    return [
        text.remark("planned", default=default),
        text.remark("dark", **shares, off=off),
        text.remark("window", paper=paper, zero=zero),
        text.remark("modelled"),
        text.remark("on_a_scan" if surface.scan else "on_a_recipe"),
    ]
