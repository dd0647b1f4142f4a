"""Views of the bench, BRDF maps of its surfaces by every method, their errors, and where their light goes.

Closed forms of maps are the predictions that pages of maps are judged by.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, radians

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import STEP_NM, Reference
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.method import Method, integrated
from pipeline.evaluation.plots import map_plots
from pipeline.evaluation.plots.map_plots import Panel
from pipeline.evaluation.speed.timing import timed
from pipeline.optics import geometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour import delta_e, displayed_srgb, pixels
from pipeline.progress import Progress
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed
from pipeline.tables.evaluate import Map

# [D14] sec. 7 shows its maps at 1500 RU; table 2 ends at 7500
SHOWN_RU, STRICT_RU = EXPOSURES_RU = 1500.0, 7500.0
# one just noticeable difference ([D14] sec. 6.3)
NOTICEABLE = 1.0
# |(u, v)| of Xenopeltis' first order along its fingers, 1.5 um apart, in visible light
XENOPELTIS_RHO = (0.25, 0.5)
# a step of luminance that is barely seen (Weber's fraction): a band of less contrast counts as none
VISIBLE_CONTRAST = 0.02
# of the brightest row: a darker one counts as that dark, for beyond the scan's Nyquist limit all is dark
_DARK_SHARE = 1e-9
_SIZE, _QUICK_SIZE = 201, 61
# enough to compile what a method runs on the device
_WARM_UP = Map(11, MAP_RADIUS)
# one of 255 steps of a channel, linear: below it a pixel is black
_LIT = (1.0 / 255.0) ** 2.2
_SECTOR_RAD = radians(22.5)
# of (u, v): past the specular lobe
SPECULAR_RHO, RHO_MAX = 0.15, 2.0
# orders whose lines reach the first one's neighbourhood
_BLAZE_ORDERS = range(-4, 5)
_PEAK_SAMPLES, _PEAK_WIDTHS = 401, 3.0
# (theta, phi) in degrees
Light = tuple[float, float]
NORMAL: Light = (0.0, 0.0)


def views_of(bench: Bench) -> Map:
    """Return the views of every map of the bench: inside radius 0.98, as errors are stated."""
    return Map(_QUICK_SIZE if bench.quick else _SIZE, MAP_RADIUS)


def directions(views: Map, light: Light) -> tuple[Array, Array]:
    """Return wi and wr (views, 3) of a map under one light."""
    wr = views.views()
    wi = geometry.direction(np.radians(light[0]), np.radians(light[1]))
    return np.ascontiguousarray(np.broadcast_to(wi, wr.shape)), wr


def blazed_recipe(bench: Bench) -> Blazed:
    """Return the recipe of the bench's blazed grating. Raises ValueError where it is another surface."""
    recipe = bench.blazed.config.surface.recipe
    if not isinstance(recipe, Blazed):
        raise ValueError(f"{bench.blazed.name}: expected a blazed recipe")
    return recipe


def mean_delta_e(surface: BenchSurface, found: Array, exact: Array, exposure_ru: float) -> float:
    """Return the mean CIELAB error over the views of XYZ (views, 3)."""
    return float(np.mean(delta_e(found / surface.unit, exact / surface.unit, exposure_ru)))


def lit_views(xyz_ru: Array) -> NDArray[np.bool_]:
    """Return the views (views,) of XYZ in RU (views, 3) that are not black at 1500 RU: few of a grating's map are."""
    return np.asarray(np.max(displayed_srgb(xyz_ru, SHOWN_RU), axis=-1) > _LIT)


def exact_maps(surface: BenchSurface, views: Map, lights: Sequence[Light], progress: Progress) -> list[Array]:
    """Compute XYZ (views, 3) by the exact reference, one map a light."""
    exact, config = surface.reference(progress), surface.config
    return [
        exact.xyz(config.light, config.material, *directions(views, light), progress=progress) for light in lights
    ]


def panel(views: Map, xyz_ru: Array, title: str, note: str = "") -> Panel:
    """Return a map of XYZ in RU (views, 3) at 1500 RU, for a sheet of maps."""
    return Panel(pixels(views.image(xyz_ru), SHOWN_RU), title, note)


def sheet(rows: Sequence[Sequence[Panel]], heading: str, row_names: Sequence[str] = ()) -> bytes:
    """Draw maps in rows under a heading that names their exposure, PNG."""
    return map_plots.sheet(rows, f"{heading}, {SHOWN_RU:g} RU, sRGB", row_names)


@dataclass(frozen=True)
class Run:
    """A prepared method, XYZ of its map (views, 3), and the seconds of either."""

    name: str
    method: Method
    xyz: Array
    prepare_s: float
    map_s: float

    @property
    def total_s(self) -> float:
        return self.prepare_s + self.map_s


def run(name: str, surface: BenchSurface, views: Map) -> Run:
    """Run a method of the catalogue, from the height field to the map at normal incidence."""
    method, prepare_s = timed(lambda: METHODS[name](surface.field, surface.config))
    wi, wr = directions(views, NORMAL)
    xyz, map_s = timed(lambda: method.xyz(wi, wr))
    return Run(name, method, xyz, prepare_s, map_s)


def on_elaphe(bench: Bench, name: str) -> Run:
    """Run a method on the bench's Elaphe, its kernels compiled beforehand; once for all pages."""
    if name not in bench.runs:
        run(name, bench.elaphe, _WARM_UP)
        bench.runs[name] = run(name, bench.elaphe, views_of(bench))
    return bench.runs[name]


def cosine_views(x: ArrayLike, y: ArrayLike = 0.0) -> Array:
    """Return the views (n, 3) whose direction cosines along x and y are given, (n,) or one number each."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    return np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1)


def under_normal_light(x: ArrayLike, y: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Return wi at normal incidence and wr, (n, 3) each, for direction cosines as `cosine_views` takes them."""
    wr = cosine_views(x, y)
    return np.broadcast_to(geometry.direction(0.0, 0.0), wr.shape).copy(), wr


def window_on_sample_zero(field: HeightField) -> HeightField:
    """Return the patch rolled by half its size: the window lies on sample 0, over the seams, as in public codes."""
    ny, nx = field.shape
    return HeightField(np.roll(field.heights_um, (ny // 2, nx // 2), axis=(0, 1)), field.pitch_um)


@dataclass(frozen=True)
class Bands:
    """Secondary horizontal bands above and below the primary one.

    profile: mean luminance of each row (rows,), from the top. contrast: the largest rise above the darkest row
    further in, over that row. share: of the light outside the primary band, the part that is such a rise.
    """

    profile: Array
    contrast: float
    share: float


def bands_of(profile: Array, axis: Array, primary: float, reach: float = inf) -> Bands:
    """Find the bands of an image's rows.

    profile: mean luminance of each row (rows,). axis: place of each row from the mirror direction, evenly spaced, in
    any unit. primary: half-width of the primary band; reach: where the search ends; both in that unit.
    """
    dark = _DARK_SHARE * float(profile.max())
    contrast, excess, light = 0.0, 0.0, 0.0
    for side in (axis <= 0.0, axis >= 0.0):
        outwards = np.flatnonzero(side)[np.argsort(np.abs(axis[side]))]
        values, distance = profile[outwards], np.abs(axis[outwards])
        outside = (distance > primary) & (distance < reach)
        floor = np.minimum.accumulate(values)[outside]
        rise = values[outside] - floor
        contrast = max(contrast, float(np.max(rise / np.maximum(floor, dark))))
        excess, light = excess + float(rise.sum()), light + float(values[outside].sum())
    return Bands(profile, contrast, excess / light)


def sectors(
    luminance: Array, views: Map, light: Light, rho: tuple[float, float] = (SPECULAR_RHO, RHO_MAX)
) -> tuple[float, float]:
    """Return the shares of a ring's luminance (views,) within 22.5 degrees of the horizontal and of the vertical.

    rho: the ring's radii in (u, v). Pixels are evenly spaced in the views' direction cosines, so their sum is the
    reflected flux over cos(theta_r).
    """
    _, angle, ring = _polar(views, light, rho)
    total = luminance[ring].sum()
    horizontal = luminance[ring & (angle < _SECTOR_RAD)].sum()
    vertical = luminance[ring & (angle > radians(90.0) - _SECTOR_RAD)].sum()
    return float(horizontal / total), float(vertical / total)


def below_over_above(luminance: Array, views: Map, light: Light, rho: tuple[float, float]) -> float:
    """Return the luminance (views,) of a ring's vertical sector below the mirror direction over that above it."""
    v, angle, ring = _polar(views, light, rho)
    vertical = ring & (angle > radians(90.0) - _SECTOR_RAD)
    # v = -wi_y - wr_y grows downwards
    return float(luminance[vertical & (v > 0.0)].sum() / luminance[vertical & (v <= 0.0)].sum())


def _polar(views: Map, light: Light, rho: tuple[float, float]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return v, the angle between (u, v) and the horizontal, 0 to 90 degrees, and the ring's views, (views,) each."""
    uvw = geometry.uvw(*directions(views, light))
    distance = np.hypot(uvw[:, 0], uvw[:, 1])
    angle = np.arctan2(np.abs(uvw[:, 1]), np.abs(uvw[:, 0]))
    return uvw[:, 1], angle, (distance > rho[0]) & (distance <= rho[1])


def first_orders(
    wr: Array, recipe: Blazed, range_nm: tuple[float, float]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the views (views,) in a grating's plane and its first order, left and right, at normal incidence."""
    low, high = (1e-3 * nm / recipe.period_um for nm in range_nm)
    # an odd number of pixels has a row of them in the plane
    in_plane = (np.abs(wr[:, 1]) < 1e-9) & (np.abs(wr[:, 0]) > low) & (np.abs(wr[:, 0]) < high)
    return in_plane & (wr[:, 0] < 0.0), in_plane & (wr[:, 0] > 0.0)


def blazed_luminance(config: Config, recipe: Blazed, wr: Array) -> Array:
    """Return Y (views,) of a sawtooth at normal incidence for views in its plane.

    c_m = sinc(m + w h / lambda), each order seen through the window's transform.
    """
    width = sigma_f(config.coherence.sigma_um)

    def power(uvw: Array, lambda_nm: Array) -> Array:
        lambda_um, total = 1e-3 * lambda_nm, np.zeros((len(uvw), len(lambda_nm)))
        for m in _BLAZE_ORDERS:
            away = uvw[:, :1] / lambda_um - m / recipe.period_um
            order = np.sinc(m + uvw[:, 2:] * recipe.height_um / lambda_um)
            total += (order * np.exp(-0.5 * (away / width) ** 2)) ** 2
        return total

    return integrated(power, config, np.broadcast_to(geometry.direction(0.0, 0.0), wr.shape), wr, STEP_NM)[:, 1]


def order_sines(
    exact: Reference, sigma_um: float, period_um: float, lambda_nm: float, orders: Sequence[int]
) -> tuple[Array, Array]:
    """Return sin theta along the vertical of a period's orders at normal incidence, expected and found.

    Expected is m lambda / period; found is where |P|^2 is brightest within three widths of the window's transform.
    """
    lambda_um = 1e-3 * lambda_nm
    expected = lambda_um / period_um * np.array(orders)
    offsets = np.linspace(-1.0, 1.0, _PEAK_SAMPLES) * _PEAK_WIDTHS * sigma_f(sigma_um) * lambda_um
    wi, wr = under_normal_light(0.0, (expected[:, None] + offsets).ravel())
    power = exact.power(geometry.uvw(wi, wr), np.array([lambda_nm])).reshape(len(orders), -1)
    return expected, np.asarray(expected + offsets[np.argmax(power, axis=1)])
