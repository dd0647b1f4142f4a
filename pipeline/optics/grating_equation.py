"""The grating equation, [D14] eq. 13, both ways: sin theta_i = sin phi + m lambda / a.

theta_i is the light's angle with the normal, phi the view's in the same plane, positive on the mirror's side: the
mirror direction has phi = theta_i and m = 0. With the light at azimuth phi_i,

    wi = ( sin theta_i d, cos theta_i),  wr = (-sin phi d, cos phi),  d = (cos phi_i, sin phi_i),
    (u, v) = -wi - wr = -(m lambda / a) d,

so order m of a grating of period a along d stands at the frequency f = (u, v) / lambda = -(m / a) d, whatever the
wavelength. m > 0 leans back from the mirror direction towards the normal and the light.
"""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Array


def viewing_angle(theta_i: float, period_um: ArrayLike, lambda_um: ArrayLike, order: int = 1) -> Array:
    """phi of an order, radians; NaN where the order does not leave the surface. Periods and wavelengths broadcast."""
    sine = np.sin(theta_i) - order * np.asarray(lambda_um, float) / np.asarray(period_um, float)
    return np.arcsin(np.where(np.abs(sine) <= 1.0, sine, np.nan))


def period_um(theta_i: float, phi: ArrayLike, lambda_um: ArrayLike, order: int = 1) -> Array:
    """a = m lambda / (sin theta_i - sin phi), um; infinite in the mirror direction, order 0 of every period."""
    with np.errstate(divide="ignore"):
        return np.asarray(order * np.asarray(lambda_um, float) / (np.sin(theta_i) - np.sin(phi)))


def in_plane(theta_i: float, azimuth: float, phi: ArrayLike) -> tuple[Array, Array]:
    """(wi, wr), (..., 3) each, of a light at (theta_i, azimuth) and views at phi (...,) in its plane, radians."""
    phi = np.asarray(phi, float)
    x, y = np.cos(azimuth), np.sin(azimuth)
    wr = np.stack([-np.sin(phi) * x, -np.sin(phi) * y, np.cos(phi)], axis=-1)
    wi = np.array([np.sin(theta_i) * x, np.sin(theta_i) * y, np.cos(theta_i)])
    return np.broadcast_to(wi, wr.shape), wr
