"""Gratings in closed form: the directions of their orders, and the share of the light that each order takes.

A grating of period L along x has P(f) = c_m at f = m / L (under a window of many periods), the Fourier coefficient of
exp(i s h) with s = k w < 0. Powers |c_m|^2 are shares of a mirror's and sum to 1 over all m at fixed s.

In the plane of incidence the grating equation, [D14] eq. 13, reads sin theta_i = sin phi + m lambda / a. theta_i is
the angle of the light to the normal. phi is the angle of the view in the same plane, positive on the mirror's side;
the mirror direction has phi = theta_i and m = 0. With the light at azimuth phi_i,

    wi = ( sin theta_i d, cos theta_i),  wr = (-sin phi d, cos phi),  d = (cos phi_i, sin phi_i),
    (u, v) = -wi - wr = -(m lambda / a) d,

so that order m of a grating of period a along d has the frequency f = (u, v) / lambda = -(m / a) d at every
wavelength. Orders m > 0 lean back from the mirror direction towards the normal and the light.
"""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Array
from pipeline.optics import geometry

# the closed forms broadcast their arguments: order m, s = k w in 1/um, heights in um
Values = Array | float


def view_of_order(wi: Array, order: Values, lambda_over_period: Values) -> Array:
    """Computes the direction of order m of a grating along x, wr = -wi - (m lambda / L, 0, .) ([D14] eq. 13).

    wi: unit vector towards the light (..., 3). order: m (...,). lambda_over_period: lambda / L (...,), of one unit.
    Returns unit vectors (..., 3); z is NaN where the order does not propagate.
    """
    x = -wi[..., 0] - np.asarray(order) * np.asarray(lambda_over_period)
    y = np.broadcast_to(-wi[..., 1], x.shape)
    rest = 1.0 - x**2 - y**2
    return np.stack([x, y, np.sqrt(np.where(rest > 0.0, rest, np.nan))], axis=-1)


def viewing_angle(theta_i: float, period_um: ArrayLike, lambda_um: ArrayLike, order: int = 1) -> Array:
    """Solves the grating equation for the angle phi of an order, radians.

    theta_i: angle of the light, radians. period_um, lambda_um: um; they broadcast. order: m.
    Returns phi in their common shape; NaN where the order does not propagate.
    """
    sine = np.sin(theta_i) - order * np.asarray(lambda_um, float) / np.asarray(period_um, float)
    return np.arcsin(np.where(np.abs(sine) <= 1.0, sine, np.nan))


def period_um(theta_i: float, phi: ArrayLike, lambda_um: ArrayLike, order: int = 1) -> Array:
    """Solves the grating equation for the period a = m lambda / (sin theta_i - sin phi), um.

    theta_i, phi: angles of light and view, radians. lambda_um: um; it broadcasts with phi. order: m.
    Returns a in their common shape; infinity in the mirror direction, which is order 0 of every period.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(order * np.asarray(lambda_um, float) / (np.sin(theta_i) - np.sin(phi)))


def in_plane(theta_i: float, azimuth: float, phi: ArrayLike) -> tuple[Array, Array]:
    """Converts a light at (theta_i, azimuth) and views at angles phi (...,) in its plane to unit vectors.

    All angles are in radians. Returns wi, wr, (..., 3) each.
    """
    phi = np.asarray(phi, float)
    x, y = np.cos(azimuth), np.sin(azimuth)
    wr = np.stack([-np.sin(phi) * x, -np.sin(phi) * y, np.cos(phi)], axis=-1)
    wi = np.array([np.sin(theta_i) * x, np.sin(theta_i) * y, np.cos(theta_i)])
    return np.broadcast_to(wi, wr.shape), wr


def efficiency(power: Values, wi: Array, wr: Array) -> Array:
    """Computes the share of the incident light that the scalar BRDF reflects into an order: |c_m|^2 G / w^2.

    It is the BRDF G / (lambda^2 w^2) 4 pi sigma^2 |P|^2 of a perfect metal, integrated over the order's lobe:
    cos(tr) dOmega = du dv, |P|^2 = |c_m|^2 exp(-|f - f_m|^2 / sigma_f^2), and the integral of that exponential over f
    is pi sigma_f^2 = 1 / (4 pi sigma^2). At normal incidence G / w^2 = 1 / cos(tr).

    power: |c_m|^2 (...,). wi, wr: unit vectors (..., 3) towards the light and of the order.
    """
    return np.asarray(power * geometry.obliquity(wi, wr) / geometry.uvw(wi, wr)[..., 2] ** 2)


def sinusoid(order: Values, s_per_um: Values, amplitude_um: Values) -> Array:
    """Computes |c_m|^2 = J_m(s a)^2 of h = a cos(2 pi x / L), by the Jacobi-Anger expansion."""
    from scipy.special import jv

    return np.asarray(jv(order, np.asarray(s_per_um) * amplitude_um) ** 2)


def blaze(order: Values, s_per_um: Values, height_um: Values) -> Array:
    """Computes |c_m|^2 = sinc^2(m + s H / 2 pi) of a sawtooth that rises towards +x from 0 to H.

    sinc(x) = sin(pi x) / (pi x).
    """
    return np.asarray(np.sinc(_shift(order, s_per_um, height_um)) ** 2)


def sampled_blaze(order: Values, s_per_um: Values, height_um: Values, samples: int) -> Array:
    """Computes |c_m|^2 of a sawtooth sampled at M = `samples` positions per period: a geometric sum, not an integral.

    It exceeds `blaze` by at most sin^2(pi d) / (3 M^2) where d = m + s H / 2 pi is well below M.
    """
    shift = _shift(order, s_per_um, height_um)
    return np.asarray((np.sinc(shift) / np.sinc(shift / samples)) ** 2)


def rectangle(order: Values, s_per_um: Values, height_um: Values, duty: float) -> Array:
    """Computes |c_m|^2 of a profile of height H over the share `duty` of each period, and 0 elsewhere.

    |c_m|^2 = 4 sin^2(s H / 2) sin^2(pi m duty) / (pi m)^2, and 1 - 4 duty (1 - duty) sin^2(s H / 2) at m = 0.
    """
    return _two_levels(order, s_per_um, height_um, duty, np.ones(()))


def sampled_rectangle(order: Values, s_per_um: Values, height_um: Values, duty: float, samples: int) -> Array:
    """Computes |c_m|^2 of a rectangle sampled at M = `samples` positions per period, where duty M is an integer.

    M sin(pi m / M) replaces pi m. The result exceeds `rectangle` by at most 4 / (3 M^2) where m is well below M.
    """
    return _two_levels(order, s_per_um, height_um, duty, np.sinc(np.asarray(order) / samples))


def _shift(order: Values, s_per_um: Values, height_um: Values) -> Array:
    """Computes the distance of an order from the blaze, in orders."""
    return np.asarray(order + np.asarray(s_per_um) * height_um / (2.0 * np.pi))


def _two_levels(order: Values, s_per_um: Values, height_um: Values, duty: float, lengthened: Array) -> Array:
    order, step = np.asarray(order), np.sin(0.5 * np.asarray(s_per_um) * height_um) ** 2
    side = 4.0 * step * (duty * np.sinc(order * duty) / lengthened) ** 2
    return np.asarray(np.where(order == 0, 1.0 - 4.0 * duty * (1.0 - duty) * step, side))
