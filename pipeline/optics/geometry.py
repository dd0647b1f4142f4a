"""Directions of light and view, and the geometric factors of the scalar diffraction BRDF.

Directions are float64 (..., 3) unit vectors pointing away from the surface, z the normal.
"""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Array


def direction(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Unit vectors (..., 3) from polar angle `theta` and azimuth `phi`, radians."""
    theta, phi = np.broadcast_arrays(np.asarray(theta, float), np.asarray(phi, float))
    s = np.sin(theta)
    return np.stack([s * np.cos(phi), s * np.sin(phi), np.cos(theta)], axis=-1)


def uvw(wi: Array, wr: Array) -> Array:
    """(u, v, w) = -wi - wr ([D14] below eq. 2), shape (..., 3)."""
    return -wi - wr


def cos_half(wi: Array, wr: Array) -> Array:
    """Cosine of the angle between either direction and their half vector."""
    return np.asarray(np.sqrt(np.clip(0.5 * (1.0 + np.sum(wi * wr, axis=-1)), 0.0, 1.0)))


def obliquity(wi: Array, wr: Array) -> Array:
    """G = (1 + wi.wr)^2 / (cos ti cos tr), [D14] below eq. 2."""
    dot = np.sum(wi * wr, axis=-1)
    return np.asarray((1.0 + dot) ** 2 / (wi[..., 2] * wr[..., 2]))


def v_cavity(wi: Array, wr: Array) -> Array:
    """Masking and shadowing of symmetric V grooves, Cook & Torrance 1982."""
    # light and view grazing from the same side meet no half vector: the limit is dark
    cosine = np.maximum(cos_half(wi, wr), np.finfo(float).tiny ** 0.25)
    shared = (wi[..., 2] + wr[..., 2]) / cosine**2
    return np.asarray(np.minimum(1.0, shared * np.minimum(wi[..., 2], wr[..., 2])))
