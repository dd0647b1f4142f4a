"""Reflectance of a smooth interface for unpolarised light, by the cosine of the incidence angle."""

from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Array
from pipeline.errors import InputError


def schlick(cos_theta: ArrayLike, ior: float) -> Array:
    """F = F0 + (1 - F0)(1 - cos)^5, F0 = ((n - 1) / (n + 1))^2 (Schlick 1994; [D14] sec. 5)."""
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    return np.asarray(f0 + (1.0 - f0) * (1.0 - np.asarray(cos_theta)) ** 5)


def reflectance(cos_theta: ArrayLike, index: ArrayLike) -> Array:
    """Mean of |r_s|^2 and |r_p|^2 from air onto a medium of complex index n + ik (Fresnel).

    `cos_theta` and `index` broadcast; real indices are dielectrics.
    """
    cos_i = np.asarray(cos_theta, dtype=float)
    eta = np.asarray(index, dtype=complex)
    cos_t = np.sqrt(1.0 - (1.0 - cos_i**2) / eta**2)
    r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    return np.asarray(0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2))


def metal_index(metal: str, lambda_nm: Array) -> NDArray[np.complex128]:
    """n + ik at wavelengths, linear between the samples of "Au" or of a CSV of lambda_nm,n,k.

    Raises InputError for a CSV that is not three ascending columns covering the wavelengths, or no metal's.
    """
    source = files("pipeline.optics").joinpath("gold_johnson_christy_1972.csv") if metal == "Au" else Path(metal)
    table = read_columns(source.read_bytes(), 3, metal)
    low, high = table[0, 0], table[-1, 0]
    if lambda_nm.min() < low or lambda_nm.max() > high:
        asked = f"{lambda_nm.min():g}..{lambda_nm.max():g}"
        raise InputError(f"{metal}: has indices for {low:g}..{high:g} nm, but {asked} nm are needed")
    if np.any(table[:, 1] <= 0) or np.any(table[:, 2] < 0) or np.any(np.hypot(table[:, 1] - 1, table[:, 2]) < 1e-6):
        raise InputError(f"{metal}: expected n > 0 and k >= 0, and not n = 1 with k = 0, which reflects nothing")
    n, k = (np.interp(lambda_nm, table[:, 0], table[:, column]) for column in (1, 2))
    return np.asarray(n + 1j * k)


def read_columns(data: bytes, columns: int, name: str) -> Array:
    """A CSV of numbers whose first column ascends; '#' starts a comment, one header line may lead.

    Raises InputError naming the line that does not fit.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{name}: expected a CSV of {columns} columns in UTF-8, got other bytes") from None
    rows: list[list[float]] = []
    header = False
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.split("#")[0].strip()
        if not content:
            continue
        try:
            row = [float(cell) for cell in content.replace(";", ",").split(",")]
        except ValueError:
            if rows or header:
                raise InputError(f"{name}: line {number}: expected {columns} numbers, got {content!r}") from None
            header = True
            continue
        if len(row) != columns or not np.all(np.isfinite(row)):
            raise InputError(f"{name}: line {number}: expected {columns} finite numbers, got {content!r}")
        rows.append(row)
    table = np.array(rows)
    if len(rows) < 2 or np.any(np.diff(table[:, 0]) <= 0):
        raise InputError(f"{name}: expected at least two rows with ascending wavelengths in the first column")
    return table
