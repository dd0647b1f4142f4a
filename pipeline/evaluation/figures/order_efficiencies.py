"""Order efficiencies against closed forms: what neither [D14] nor [S14] checked."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.diffraction import expansion, power_spectrum
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Table
from pipeline.optics import geometry, gratings
from pipeline.progress import Progress
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Recipe, Rectangular, Sinusoid
from pipeline.tables.polar import spectral

if TYPE_CHECKING:
    from pipeline.evaluation.plots import validity_plots

# of a mirror's peak: what is asked of every order
TOLERANCE = 1e-4
# the reference's promise
ROUNDING = 1e-9
# of radii of E, in sigma_f: a laser line's 0.4 leaves 1e-3 between them
FINE_SPACING = 0.25

PERIOD_UM, LAMBDA_MIN_NM = 2.5, 380.0
# the patch repeats; along the grooves nothing varies
_SIZE_UM, _PITCH_Y_UM = (65.0, 8.0), 1.0
# polar and azimuthal angle of the light: in the plane of the orders, and across it
LIGHTS_DEG = ((0.0, 0.0), (30.0, 0.0), (60.0, 180.0), (45.0, 60.0))
_LAMBDA_NM, _FEWER_NM = np.linspace(400.0, 760.0, 10), np.array([400.0, 560.0, 720.0])
_ORDERS = np.arange(-12.0, 13.0)
_SAMPLES = 2 ** np.arange(5, 10)
# drawn: of the lights, and of the orders
_SHOWN, _SHOWN_ORDERS = (0, 2), (-2, -1, 0, 1, 2)

# |c_m|^2 of orders at s, 1/um
Power = Callable[[Array, Array], Array]
_LINE_SPACING = power_spectrum.SPACING_OF_A_LINE


@dataclass(frozen=True)
class Grating:
    """A surface of known orders. samples: of a period, so many that sampling it errs by less than the tolerance."""

    name: str
    samples: int
    recipe: Callable[[dict[str, Any]], Recipe]
    power: Power
    sampled: Callable[[Array, Array, int], Array]

    def field(self, samples: int) -> HeightField:
        """A patch of whole periods with so many samples each."""
        pitch_um = (PERIOD_UM / samples, _PITCH_Y_UM)
        return recipes.make(self.recipe({"period_um": PERIOD_UM, "size_um": _SIZE_UM, "pitch_um": pitch_um}))


def known_gratings() -> tuple[Grating, ...]:
    """A sinusoid, a rectangle of half the period and a blaze."""
    amplitude, step, blaze = 0.1, 0.15, 0.25
    return (
        Grating(
            f"sinusoid, a = {amplitude:g} µm",
            32,
            lambda common: Sinusoid(kind="sinusoid", amplitude_um=amplitude, **common),
            partial(gratings.sinusoid, amplitude_um=amplitude),
            # what a smooth phase folds back from beyond 16 orders is below rounding
            lambda m, s, _: gratings.sinusoid(m, s, amplitude),
        ),
        Grating(
            f"rectangle, H = {step:g} µm",
            128,
            lambda common: Rectangular(kind="rectangular", height_um=step, duty=0.5, **common),
            partial(gratings.rectangle, height_um=step, duty=0.5),
            lambda m, s, samples: gratings.sampled_rectangle(m, s, step, 0.5, samples),
        ),
        Grating(
            f"blaze, H = {blaze:g} µm",
            64,
            lambda common: Blazed(kind="blazed", height_um=blaze, **common),
            partial(gratings.blaze, height_um=blaze),
            lambda m, s, samples: gratings.sampled_blaze(m, s, blaze, samples),
        ),
    )


@dataclass(frozen=True)
class Places:
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
        """A power of (uvw, lambda_nm) at all places."""
        found = np.empty(len(self.order))
        for nm in np.unique(self.lambda_nm):
            here = self.lambda_nm == nm
            found[here] = power(self.uvw[here], float(nm))
        return found


def places(lambda_nm: Array) -> Places:
    """Every order of the period at each wavelength under every light."""
    light = np.radians(LIGHTS_DEG)
    wi = geometry.direction(light[:, 0], light[:, 1])[:, None]
    wr = gratings.view_of_order(wi, _ORDERS, 1e-3 * lambda_nm[:, None, None] / PERIOD_UM)
    nm, which, order = np.meshgrid(lambda_nm, np.arange(len(light)), _ORDERS, indexing="ij")
    seen = np.isfinite(wr[..., 2])
    uvw = geometry.uvw(np.broadcast_to(wi, wr.shape)[seen], wr[seen])
    return Places(nm[seen], which[seen], order[seen], uvw)


def polar_power(field: HeightField, sigma_um: float, spacing: float) -> Callable[[Array, float], Array]:
    """|P|^2 of a grating along x from the polar power spectrum E, its radii `spacing` widths of the window apart."""
    z = expansion.largest_phase(field.half_range_um, LAMBDA_MIN_NM)
    terms, nodes = (expansion.chebyshev_order(z, tolerance) + 1 for tolerance in (1e-7, 1e-6))
    radius = power_spectrum.radii(sigma_um, 2e3 / LAMBDA_MIN_NM, spacing)
    built = power_spectrum.chebyshev_stack(field, sigma_um, float(radius[-1]), terms, 1e-7)
    # orders lie at azimuths 0 and pi, which are nodes of every grid
    table = spectral.build(power_spectrum.build(built, Azimuths(32), radius, LAMBDA_MIN_NM, nodes))
    return lambda uvw, nm: spectral.look_up(table, uvw, np.array([nm]))[:, 0]


def between_radii(spacing: float) -> float:
    """Largest error of E midway between radii h = `spacing` sigma_f apart, of an order's peak.

    Lagrange's remainder on 8 nodes, (0.5 1.5 2.5 3.5)^2 h^8 / 8! times the 8th derivative of exp(-x^2) at 0, 1680.
    """
    return 1680.0 / 40320.0 * (0.5 * 1.5 * 2.5 * 3.5) ** 2 * spacing**8


@dataclass(frozen=True)
class Answers:
    """|c_m|^2 at all places (n,): of the profile and of its samples in closed form, and by every route."""

    profile: Array
    samples: Array
    direct: Array
    reference: Array
    polar: Array
    polar_of_a_line: Array


def answers(grating: Grating, sigma_um: float, at: Places) -> Answers:
    """All routes to a grating's orders."""
    field = grating.field(grating.samples)
    reference = Reference(field, sigma_um, LAMBDA_MIN_NM)
    return Answers(
        profile=grating.power(at.order, at.s_per_um),
        samples=grating.sampled(at.order, at.s_per_um, grating.samples),
        direct=at.by_wavelength(partial(power_direct, field, sigma_um)),
        reference=at.by_wavelength(lambda uvw, nm: reference.power(uvw, np.array([nm]))[:, 0]),
        polar=at.by_wavelength(polar_power(field, sigma_um, FINE_SPACING)),
        polar_of_a_line=at.by_wavelength(polar_power(field, sigma_um, _LINE_SPACING)),
    )


def sampling_error(grating: Grating, samples: int, at: Places) -> float:
    """Largest |c_m|^2 of so many samples a period less that of the profile itself."""
    sampled, profile = grating.sampled(at.order, at.s_per_um, samples), grating.power(at.order, at.s_per_um)
    return float(np.max(np.abs(sampled - profile)))


def samples_needed(grating: Grating, at: Places) -> int:
    """The fewest samples a period, an even number, that keep the tolerance."""
    # fewer than two an order do not carry it
    fewest = 2 * int(np.max(np.abs(at.order)))
    return next(samples for samples in range(fewest, 1000, 2) if sampling_error(grating, samples, at) <= TOLERANCE)


def measured_sampling_error(grating: Grating, sigma_um: float, at: Places, samples: int) -> float:
    """What the exact reference of so many samples a period differs by from the profile's closed form."""
    reference = Reference(grating.field(samples), sigma_um, LAMBDA_MIN_NM)
    found = at.by_wavelength(lambda uvw, nm: reference.power(uvw, np.array([nm]))[:, 0])
    return float(np.max(np.abs(found - grating.power(at.order, at.s_per_um))))


def make(bench: Bench, progress: Progress) -> Figure:
    """The page, under the coherence window of the bench's blaze."""
    from pipeline.evaluation.plots import validity_plots

    sigma_um = bench.blazed.config.coherence.sigma_um
    at = places(_FEWER_NM if bench.quick else _LAMBDA_NM)
    known = known_gratings()
    found = {}
    for done, grating in enumerate(known):
        progress("order efficiencies", done / len(known))
        found[grating.name] = answers(grating, sigma_um, at)
    edged = known[1:]
    needed = {g.name: samples_needed(g, at) for g in edged}
    measured = {g.name: [measured_sampling_error(g, sigma_um, at, int(m)) for m in _SAMPLES] for g in edged}
    progress("order efficiencies", 1.0)
    return Figure(
        name="order_efficiencies",
        title="Order efficiencies against closed forms",
        source="not in [D14] or [S14]",
        expected="|P|² at f = m / period is |c_m|², the Fourier coefficient of exp(i k w h): a Bessel function of a "
        "sinusoid, the sinc of a step and of a sawtooth. Wanted of the reference and of the polar power spectrum: "
        f"{TOLERANCE:g} of the mirror's peak, in normal and oblique light, in the plane of the orders and across it.",
        checks=[check for grating in known for check in _checks(grating.name, found[grating.name])],
        tables=[_table(found, at)],
        pictures=[
            Picture(
                validity_plots.order_curves(
                    [[_panel(g, found[g.name], at, light) for g in known] for light in _SHOWN]
                ),
                f"|c_m|² against wavelength, period {PERIOD_UM:g} µm. Lines: closed forms. Dots: exact reference. "
                "Crosses: polar power spectrum E. Above in normal light, below at 60°.",
            ),
            Picture(
                validity_plots.sampling_curves(
                    measured,
                    {g.name: [sampling_error(g, int(m), at) for m in _SAMPLES] for g in edged},
                    _SAMPLES,
                    TOLERANCE,
                ),
                "Sharp edges under sampling: the largest difference from the profile's closed form, of the exact "
                "reference (dots) and of the geometric sums (lines).",
            ),
        ],
        remarks=_remarks(needed),
        numbers={
            "orders": len(at.order),
            "largest_difference": {name: _differences(each) for name, each in found.items()},
            "samples_a_period": needed,
            "sampling_error": {
                name: dict(zip(_SAMPLES.tolist(), each, strict=True)) for name, each in measured.items()
            },
        },
    )


def _panel(grating: Grating, found: Answers, at: Places, light: int) -> "validity_plots.OrderPanel":
    """Orders near the mirror direction against wavelength under one light."""
    from pipeline.evaluation.plots import validity_plots

    dense = places(np.linspace(at.lambda_nm.min(), at.lambda_nm.max(), 181))
    power = grating.power(dense.order, dense.s_per_um)

    def by_order(where: Places, values: Array) -> dict[int, tuple[Array, Array]]:
        chosen = {m: (where.light == light) & (where.order == m) for m in _SHOWN_ORDERS}
        return {m: (where.lambda_nm[mask], values[mask]) for m, mask in chosen.items()}

    return validity_plots.OrderPanel(
        f"{grating.name}, light at {LIGHTS_DEG[light][0]:g}°",
        by_order(dense, power),
        by_order(at, found.reference),
        by_order(at, found.polar),
    )


def _differences(found: Answers) -> dict[str, float]:
    """Largest differences from the closed forms, in the order of the checks."""
    stated = {
        "sum over samples, from the samples' closed form": found.direct - found.samples,
        "exact reference, from the samples' closed form": found.reference - found.samples,
        "exact reference, from the profile's": found.reference - found.profile,
        f"polar power spectrum E, radii {FINE_SPACING:g} σ_f apart, from the profile's": found.polar - found.profile,
        f"polar power spectrum E, radii {_LINE_SPACING:g} σ_f apart (a laser line's), from the samples'": (
            found.polar_of_a_line - found.samples
        ),
    }
    return {what: float(np.max(np.abs(difference))) for what, difference in stated.items()}


def _checks(name: str, found: Answers) -> list[Check]:
    bounds = (ROUNDING, ROUNDING, TOLERANCE, TOLERANCE, between_radii(_LINE_SPACING))
    return [
        Check(f"{name}: {what}", f"≤ {bound:.2g}", f"{worst:.1e}", worst <= bound)
        for (what, worst), bound in zip(_differences(found).items(), bounds, strict=True)
    ]


def _table(found: dict[str, Answers], at: Places) -> Table:
    """Orders 0 and 1 under every light, at the wavelength in the middle."""
    middle = np.unique(at.lambda_nm)[len(np.unique(at.lambda_nm)) // 2]
    rows = [
        (
            f"{name}, m = {at.order[i]:.0f}",
            "{:g}°, azimuth {:g}°".format(*LIGHTS_DEG[at.light[i]]),
            *(f"{values[i]:.7f}" for values in (each.profile, each.reference, each.direct, each.polar)),
        )
        for name, each in found.items()
        for i in np.flatnonzero((at.lambda_nm == middle) & np.isin(at.order, (0, 1)))
    ]
    columns = (
        "grating and order",
        "light",
        "closed form",
        "exact reference",
        "sum over samples",
        "polar power spectrum E",
    )
    return Table(f"|c_m|² at {middle:g} nm", columns, rows)


def _remarks(needed: dict[str, int]) -> list[str]:
    pitches = " and ".join(
        f"{samples} samples a period ({1e3 * PERIOD_UM / samples:.0f} nm) of the {name.split(',')[0]}"
        for name, samples in needed.items()
    )
    return [
        (
            "A step is not band-limited, so its samples are another grating, above the profile's orders by up to 4 "
            "/ 3M² of a rectangle and 1 / 3M² of a blaze, M samples a period. The reference shows that to rounding, "
            f"so the error is the samples' and not the sum's. {TOLERANCE:g} of the mirror takes {pitches}. A "
            "sinusoid needs no more samples than its orders do."
        ),
        (
            "E between its radii is interpolated on 8 of them. At a laser line's distance that leaves "
            f"{between_radii(_LINE_SPACING):.1e} of an order's peak at most, at {FINE_SPACING:g} σ_f "
            f"{between_radii(FINE_SPACING):.1e}. Integrals over wavelengths average it out."
        ),
    ]
