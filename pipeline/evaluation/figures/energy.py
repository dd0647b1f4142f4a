"""Energy balance and reciprocity: the scalar model's losses and gains of light, and its symmetries."""

from collections.abc import Iterator, Sequence
from math import pi

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.maps import cosine_views
from pipeline.evaluation.figures.order_efficiencies import LAMBDA_MIN_NM, PERIOD_UM, KnownGrating, known_gratings
from pipeline.evaluation.figures.page import Bench, BenchSurface, Cell, Page, PageTable, PageText, numbers
from pipeline.evaluation.methods.catalogue import EXACT, METHODS, OURS
from pipeline.evaluation.methods.method import Method
from pipeline.evaluation.plots.charts import Series, charts
from pipeline.evaluation.plots.palette import COLOURS
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
_MIRROR_TOLERANCE = 1e-3
_REACH = 6.0  # lobe widths around the mirror direction
_PAIRS, _FEWER_PAIRS = 400, 60
_MIRROR_DEG, _JUDGED_MIRROR = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0), 60.0
# angles at which no order of the gratings lies within its lobe of the horizon, where half of it is seen
_ANGLES_DEG, _FEWER_DEG = np.arange(0.0, 80.1, 5.0), np.array([0.0, 40.0])
_CLEAR_DEG, _SHOWN_DEG = (0.0, 40.0, 60.0), (0.0, 20.0, 40.0, 60.0, 75.0)
_MATERIALS = {
    "schlick": ("Schlick, n = 1.5, shadowing", Material(normalisation="relative")),
    "gold": ("gold, absolute", Material(fresnel="conductor", shadowing=False, normalisation="absolute")),
}
# albedos of gratings, integrated
_Lobes = dict[KnownGrating, Array]


def order_sum(grating: KnownGrating, sigma_um: float, w: float = -1.9) -> float:
    """Return sum |c_m|^2 over all orders that the samples carry, at one w, by the sum over samples: 1 (Parseval).

    (u, v) exceeds that of any directions: w is held, so that the orders are those of one function exp(i k w h).
    """
    order = np.arange(-(grating.samples // 2), (grating.samples + 1) // 2)
    u = order * 1e-3 * LAMBDA_NM / PERIOD_UM
    uvw = np.stack([u, np.zeros_like(u), np.full_like(u, w)], axis=-1)
    # the lowest lies on the Nyquist limit, where rounding may call it unknown
    uvw[0, 0] *= 1.0 - 1e-12
    return float(np.sum(power_direct(grating.field(grating.samples), sigma_um, uvw, LAMBDA_NM)))


def albedo(reference: Reference, sigma_um: float, theta: float, reach: float | None = None) -> float:
    """Return the directional albedo: the integral of the BRDF times cos(tr) over the hemisphere.

    theta: polar angle of the light in the x-z plane, radians. cos(tr) dOmega is the area of the unit disc, on which
    the views are evenly spaced. reach: in lobe widths around the mirror direction, where the rest is dark.
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
    wr = cosine_views(x[seen], y[seen])
    radiance = reference.xyz(_LINE, LOSSLESS, np.broadcast_to(wi, wr.shape), wr)[:, 1]
    return float(np.sum(radiance) / wi[2] * step**2)


def closed_albedo(grating: KnownGrating, theta: Array, period_um: float = PERIOD_UM) -> Array:
    """Return the sum of the efficiencies of a grating's propagating orders, per polar angle (n,)."""
    order = np.arange(-40.0, 41.0)
    wi = geometry.direction(theta, 0.0)[:, None]
    wr = gratings.view_of_order(wi, order, 1e-3 * LAMBDA_NM / period_um)
    s = 2.0 * pi / (1e-3 * LAMBDA_NM) * geometry.uvw(wi, wr)[..., 2]
    return np.asarray(np.nansum(gratings.efficiency(grating.power(order, s), wi, wr), axis=-1))


def asymmetry(method: Method, wi: Array, wr: Array) -> float:
    """Return the largest relative difference of the BRDF when light and view are exchanged.

    Relative to the Y of the pair, at least 1e-12 of the brightest pair's.
    """
    one, other = (method.xyz(a, b)[:, 1] / a[:, 2] for a, b in ((wi, wr), (wr, wi)))
    return float(np.max(np.abs(one - other) / np.maximum(np.abs(one), 1e-12 * np.max(np.abs(one)))))


def pairs(count: int) -> tuple[Array, Array]:
    """Return random lights and views (count, 3), uniform over the hemisphere down to 5 degrees above the horizon."""
    rng = np.random.default_rng(4)
    cosine, phi = rng.uniform(np.cos(np.radians(85.0)), 1.0, (2, count)), rng.uniform(0.0, 2.0 * pi, (2, count))
    wi, wr = geometry.direction(np.arccos(cosine), phi)
    return wi, wr


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: closed forms of gratings, and the bench's own surfaces by integration."""
    sigma_um, known = bench.blazed.sigma_um, known_gratings()
    angles = _FEWER_DEG if bench.quick else _ANGLES_DEG
    clear = [deg for deg in _CLEAR_DEG if not bench.quick or deg in angles]
    flat = Reference(HeightField(np.zeros((8, 32)), (2.0, 2.0)), sigma_um, LAMBDA_MIN_NM)
    mirror = {deg: albedo(flat, sigma_um, np.radians(deg), _REACH) for deg in _MIRROR_DEG}
    progress("energy", 0.1)
    lobes = {each: _albedos(each.field(each.samples), sigma_um, clear) for each in known}
    progress("energy", 0.3)
    snakes = {each.name: _albedos(each.field, each.sigma_um, angles) for each in (bench.elaphe, bench.xenopeltis)}
    progress("energy", 0.7)
    text = PageText("energy", lambda_nm=LAMBDA_NM)
    reciprocity = list(_reciprocity(text, bench.elaphe, _FEWER_PAIRS if bench.quick else _PAIRS))
    progress("energy", 1.0)
    checks = [*_grating_checks(text, sigma_um, mirror, clear, lobes), *reciprocity]
    picture = text.picture("albedo", _curves(text, clear, lobes, angles, snakes))
    return text.page(checks, [_table(text, known, angles, snakes)], [picture])


def _albedos(field: HeightField, sigma_um: float, angles: Sequence[float] | Array) -> Array:
    reference = Reference(field, sigma_um, LAMBDA_MIN_NM)
    return np.array([albedo(reference, sigma_um, theta) for theta in np.radians(angles)])


def _grating_checks(
    text: PageText, sigma_um: float, mirror: dict[float, float], clear: Sequence[float], lobes: _Lobes
) -> Iterator[Check]:
    for each in lobes:
        yield text.check("{key}.order_sum", abs(order_sum(each, sigma_um) - 1.0), key=each.key, grating=each.name)
    for deg, found in mirror.items():
        tolerance = _MIRROR_TOLERANCE if deg <= _JUDGED_MIRROR else None
        yield text.check("mirror.{deg:g}", found, deg=deg, tolerance=tolerance)
    # the hemisphere's integral against the sum over orders, |c_m|^2 G / w^2
    angles = ", ".join(f"{deg:g}" for deg in clear)
    for each, integrated in lobes.items():
        worst = np.max(np.abs(integrated - closed_albedo(each, np.radians(clear))))
        yield text.check("{key}.albedo", worst, key=each.key, grating=each.name, angles=angles)


def _reciprocity(text: PageText, surface: BenchSurface, count: int) -> Iterator[Check]:
    """The reference and the polar table of a surface, under several materials."""
    wi, wr = pairs(count)
    for key, (name, material) in _MATERIALS.items():
        config = surface.config.model_copy(update={"material": material})
        for method, title in ((EXACT, "exact reference"), (OURS, "polar table")):
            found = asymmetry(METHODS[method](surface.field, config), wi, wr)
            known = {"key": key, "method": method.replace(" ", "_"), "title": title}
            yield text.check("reciprocity.{key}.{method}", found, **known, surface=surface.name, material=name)


def _table(text: PageText, known: Sequence[KnownGrating], angles: Array, snakes: dict[str, Array]) -> PageTable:
    shown = [deg for deg in _SHOWN_DEG if deg in angles]
    rows: list[tuple[Cell, ...]] = [(each.name, *closed_albedo(each, np.radians(shown))) for each in known]
    rows += [(name, *found[np.isin(angles, shown)]) for name, found in snakes.items()]
    return text.table("albedo", rows, numbers("{:.3f}", *(f"light at {deg:g}°" for deg in shown)))


def _curves(text: PageText, clear: Sequence[float], lobes: _Lobes, angles: Array, snakes: dict[str, Array]) -> bytes:
    dense, ratios = np.linspace(0.0, 80.0, 641), np.geomspace(1.05, 20.0, 800)
    closed, by_period = [], []
    for each, colour in zip(lobes, COLOURS, strict=False):
        closed.append(Series(each.name, dense, closed_albedo(each, np.radians(dense)), colour, "-"))
        closed.append(Series("", clear, lobes[each], colour, "o"))
        normal = [closed_albedo(each, np.zeros(1), 1e-3 * LAMBDA_NM * ratio)[0] for ratio in ratios]
        by_period.append(Series(each.name, ratios, normal, colour, "-"))
    colours = COLOURS[len(lobes) :]
    integrated = [Series(name, angles, snakes[name], colour) for name, colour in zip(snakes, colours, strict=False)]
    drawn = {"gratings": closed, "snakes": integrated, "periods": by_period}
    return charts([[text.chart(key, series) for key, series in drawn.items()]], (4.3, 4.3))
