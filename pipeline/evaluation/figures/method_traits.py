"""The traits of the literature's methods as numbers: agreement of FLSS, NMM's white centre, PQ's fringes, bands.

Each is what [S14] or [D14] says of its pictures.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM
from pipeline.evaluation.figures.maps import bands_of, lit_views, under_normal_light
from pipeline.evaluation.figures.page import BenchSurface
from pipeline.evaluation.methods.dft_terms import FULL
from pipeline.evaluation.methods.flss import Flss
from pipeline.evaluation.methods.method import Method
from pipeline.optics import brdf
from pipeline.optics.light import trapezoid
from pipeline.optics.random_directions import random_pairs
from pipeline.tables.evaluate import Map

_DIRECTIONS, _SEED = 1000, 20140701
# of the mirror: a decade below black at 7500 RU
_DARK = 1e-7
_CENTRE_RADII, _CENTRE_SAMPLES = 3.0, 121
# along the plane of incidence, where Elaphe's first order fades
_FRINGE_RANGE, _FRINGE_SAMPLES, _SMOOTH = (0.3, 0.95), 1301, 0.01
FRINGE_FROM = 0.7
# of Elaphe's primary band: where the first order lies in visible light, and how wide it is seen
_PRIMARY_X, _PRIMARY_Y, _PRIMARY_SAMPLES = (0.35, 0.65), 0.03, (61, 25)
_BAND_X, _BAND_Y = (0.25, 0.75), 0.05


def flss_error(surface: BenchSurface, exact: Method) -> float:
    """Return the worst error of FLSS with full reach at 1 nm on random directions.

    The error is |XYZ - exact| over max(exact, 1e-7 of a mirror).
    """
    wi, wr = random_pairs(None, _DIRECTIONS, _SEED)
    truth = exact.xyz(wi, wr)
    found = Flss(surface.field, surface.config, reach=FULL, step_nm=STEP_NM).xyz(wi, wr)
    return float(np.max(np.abs(found - truth) / np.maximum(truth, _DARK)))


@dataclass(frozen=True)
class Profile:
    """Luminance over a mirror's, (views,), at sin theta of views in the plane of incidence, by method."""

    sin_theta: Array
    luminance: dict[str, Array]


def across_the_centre(surface: BenchSurface, methods: Mapping[str, Method], radius: float) -> Profile:
    """Compute the luminance across the mirror direction, out to three times a radius."""
    return _profile(surface, methods, np.linspace(-1.0, 1.0, _CENTRE_SAMPLES) * _CENTRE_RADII * radius)


def along_the_first_order(surface: BenchSurface, methods: Mapping[str, Method]) -> Profile:
    """Compute the luminance along the plane of incidence, densely."""
    return _profile(surface, methods, np.linspace(*_FRINGE_RANGE, _FRINGE_SAMPLES))


def _profile(surface: BenchSurface, methods: Mapping[str, Method], sin_theta: Array) -> Profile:
    wi, wr = under_normal_light(sin_theta)
    # Y that |P|^2 = 1 would give
    mirror = brdf.direction_factor(surface.config.material, trapezoid(surface.config.light, STEP_NM), wi, wr)
    return Profile(sin_theta, {name: method.xyz(wi, wr)[:, 1] / mirror for name, method in methods.items()})


def oscillation(profile: Profile, name: str) -> float:
    """Return the rms of fringes over the smoothed luminance, beyond sin theta = 0.7.

    Fringes are what a Gaussian of 0.01 in sin theta removes.
    """
    values, sine = profile.luminance[name], profile.sin_theta
    smooth = gaussian_filter1d(values, _SMOOTH / (sine[1] - sine[0]))
    # the filter sees less than its width at the ends
    inner = (sine > FRINGE_FROM) & (sine < _FRINGE_RANGE[1] - 3.0 * _SMOOTH)
    return float(np.sqrt(np.mean((values / smooth - 1.0)[inner] ** 2)))


def lit_share(surface: BenchSurface, method: Method) -> float:
    """Return the share of views in the right half of the primary horizontal band that are not black at 1500 RU."""
    along, across = _PRIMARY_SAMPLES
    x, y = np.meshgrid(np.linspace(*_PRIMARY_X, along), np.linspace(-_PRIMARY_Y, _PRIMARY_Y, across))
    xyz = method.xyz(*under_normal_light(x.ravel(), y.ravel()))
    return float(np.mean(lit_views(xyz / surface.unit)))


def band_contrast(luminance: Array, views: Map) -> float:
    """Return the contrast of the strongest secondary horizontal band of a map's luminance (views,).

    Rows are means over the columns outside the specular lobe.
    """
    axis = (np.arange(views.size) + 0.5) / views.size * 2.0 - 1.0
    columns = (np.abs(axis) > _BAND_X[0]) & (np.abs(axis) < _BAND_X[1])
    profile = views.image(luminance)[:, columns].mean(axis=1)
    return bands_of(profile, axis, _BAND_Y, _BAND_X[1]).contrast


def lopsided(luminance: Array, views: Map) -> float:
    """Return the largest |Y(x, y) - Y(-x, -y)| of a map at normal incidence, over its largest Y."""
    image = views.image(luminance)
    return float(np.max(np.abs(image - image[::-1, ::-1])) / np.max(image))
