"""Directions of light and view, and the geometric factors of the scalar diffraction BRDF.

Directions are unit vectors, float64 (..., 3), that point away from the surface; z is the surface normal.
"""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Array

RHO_MAX = 2.0  # |(u, v)| of grazing light and a view in the same direction


def direction(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Converts polar angles `theta` and azimuths `phi`, radians, which broadcast, to unit vectors (..., 3)."""
    theta, phi = np.broadcast_arrays(np.asarray(theta, float), np.asarray(phi, float))
    s = np.sin(theta)
    return np.stack([s * np.cos(phi), s * np.sin(phi), np.cos(theta)], axis=-1)


def uvw(wi: Array, wr: Array) -> Array:
    """Computes (u, v, w) = -wi - wr, (..., 3) ([D14], below eq. 2)."""
    return -wi - wr


def above_horizon(wi: Array, wr: Array) -> np.ndarray:
    """Marks the pairs (...,) whose light and view are both above the surface; all others reflect nothing."""
    return np.asarray(np.minimum(wi[..., 2], wr[..., 2]) > 0.0)


def one_plus_dot(wi: Array, wr: Array) -> Array:
    """Computes 1 + wi.wr (...,) as |wi + wr|^2 / 2, which keeps its digits where both directions graze."""
    return np.asarray(0.5 * np.sum((wi + wr) ** 2, axis=-1))


def cos_half(wi: Array, wr: Array) -> Array:
    """Computes the cosine (...,) of the angle between either direction and their half vector."""
    return np.asarray(np.sqrt(np.minimum(0.5 * one_plus_dot(wi, wr), 1.0)))


def obliquity(wi: Array, wr: Array) -> Array:
    """Computes G = (1 + wi.wr)^2 / (cos ti cos tr), (...,) ([D14], below eq. 2)."""
    return np.asarray(one_plus_dot(wi, wr) ** 2 / (wi[..., 2] * wr[..., 2]))


def v_cavity(wi: Array, wr: Array) -> Array:
    """Computes the masking and shadowing (...,) of symmetric V grooves (Cook & Torrance 1982)."""
    # light and view that graze from opposite sides leave no half vector; there, the term's limit is 0
    cosine = np.maximum(cos_half(wi, wr), np.finfo(float).tiny ** 0.25)
    shared = (wi[..., 2] + wr[..., 2]) / cosine**2
    return np.asarray(np.minimum(1.0, shared * np.minimum(wi[..., 2], wr[..., 2])))
