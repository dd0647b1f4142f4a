"""Closed forms of BRDF maps, and where their light goes: the predictions that pages of maps are judged by."""

from collections.abc import Sequence
from math import radians

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import STEP_NM, Reference
from pipeline.evaluation.figures.maps import Light, directions, under_normal_light
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import trapezoid
from pipeline.surface.recipes.parameters import Blazed
from pipeline.tables.evaluate import Map

_SECTOR_RAD = radians(22.5)
# of (u, v): past the specular lobe
SPECULAR_RHO, RHO_MAX = 0.15, 2.0
# orders whose lines reach the first one's neighbourhood
_BLAZE_ORDERS = range(-4, 5)
_PEAK_SAMPLES, _PEAK_WIDTHS = 401, 3.0


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
    wi = np.broadcast_to(geometry.direction(0.0, 0.0), wr.shape)
    rule, uvw = trapezoid(config.light, STEP_NM), geometry.uvw(wi, wr)
    lambda_um, width = 1e-3 * rule.lambda_nm, sigma_f(config.coherence.sigma_um)
    power = np.zeros((len(wr), len(lambda_um)))
    for m in _BLAZE_ORDERS:
        away = uvw[:, :1] / lambda_um - m / recipe.period_um
        order = np.sinc(m + uvw[:, 2:] * recipe.height_um / lambda_um)
        power += (order * np.exp(-0.5 * (away / width) ** 2)) ** 2
    return np.asarray(brdf.direction_factor(config.material, rule, wi, wr) * (power @ rule.weights[:, 1]))


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
