"""From XYZ to what a screen shows, and how far apart two such colours are seen."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import colour_data

# the exposures of [D14] table 2, in RU (1 RU saturates a mirror seen in its own reflection)
EXPOSURES_RU = (1.0, 1000.0, 7500.0)
DISPLAY_GAMMA = 2.2  # [D14] sec. 7


def displayed_srgb(xyz: Array, exposure_ru: float) -> Array:
    """Linear sRGB in [0, 1], clipped, of XYZ (..., 3) at an exposure."""
    return np.asarray(np.clip(_by_matrix(colour_data.srgb().from_xyz, exposure_ru * xyz), 0.0, 1.0))


def _by_matrix(matrix: Array, values: Array) -> Array:
    """The product of a (3, 3) matrix with each of the colours (..., 3)."""
    # a product of matrices would start threads, which take longer to meet than three columns to multiply
    return np.asarray(np.einsum("...i,ji->...j", values, matrix))


def pixels(xyz: Array, exposure_ru: float) -> np.ndarray:
    """8-bit sRGB pixels (..., 3) of XYZ at an exposure, gamma 2.2."""
    shown = displayed_srgb(xyz, exposure_ru) ** (1.0 / DISPLAY_GAMMA)
    return np.round(255.0 * shown).astype(np.uint8)


def delta_e(xyz: Array, reference: Array, exposure_ru: float) -> Array:
    """CIELAB difference (...,) of 1976 under D65 between two displayed colours."""
    shown = (displayed_srgb(values, exposure_ru) for values in (xyz, reference))
    found, true = (cielab(_by_matrix(colour_data.srgb().to_xyz, values)) for values in shown)
    return np.asarray(np.linalg.norm(found - true, axis=-1))


def cielab(xyz: Array) -> Array:
    """L*, a*, b* (..., 3) under D65 of XYZ (..., 3), white at Y = 1 (CIE 15:2004, 8.2.1)."""
    t = xyz / colour_data.srgb().white
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
    """Errors at each exposure of [D14] table 2 and at the one asked for; `xyz` and `reference` are (..., 3)."""
    errors = []
    for exposure in sorted({*EXPOSURES_RU, asked_ru}):
        difference = delta_e(xyz, reference, exposure)
        worst, tail = float(difference.max()), float(np.percentile(difference, 99.0))
        errors.append(ColourError(exposure, float(difference.mean()), tail, worst))
    return errors
