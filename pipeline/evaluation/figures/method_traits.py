"""What sets a method of the literature apart, as a number: FLSS's agreement, NMM's white centre, PQ's fringes, bands.

Each is what [S14] or [D14] says of its pictures.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM
from pipeline.evaluation.figures.exact_maps import lit_views
from pipeline.evaluation.figures.figure import Surface
from pipeline.evaluation.methods.dft_terms import FULL
from pipeline.evaluation.methods.flss import Flss
from pipeline.evaluation.methods.method import Method
from pipeline.optics import brdf, geometry
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
_DARK_SHARE = 1e-9  # of the brightest row: a darker one counts as that dark


def flss_error(surface: Surface, exact: Method) -> float:
    """Worst |XYZ - exact| over max(exact, 1e-7 of a mirror) of FLSS with full reach at 1 nm, on random directions."""
    config = surface.config
    wi, wr = random_pairs(None, _DIRECTIONS, _SEED)
    truth = exact.xyz(wi, wr)
    found = Flss(surface.field, config, reach=FULL, step_nm=STEP_NM).xyz(wi, wr)
    return float(np.max(np.abs(found - truth) / np.maximum(truth, _DARK)))


@dataclass(frozen=True)
class Line:
    """Luminance over a mirror's, (views,), at sin theta of views in the plane of incidence, by method."""

    sin_theta: Array
    luminance: dict[str, Array]


def across_the_centre(surface: Surface, methods: Mapping[str, Method], radius: float) -> Line:
    """Luminance across the mirror direction, out to three times a radius."""
    return _luminance(surface, methods, np.linspace(-1.0, 1.0, _CENTRE_SAMPLES) * _CENTRE_RADII * radius)


def along_the_first_order(surface: Surface, methods: Mapping[str, Method]) -> Line:
    """Luminance along the plane of incidence, densely."""
    return _luminance(surface, methods, np.linspace(*_FRINGE_RANGE, _FRINGE_SAMPLES))


def _luminance(surface: Surface, methods: Mapping[str, Method], sin_theta: Array) -> Line:
    wr = np.stack([sin_theta, np.zeros_like(sin_theta), np.sqrt(1.0 - sin_theta**2)], axis=-1)
    wi = np.broadcast_to(geometry.direction(0.0, 0.0), wr.shape).copy()
    # Y that |P|^2 = 1 would give
    mirror = brdf.direction_factor(surface.config.material, trapezoid(surface.config.light, STEP_NM), wi, wr)
    return Line(sin_theta, {name: method.xyz(wi, wr)[:, 1] / mirror for name, method in methods.items()})


def oscillation(line: Line, name: str) -> float:
    """rms of what a Gaussian of 0.01 in sin theta smooths away, over what it leaves, beyond sin theta = 0.7."""
    values = line.luminance[name]
    smooth = gaussian_filter1d(values, _SMOOTH / (line.sin_theta[1] - line.sin_theta[0]))
    # the filter sees less than its width at the ends
    inner = (line.sin_theta > FRINGE_FROM) & (line.sin_theta < _FRINGE_RANGE[1] - 3.0 * _SMOOTH)
    return float(np.sqrt(np.mean((values / smooth - 1.0)[inner] ** 2)))


def lit_share(surface: Surface, method: Method) -> float:
    """Share of views in the primary horizontal band, right of the mirror direction, that are not black at 1500 RU."""
    along, across = _PRIMARY_SAMPLES
    x, y = np.meshgrid(np.linspace(*_PRIMARY_X, along), np.linspace(-_PRIMARY_Y, _PRIMARY_Y, across))
    wr = np.stack([x.ravel(), y.ravel(), np.sqrt(1.0 - x.ravel() ** 2 - y.ravel() ** 2)], axis=-1)
    wi = np.broadcast_to(geometry.direction(0.0, 0.0), wr.shape).copy()
    return float(np.mean(lit_views(method.xyz(wi, wr) / surface.config.radiometry.unit)))


def band_contrast(luminance: Array, views: Map) -> float:
    """By how much the brightest secondary horizontal band rises above the darkest row between it and the primary one.

    Over that row; rows are means of the luminance (views,) beside the specular lobe.
    """
    columns = (np.arange(views.size) + 0.5) / views.size * 2.0 - 1.0
    beside = (np.abs(columns) > _BAND_X[0]) & (np.abs(columns) < _BAND_X[1])
    profile = views.image(luminance)[:, beside].mean(axis=1)
    distance = np.abs(columns)
    contrast = 0.0
    for side in (columns < 0.0, columns > 0.0):
        outwards = np.flatnonzero(side)[np.argsort(distance[side])]
        outwards = outwards[(distance[outwards] > _BAND_Y) & (distance[outwards] < _BAND_X[1])]
        floor = np.minimum.accumulate(profile[outwards])
        dark = _DARK_SHARE * float(profile.max())
        contrast = max(contrast, float(np.max(profile[outwards] / np.maximum(floor, dark) - 1.0)))
    return contrast


def lopsided(luminance: Array, views: Map) -> float:
    """Largest |Y(x, y) - Y(-x, -y)| of a map at normal incidence, over its largest Y."""
    image = views.image(luminance)
    return float(np.max(np.abs(image - image[::-1, ::-1])) / np.max(image))
