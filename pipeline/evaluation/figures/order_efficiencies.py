"""Order efficiencies against closed forms, which neither [D14] nor [S14] checked."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction import expansion, power_spectrum
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.page import Bench, Cell, Page, PageTable, PageText, Picture, numbers
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.optics import geometry, gratings
from pipeline.progress import Progress
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Recipe, Rectangular, Sinusoid
from pipeline.tables.polar import spectral

# of a mirror's peak: the error allowed in every order
TOLERANCE = 1e-4
# of radii of E, in sigma_f: a laser line's 0.4 leaves 1e-3 between them
FINE_SPACING = 0.25

PERIOD_UM, LAMBDA_MIN_NM = 2.5, 380.0
# the patch repeats; along the grooves nothing varies
_SIZE_UM, _PITCH_Y_UM = (65.0, 8.0), 1.0
# polar and azimuthal angle of the light: in the plane of the orders, and across it
LIGHTS_DEG = ((0.0, 0.0), (30.0, 0.0), (60.0, 180.0), (45.0, 60.0))
_LAMBDA_NM, _FEWER_NM = np.linspace(400.0, 760.0, 10), np.array([400.0, 560.0, 720.0])
_ORDERS = np.arange(-12.0, 13.0)
_SAMPLES = (32, 64, 128, 256, 512)
# drawn: of the lights, and of the orders
_SHOWN, _SHOWN_ORDERS = (0, 2), (0, 1, 2, -1, -2)

# |c_m|^2 of orders at s, 1/um
Power = Callable[[Array, Array], Array]
_LINE_SPACING = power_spectrum.SPACING_OF_A_LINE


@dataclass(frozen=True)
class KnownGrating:
    """A surface of known orders.

    key: its name in ids. samples: of a period, enough that sampling it errs by less than the tolerance.
    """

    key: str
    name: str
    samples: int
    recipe: Recipe
    power: Power
    sampled: Callable[[Array, Array, int], Array]

    def field(self, samples: int) -> HeightField:
        """Make a patch of whole periods with a number of samples each."""
        return recipes.make(self.recipe.model_copy(update={"pitch_um": (PERIOD_UM / samples, _PITCH_Y_UM)}))


def known_gratings() -> tuple[KnownGrating, ...]:
    """Return a sinusoid, a rectangle of half the period and a blaze."""
    amplitude, step, blaze, common = 0.1, 0.15, 0.25, {"period_um": PERIOD_UM, "size_um": _SIZE_UM}
    return (
        KnownGrating(
            "sinusoid",
            f"sinusoid, a = {amplitude:g} µm",
            32,
            Sinusoid.model_validate({"kind": "sinusoid", "amplitude_um": amplitude, **common}),
            partial(gratings.sinusoid, amplitude_um=amplitude),
            # the part that a smooth phase folds back from beyond 16 orders is below rounding
            lambda m, s, _: gratings.sinusoid(m, s, amplitude),
        ),
        KnownGrating(
            "rectangle",
            f"rectangle, H = {step:g} µm",
            128,
            Rectangular.model_validate({"kind": "rectangular", "height_um": step, "duty": 0.5, **common}),
            partial(gratings.rectangle, height_um=step, duty=0.5),
            lambda m, s, samples: gratings.sampled_rectangle(m, s, step, 0.5, samples),
        ),
        KnownGrating(
            "blaze",
            f"blaze, H = {blaze:g} µm",
            64,
            Blazed.model_validate({"kind": "blazed", "height_um": blaze, **common}),
            partial(gratings.blaze, height_um=blaze),
            lambda m, s, samples: gratings.sampled_blaze(m, s, blaze, samples),
        ),
    )


@dataclass(frozen=True)
class Orders:
    """Orders that propagate, by wavelength, light and order: numbers (n,) and uvw (n, 3)."""

    lambda_nm: Array
    light: NDArray[np.intp]
    order: Array
    uvw: Array

    @property
    def s_per_um(self) -> Array:
        """k w."""
        return np.asarray(2.0 * pi / (1e-3 * self.lambda_nm) * self.uvw[:, 2])

    def by_wavelength(self, power: Callable[[Array, float], Array]) -> Array:
        """Evaluate a power of (uvw, lambda_nm) at all orders, (n,)."""
        found = np.empty(len(self.order))
        for nm in np.unique(self.lambda_nm):
            here = self.lambda_nm == nm
            found[here] = power(self.uvw[here], float(nm))
        return found


def propagating(lambda_nm: Array) -> Orders:
    """Return every order of the period at each wavelength under every light."""
    light = np.radians(LIGHTS_DEG)
    wi = geometry.direction(light[:, 0], light[:, 1])[:, None]
    wr = gratings.view_of_order(wi, _ORDERS, 1e-3 * lambda_nm[:, None, None] / PERIOD_UM)
    nm, which, order = np.meshgrid(lambda_nm, np.arange(len(light)), _ORDERS, indexing="ij")
    seen = np.isfinite(wr[..., 2])
    uvw = geometry.uvw(np.broadcast_to(wi, wr.shape)[seen], wr[seen])
    return Orders(nm[seen], which[seen], order[seen], uvw)


def exact_power(field: HeightField, sigma_um: float) -> Callable[[Array, float], Array]:
    """Return |P|^2 of a grating by the exact reference, a function of (uvw, lambda_nm)."""
    reference = Reference(field, sigma_um, LAMBDA_MIN_NM)
    return lambda uvw, nm: reference.power(uvw, np.array([nm]))[:, 0]


def polar_power(field: HeightField, sigma_um: float, spacing: float) -> Callable[[Array, float], Array]:
    """Return |P|^2 of a grating along x from the polar power spectrum E, a function of (uvw, lambda_nm).

    spacing: of the radii of E, in widths of the window.
    """
    z = expansion.largest_phase(field.half_range_um, LAMBDA_MIN_NM)
    terms, nodes = (expansion.chebyshev_order(z, tolerance) + 1 for tolerance in (1e-7, 1e-6))
    radius = power_spectrum.radii(sigma_um, 2e3 / LAMBDA_MIN_NM, spacing)
    built = power_spectrum.chebyshev_stack(field, sigma_um, float(radius[-1]), terms, 1e-7)
    # orders lie at azimuths 0 and pi, which are nodes of every grid
    table = spectral.build(power_spectrum.build(built, Azimuths(32), radius, LAMBDA_MIN_NM, nodes))
    return lambda uvw, nm: spectral.look_up(table, uvw, np.array([nm]))[:, 0]


def between_radii(spacing: float) -> float:
    """Return the largest error of E midway between radii h = `spacing` sigma_f apart, of an order's peak.

    Lagrange's remainder on 8 nodes, (0.5 1.5 2.5 3.5)^2 h^8 / 8! times the 8th derivative of exp(-x^2) at 0, 1680.
    """
    return 1680.0 / 40320.0 * (0.5 * 1.5 * 2.5 * 3.5) ** 2 * spacing**8


@dataclass(frozen=True)
class Answers:
    """|c_m|^2 of all orders (n,): of the profile and of its samples in closed form, and by every algorithm."""

    profile: Array
    samples: Array
    direct: Array
    reference: Array
    polar: Array
    polar_of_a_line: Array


def answers(grating: KnownGrating, sigma_um: float, at: Orders) -> Answers:
    """Compute a grating's orders by every algorithm."""
    field = grating.field(grating.samples)
    return Answers(
        profile=grating.power(at.order, at.s_per_um),
        samples=grating.sampled(at.order, at.s_per_um, grating.samples),
        direct=at.by_wavelength(partial(power_direct, field, sigma_um)),
        reference=at.by_wavelength(exact_power(field, sigma_um)),
        polar=at.by_wavelength(polar_power(field, sigma_um, FINE_SPACING)),
        polar_of_a_line=at.by_wavelength(polar_power(field, sigma_um, _LINE_SPACING)),
    )


def sampling_error(grating: KnownGrating, samples: int, at: Orders) -> float:
    """Return the largest difference of |c_m|^2 between a number of samples a period and the profile, closed forms."""
    sampled, profile = grating.sampled(at.order, at.s_per_um, samples), grating.power(at.order, at.s_per_um)
    return float(np.max(np.abs(sampled - profile)))


def samples_needed(grating: KnownGrating, at: Orders) -> int:
    """Return the fewest samples a period, an even number, that keep the tolerance."""
    # fewer than two an order do not carry it
    fewest = 2 * int(np.max(np.abs(at.order)))
    return next(samples for samples in range(fewest, 1000, 2) if sampling_error(grating, samples, at) <= TOLERANCE)


def measured_sampling_error(grating: KnownGrating, sigma_um: float, at: Orders, samples: int) -> float:
    """Return the largest difference of |c_m|^2 between the reference on samples and the profile's closed form."""
    found = at.by_wavelength(exact_power(grating.field(samples), sigma_um))
    return float(np.max(np.abs(found - grating.power(at.order, at.s_per_um))))


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page, under the coherence window of the bench's blaze."""
    sigma_um = bench.blazed.sigma_um
    at = propagating(_FEWER_NM if bench.quick else _LAMBDA_NM)
    known, found = known_gratings(), {}
    for done, grating in enumerate(known):
        progress("order efficiencies", done / len(known))
        found[grating.name] = answers(grating, sigma_um, at)
    needed = {g.name: samples_needed(g, at) for g in known[1:]}
    measured = {g.name: [measured_sampling_error(g, sigma_um, at, m) for m in _SAMPLES] for g in known[1:]}
    progress("order efficiencies", 1.0)
    text = PageText("order_efficiencies", tolerance=TOLERANCE, period_um=PERIOD_UM)
    sampled = list(zip(_SAMPLES, *measured.values(), strict=True))
    return text.page(
        checks=[check for grating in known for check in checks_of(grating, found[grating.name])],
        tables=[_table(text, found, at), text.table("sampling", sampled, numbers("{:.1e}", *measured))],
        pictures=_pictures(text, found, measured, at),
        remarks=_remarks(text, needed),
    )


def checks_of(grating: KnownGrating, found: Answers) -> Iterator[Check]:
    """Return the checks of one grating: the largest difference of each algorithm from its closed form."""
    text = PageText("order_efficiencies", key=grating.key, grating=grating.name)

    def check(name: str, difference: Array, **known: float) -> Check:
        return text.check(f"{{key}}.{name}", np.max(np.abs(difference)), **known)

    yield check("direct", found.direct - found.samples)
    yield check("reference", found.reference - found.samples)
    yield check("reference.profile", found.reference - found.profile, bound=TOLERANCE)
    yield check("polar", found.polar - found.profile, bound=TOLERANCE, spacing=FINE_SPACING)
    bound = between_radii(_LINE_SPACING)
    yield check("polar.line", found.polar_of_a_line - found.samples, bound=bound, spacing=_LINE_SPACING)


def _table(text: PageText, found: dict[str, Answers], at: Orders) -> PageTable:
    """Orders 0 and 1 under every light, at the wavelength in the middle."""
    middle = np.unique(at.lambda_nm)[len(np.unique(at.lambda_nm)) // 2]
    shown = np.flatnonzero((at.lambda_nm == middle) & np.isin(at.order, (0, 1)))
    rows: list[tuple[Cell, ...]] = []
    for name, each in found.items():
        answers = np.stack([each.profile, each.reference, each.direct, each.polar], axis=-1)
        rows += [(name, at.order[i], LIGHTS_DEG[at.light[i]], *answers[i]) for i in shown]
    return text.table("orders", rows, middle=middle)


def _pictures(
    text: PageText, found: dict[str, Answers], measured: dict[str, list[float]], at: Orders
) -> list[Picture]:
    known, series = known_gratings(), []
    orders = [[_chart(text, grating, found[grating.name], at, light) for grating in known] for light in _SHOWN]
    for grating, colour in zip(known[1:], COLOURS[1:], strict=False):
        closed = [sampling_error(grating, m, at) for m in _SAMPLES]
        series.append(Series(grating.name, _SAMPLES, closed, colour, "-"))
        series.append(Series("", _SAMPLES, measured[grating.name], colour, "o"))
    sampling = text.chart("sampling", series, level=(TOLERANCE, f"allowed: {TOLERANCE:g}"))
    return [
        text.picture("orders", charts(orders, (4.1, 3.2), shared_legend=True)),
        text.picture("sampling", charts([[sampling]], (7.2, 4.4))),
    ]


def _chart(text: PageText, grating: KnownGrating, found: Answers, at: Orders, light: int) -> Chart:
    """Draw orders near the mirror direction against wavelength under one light."""
    dense = propagating(np.linspace(at.lambda_nm.min(), at.lambda_nm.max(), 181))
    power, series = grating.power(dense.order, dense.s_per_um), []
    for m, colour in zip(_SHOWN_ORDERS, COLOURS, strict=False):
        line, dots = ((each.light == light) & (each.order == m) for each in (dense, at))
        # equal orders of a symmetric grating lie on each other: the negative one's dashes show both
        style, label = "--" if m < 0 else "-", f"m = {m:+d}" if m else "m = 0"
        series.append(Series(label, dense.lambda_nm[line], power[line], colour, style))
        series.append(Series("", at.lambda_nm[dots], found.reference[dots], colour, "o"))
        series.append(Series("", at.lambda_nm[dots], found.polar[dots], colour, "x"))
    return text.chart("orders", series, grating=grating.name, deg=LIGHTS_DEG[light][0])


def _remarks(text: PageText, needed: dict[str, int]) -> list[str]:
    pitches = " and ".join(
        f"{samples} samples a period ({1e3 * PERIOD_UM / samples:.0f} nm) of the {name.split(',')[0]}"
        for name, samples in needed.items()
    )
    line, fine = between_radii(_LINE_SPACING), between_radii(FINE_SPACING)
    radii = text.remark("radii", between_line=line, fine=FINE_SPACING, between_fine=fine)
    return [text.remark("steps", pitches=pitches), radii]
