"""Displayed colours of XYZ, and the CIELAB difference between two of them (docs/conventions.md, "Colour error")."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array

# the exposures of [D14] table 2, in RU (1 RU saturates a mirror seen in its own reflection)
EXPOSURES_RU = (1.0, 1000.0, 7500.0)

# linear sRGB, rounded as IEC 61966-2-1 prints it, and XYZ of its white, D65
SRGB_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
_WHITE_X, _WHITE_Y = 0.3127, 0.3290
WHITE_XYZ = np.array([_WHITE_X / _WHITE_Y, 1.0, (1.0 - _WHITE_X - _WHITE_Y) / _WHITE_Y])


def displayed_srgb(xyz: Array, exposure_ru: float) -> Array:
    """Converts XYZ at an exposure to what a display can show.

    xyz: (..., 3), linear, in RU. exposure_ru: factor on it, RU.
    Returns linear sRGB (..., 3), clipped to [0, 1].
    """
    return np.asarray(np.clip(_by_matrix(SRGB_FROM_XYZ, exposure_ru * xyz), 0.0, 1.0))


def clipped(xyz: Array, exposure_ru: float) -> np.ndarray:
    """Marks the colours (...,) that a display cannot show: outside the gamut of sRGB, or brighter than its white.

    xyz: (..., 3), linear, in RU. exposure_ru: factor on it, RU.
    """
    linear = _by_matrix(SRGB_FROM_XYZ, exposure_ru * xyz)
    # the matrix is rounded, which leaves white some 1e-4 beside 1
    return np.asarray(np.any((linear < -1e-3) | (linear > 1.0 + 1e-3), axis=-1))


def _by_matrix(matrix: Array, values: Array) -> Array:
    """Multiplies a matrix (3, 3) with every colour of (..., 3)."""
    # BLAS would start threads here, which takes longer than to multiply three columns; einsum takes twice as long
    first, second, third = np.moveaxis(values, -1, 0)
    return np.stack([a * first + b * second + c * third for a, b, c in matrix], axis=-1)


def pixels(xyz: Array, exposure_ru: float) -> np.ndarray:
    """Converts XYZ at an exposure to 8-bit sRGB, by the curve of IEC 61966-2-1.

    xyz: (..., 3), linear, in RU. exposure_ru: factor on it, RU.
    Returns uint8 (..., 3).
    """
    linear = displayed_srgb(xyz, exposure_ru)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * shown).astype(np.uint8)


def delta_e(xyz: Array, reference: Array, exposure_ru: float) -> Array:
    """Computes the CIELAB difference of 1976 between two colours as a display shows them.

    xyz, reference: (..., 3), linear, in RU. exposure_ru: factor on both, RU.
    Returns dE*ab (...,) under D65, without chromatic adaptation.
    """
    shown = (displayed_srgb(values, exposure_ru) for values in (xyz, reference))
    found, true = (cielab(_by_matrix(SRGB_TO_XYZ, values)) for values in shown)
    lightness, a, b = np.moveaxis(found - true, -1, 0)
    return np.asarray(np.sqrt(lightness**2 + a**2 + b**2))


def cielab(xyz: Array) -> Array:
    """Converts XYZ (..., 3), with white at Y = 1, to L*, a*, b* (..., 3) under D65 (CIE 15:2004, 8.2.1)."""
    t = xyz / WHITE_XYZ
    f = np.where(t > (6.0 / 29.0) ** 3, np.cbrt(t), t * (29.0 / 6.0) ** 2 / 3.0 + 4.0 / 29.0)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


@dataclass(frozen=True)
class ColourError:
    """Statistics of the CIELAB difference over a set of directions at one exposure."""

    exposure_ru: float
    mean: float
    percentile_99: float
    maximum: float


def colour_errors(xyz: Array, reference: Array, asked_ru: float) -> list[ColourError]:
    """Measures the CIELAB difference at each exposure of [D14] table 2 and at `asked_ru`.

    xyz, reference: (..., 3), linear, in RU. asked_ru: one more exposure, RU.
    Returns one entry per exposure, ascending.
    """
    return [colour_error(xyz, reference, exposure) for exposure in exposures(asked_ru)]


def exposures(asked_ru: float) -> list[float]:
    """Lists the exposures of [D14] table 2 and `asked_ru`, RU, ascending."""
    return sorted({*EXPOSURES_RU, asked_ru})


def colour_error(xyz: Array, reference: Array, exposure_ru: float) -> ColourError:
    """Measures the CIELAB difference over all directions at one exposure; the parameters are those of `delta_e`."""
    return statistics(delta_e(xyz, reference, exposure_ru), exposure_ru)


def statistics(difference: Array, exposure_ru: float) -> ColourError:
    """Computes the statistics of CIELAB differences (...,), which are those at an exposure, RU."""
    tail = float(np.percentile(difference, 99.0))
    return ColourError(exposure_ru, float(difference.mean()), tail, float(difference.max()))
