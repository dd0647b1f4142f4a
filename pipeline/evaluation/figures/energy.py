"""Energy balance and reciprocity: what the scalar model keeps, what it loses and gains, and what is symmetric."""

from collections.abc import Callable, Sequence
from math import pi

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.figures.order_efficiencies import LAMBDA_MIN_NM, PERIOD_UM, Grating, known_gratings
from pipeline.evaluation.methods.exact import Exact
from pipeline.evaluation.methods.method import Method
from pipeline.evaluation.methods.polar_table import PolarTableMethod
from pipeline.optics import geometry, gratings
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.progress import Progress
from pipeline.surface.heightfield import HeightField

LAMBDA_NM = 550.0
# R = 1 and no shadowing: all light that falls on the surface should leave it
LOSSLESS = Material(fresnel="none", shadowing=False, normalisation="absolute")
_LINE = Light(illuminant=LaserLine(lambda_nm=LAMBDA_NM))
# of views, in widths of an order's lobe on the unit disc: sums of Gaussians so far apart err by 2 exp(-pi^2 / 0.9^2)
_VIEW_SPACING = 0.9
# what G / w^2 changes by across a lobe of the window's width, towards grazing angles
_MIRROR_TOLERANCE, _LOBE_TOLERANCE = 1e-3, 5e-3
_REACH = 6.0  # lobe widths around the mirror direction
# G / w^2 and the sums over terms see light and view in another order
_RECIPROCITY = 1e-10
_PAIRS, _FEWER_PAIRS = 400, 60
_MIRROR_DEG, _JUDGED_MIRROR = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0), 60.0
# angles at which no order of the gratings lies within its lobe of the horizon, where half of it is seen
_ANGLES_DEG, _FEWER_DEG = np.arange(0.0, 80.1, 5.0), np.array([0.0, 40.0])
_CLEAR_DEG = (0.0, 40.0, 60.0)
_MATERIALS = {
    "Schlick, n = 1.5, shadowing": Material(),
    "gold, absolute": Material(fresnel="conductor", shadowing=False, normalisation="absolute"),
}


def order_sum(grating: Grating, sigma_um: float, w: float = -1.9) -> float:
    """sum |c_m|^2 over all orders that the samples carry, at one w, by the sum over samples: 1 (Parseval).

    (u, v) runs past what directions reach: w is held, so that the orders are those of one function exp(i k w h).
    """
    order = np.arange(-(grating.samples // 2), (grating.samples + 1) // 2)
    u = order * 1e-3 * LAMBDA_NM / PERIOD_UM
    uvw = np.stack([u, np.zeros_like(u), np.full_like(u, w)], axis=-1)
    # the lowest lies on the band's limit, where rounding may call it unknown
    uvw[0, 0] *= 1.0 - 1e-12
    return float(np.sum(power_direct(grating.field(grating.samples), sigma_um, uvw, LAMBDA_NM)))


def albedo(reference: Reference, sigma_um: float, theta: float, reach: float | None = None) -> float:
    """Directional albedo: the integral of the BRDF times cos(tr) over the hemisphere.

    The light stands at `theta` in the x-z plane. cos(tr) dOmega is the area of the unit disc, on which the views are
    even. reach: of lobe widths around the mirror direction, where the rest is dark.
    """
    wi = geometry.direction(theta, 0.0)
    width = sigma_f(sigma_um) * 1e-3 * LAMBDA_NM
    step = _VIEW_SPACING * width
    limit = 1.0 if reach is None else reach * width
    axis = np.arange(-np.ceil(limit / step), np.ceil(limit / step) + 1) * step
    x, y = (each.ravel() for each in np.meshgrid(axis, axis))
    if reach is not None:
        x = x - wi[0]
    seen = x**2 + y**2 < 1.0
    wr = np.stack([x[seen], y[seen], np.sqrt(1.0 - x[seen] ** 2 - y[seen] ** 2)], axis=-1)
    radiance = reference.xyz(_LINE, LOSSLESS, np.broadcast_to(wi, wr.shape), wr)[:, 1]
    return float(np.sum(radiance) / wi[2] * step**2)


def closed_albedo(grating: Grating, theta: Array, period_um: float = PERIOD_UM) -> Array:
    """The sum of the efficiencies of a grating's propagating orders, per polar angle (n,)."""
    order = np.arange(-40.0, 41.0)
    wi = geometry.direction(theta, 0.0)[:, None]
    wr = gratings.view_of_order(wi, order, 1e-3 * LAMBDA_NM / period_um)
    s = 2.0 * pi / (1e-3 * LAMBDA_NM) * geometry.uvw(wi, wr)[..., 2]
    return np.asarray(np.nansum(gratings.efficiency(grating.power(order, s), wi, wr), axis=-1))


def asymmetry(method: Method, wi: Array, wr: Array) -> float:
    """Largest relative difference of the BRDF when light and view change places, over the Y of the brightest pair."""
    one, other = (method.xyz(a, b)[:, 1] / a[:, 2] for a, b in ((wi, wr), (wr, wi)))
    return float(np.max(np.abs(one - other) / np.maximum(np.abs(one), 1e-12 * np.max(np.abs(one)))))


def pairs(count: int) -> tuple[Array, Array]:
    """Random lights and views, even over the hemisphere down to 5 degrees above the horizon."""
    rng = np.random.default_rng(4)
    cosine, phi = rng.uniform(np.cos(np.radians(85.0)), 1.0, (2, count)), rng.uniform(0.0, 2.0 * pi, (2, count))
    wi, wr = geometry.direction(np.arccos(cosine), phi)
    return wi, wr


def make(bench: Bench, progress: Progress) -> Figure:
    """The page: closed forms of gratings, and the bench's own surfaces by integration."""
    sigma_um = bench.blazed.config.coherence.sigma_um
    angles = _FEWER_DEG if bench.quick else _ANGLES_DEG
    known, snakes = known_gratings(), (bench.elaphe, bench.xenopeltis)
    sums = {g.name: order_sum(g, sigma_um) for g in known}
    flat = _reference(HeightField(np.zeros((8, 32)), (2.0, 2.0)), sigma_um)
    mirror = {deg: albedo(flat, sigma_um, np.radians(deg), _REACH) for deg in _MIRROR_DEG}
    progress("energy", 0.1)
    clear = [deg for deg in _CLEAR_DEG if not bench.quick or deg in angles]
    lobes = {}
    for grating in known:
        reference = _reference(grating.field(grating.samples), sigma_um)
        lobes[grating.name] = np.array([albedo(reference, sigma_um, np.radians(deg)) for deg in clear])
    progress("energy", 0.3)
    measured = {}
    for surface in snakes:
        reference = _reference(surface.field, surface.config.coherence.sigma_um)
        sigma = surface.config.coherence.sigma_um
        measured[surface.name] = np.array([albedo(reference, sigma, np.radians(deg)) for deg in angles])
    progress("energy", 0.7)
    symmetric = _asymmetries(bench.elaphe, _FEWER_PAIRS if bench.quick else _PAIRS)
    progress("energy", 1.0)
    return Figure(
        name="energy",
        title="Energy balance and reciprocity",
        source="not in [D14] or [S14]",
        expected="The orders of exp(i k w h) share a mirror's light at any one w: their |c_m|² sum to 1, and a flat "
        "mirror's directional albedo is 1. Directions have different w, and G / w² stands before |P|², so a rough "
        "surface keeps its energy only as far as its orders stay away from the horizon. Light and view may change "
        "places exactly.",
        checks=[*_closed_checks(sums, mirror), *_lobe_checks(known, clear, lobes), *_reciprocity_checks(symmetric)],
        tables=[_table(known, snakes, angles, measured)],
        pictures=[_curves(known, clear, lobes, angles, measured)],
        remarks=_remarks(),
        numbers={
            "order_sums": sums,
            "mirror_albedo": mirror,
            "grating_albedo": {g.name: dict(zip(clear, lobes[g.name].tolist(), strict=True)) for g in known},
            "albedo": {
                name: dict(zip(angles.tolist(), found.tolist(), strict=True)) for name, found in measured.items()
            },
            "asymmetry": symmetric,
        },
    )


def _closed_checks(sums: dict[str, float], mirror: dict[float, float]) -> list[Check]:
    """Of gratings' order sums by name, and of the mirror's albedo by the light's angle."""
    orders = [
        Check(f"Σ|c_m|² of all orders at one w, {name}", "1 to 1e-9", f"1 {found - 1.0:+.1e}", abs(found - 1) < 1e-9)
        for name, found in sums.items()
    ]
    albedos = [
        Check(
            f"albedo of a flat mirror, light at {deg:g}°",
            f"1 to {_MIRROR_TOLERANCE:g}" if deg <= _JUDGED_MIRROR else "1 while the lobe is narrow",
            f"{found:.5f}",
            abs(found - 1.0) <= _MIRROR_TOLERANCE if deg <= _JUDGED_MIRROR else None,
        )
        for deg, found in mirror.items()
    ]
    return [*orders, *albedos]


def _reciprocity_checks(symmetric: dict[str, float]) -> list[Check]:
    return [
        Check(
            f"BRDF with light and view changed, {what}",
            f"equal to {_RECIPROCITY:g}",
            f"{found:.1e}",
            found <= _RECIPROCITY,
        )
        for what, found in symmetric.items()
    ]


def _curves(
    known: Sequence[Grating],
    clear: Sequence[float],
    lobes: dict[str, Array],
    angles: Array,
    measured: dict[str, Array],
) -> Picture:
    from pipeline.evaluation.plots import validity_plots

    dense, ratios = np.linspace(0.0, 80.0, 641), np.geomspace(1.05, 20.0, 800)
    drawn = validity_plots.albedo_curves(
        {g.name: (dense, closed_albedo(g, np.radians(dense))) for g in known},
        {g.name: (np.array(clear), lobes[g.name]) for g in known},
        {name: (angles, found) for name, found in measured.items()},
        {g.name: (ratios, _normal_albedo(g, ratios)) for g in known},
    )
    return Picture(
        drawn,
        f"Directional albedo at {LAMBDA_NM:g} nm, R = 1, no shadowing. Left: sums of the propagating orders' "
        "|c_m|² G / w² (lines), the BRDF integrated over the hemisphere (dots). Middle: the bench's snakes, "
        "integrated. Right: gratings in normal light against their period.",
    )


def _reference(field: HeightField, sigma_um: float) -> Reference:
    return Reference(field, sigma_um, LAMBDA_MIN_NM)


def _normal_albedo(grating: Grating, period_over_lambda: Array) -> Array:
    periods = 1e-3 * LAMBDA_NM * period_over_lambda
    return np.array([closed_albedo(grating, np.zeros(1), period)[0] for period in periods])


def _lobe_checks(known: Sequence[Grating], clear: Sequence[float], lobes: dict[str, Array]) -> list[Check]:
    """The hemisphere's integral against the sum over orders, |c_m|^2 G / w^2."""
    found = {g.name: float(np.max(np.abs(lobes[g.name] - closed_albedo(g, np.radians(clear))))) for g in known}
    angles = ", ".join(f"{deg:g}" for deg in clear)
    return [
        Check(
            f"albedo integrated against Σ|c_m|² G / w² of {name}, light at {angles}°",
            f"equal to {_LOBE_TOLERANCE:g}",
            f"{worst:.1e}",
            worst <= _LOBE_TOLERANCE,
        )
        for name, worst in found.items()
    ]


def _asymmetries(surface: Surface, count: int) -> dict[str, float]:
    """Of the reference and of the polar table of a surface, under several materials."""
    wi, wr = pairs(count)
    ways: tuple[tuple[str, Callable[[HeightField, Config], Method]], ...] = (
        ("exact reference", Exact),
        ("polar table", PolarTableMethod),
    )
    return {
        f"{way}, {surface.name}, {name}": asymmetry(
            make_method(surface.field, _with(surface.config, material)), wi, wr
        )
        for name, material in _MATERIALS.items()
        for way, make_method in ways
    }


def _with(config: Config, material: Material) -> Config:
    return config.model_copy(update={"material": material})


def _table(known: Sequence[Grating], snakes: Sequence[Surface], angles: Array, measured: dict[str, Array]) -> Table:
    shown = [deg for deg in (0.0, 20.0, 40.0, 60.0, 75.0) if deg in angles]
    rows = [(g.name, *(f"{value:.3f}" for value in closed_albedo(g, np.radians(shown)))) for g in known] + [
        (s.name, *(f"{measured[s.name][np.flatnonzero(angles == deg)[0]]:.3f}" for deg in shown)) for s in snakes
    ]
    return Table(
        f"Directional albedo at {LAMBDA_NM:g} nm, R = 1: 1 is a surface that loses nothing",
        ("surface", *(f"light at {deg:g}°" for deg in shown)),
        rows,
    )


def _remarks() -> list[str]:
    return [
        (
            "Where it loses: orders below the horizon keep their share of Σ|c_m|², which a real surface would give "
            "to those that propagate, and orders off the mirror direction see a smaller |w|, a shallower surface. "
            "The loss is largest in fine periods and where a blaze points below the horizon."
        ),
        (
            "Where it gains: G / w² grows as 1 / cos(tr) towards the horizon, at normal incidence exactly so. An "
            "order about to pass off is infinitely bright, and light beyond 70° makes albedos well above 1. Only "
            "shadowing, which the default material has, holds that back."
        ),
        "A mirror's albedo is 1 while its lobe is narrow: at 85° a part of it lies below the horizon.",
    ]
