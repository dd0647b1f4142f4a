"""Reflectance of a smooth interface for unpolarised light, by the cosine of the incidence angle."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Array
from pipeline.errors import InputError
from pipeline.optics.csv_columns import read_columns, shipped

_GOLD = "gold_johnson_christy_1972.csv"


def schlick(cos_theta: ArrayLike, ior: float) -> Array:
    """Computes F = F0 + (1 - F0)(1 - cos)^5 with F0 = ((n - 1) / (n + 1))^2 (Schlick 1994; [D14] sec. 5).

    cos_theta: cosine of the incidence angle (...,). ior: refractive index n of the medium, real.
    Returns the reflectance (...,).
    """
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    return np.asarray(f0 + (1.0 - f0) * (1.0 - np.asarray(cos_theta)) ** 5)


def reflectance(cos_theta: ArrayLike, index: ArrayLike) -> Array:
    """Computes Fresnel's reflectance for unpolarised light that comes from air, the mean of |r_s|^2 and |r_p|^2.

    cos_theta: cosine of the incidence angle. index: n + ik of the medium, real for a dielectric. Both broadcast.
    Returns the reflectance in their common shape.
    """
    cos_i = np.asarray(cos_theta, dtype=float)
    eta = np.asarray(index, dtype=complex)
    cos_t = np.sqrt(1.0 - (1.0 - cos_i**2) / eta**2)
    r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    return np.asarray(0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2))


def metal_index(metal: str, lambda_nm: Array) -> NDArray[np.complex128]:
    """Interpolates the complex index n + ik of a metal linearly over wavelength.

    metal: "Au", or the path of a CSV of lambda_nm,n,k. lambda_nm: (L,), nm.
    Returns the index (L,).
    Raises InputError for a CSV that does not have three ascending columns, does not cover the wavelengths, or holds
    indices of no metal.
    """
    table = shipped(_GOLD, 3) if metal == "Au" else read_columns(Path(metal).read_bytes(), 3, metal)
    low, high = table[0, 0], table[-1, 0]
    if lambda_nm.min() < low or lambda_nm.max() > high:
        asked = f"{lambda_nm.min():g}..{lambda_nm.max():g}"
        raise InputError(f"{metal}: has indices for {low:g}..{high:g} nm, but {asked} nm are needed")
    if np.any(table[:, 1] <= 0) or np.any(table[:, 2] < 0) or np.any(np.hypot(table[:, 1] - 1, table[:, 2]) < 1e-6):
        raise InputError(f"{metal}: expected n > 0 and k >= 0, and not n = 1 with k = 0, which reflects nothing")
    n, k = (np.interp(lambda_nm, table[:, 0], table[:, column]) for column in (1, 2))
    return np.asarray(n + 1j * k)
