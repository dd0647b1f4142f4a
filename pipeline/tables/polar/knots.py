"""Knots of cubic B-splines along the azimuth, of which rings near the mirror direction have a half or a quarter.

A spline is the same with a knot inserted between any two: c_(2j) = (d_(j-1) + 6 d_j + d_(j+1)) / 8 and
c_(2j+1) = (d_j + d_(j+1)) / 2 (Lane & Riesenfeld 1980). Tables in memory have all knots, files those that are needed.
"""

import numpy as np
from numpy.typing import NDArray


def removed(values: NDArray[np.float32], every: int) -> NDArray[np.float32]:
    """Removes the knots that a spline does not need, by the inverse of their insertion.

    It reads these coefficients alone, so that those of a tile follow from the tile.

    values: coefficients (..., azimuths) on all azimuths of a sector. every: 1, 2 or 4, of which one knot remains.
    Returns the coefficients (..., azimuths / every).
    """
    while every > 1:
        odd = values[..., 1::2]
        found = np.empty_like(odd)
        found[..., 1:] = 2.0 * values[..., 2::2] - 0.5 * (odd[..., :-1] + odd[..., 1:])
        found[..., 0] = 2.0 * odd[..., 0] - found[..., 1]
        values, every = found, every // 2
    return values


def inserted(values: NDArray[np.float32], every: int) -> NDArray[np.float32]:
    """Inserts knots at all azimuths of a turn.

    values: coefficients (..., azimuths / every). Returns those of the same spline (..., azimuths).
    """
    while every > 1:
        after = np.roll(values, -1, axis=-1)
        found = np.empty((*values.shape[:-1], 2 * values.shape[-1]), np.float32)
        found[..., ::2] = 0.125 * (np.roll(values, 1, axis=-1) + after) + 0.75 * values
        found[..., 1::2] = 0.5 * (values + after)
        values, every = found, every // 2
    return values
