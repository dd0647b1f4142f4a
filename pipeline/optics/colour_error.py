"""From XYZ to what a screen shows, and how far apart two such colours are seen."""

from dataclasses import dataclass

import numpy as np

from pipeline.optics.geometry import Array

# the exposures of [D14] table 2, in RU (1 RU saturates a mirror seen in its own reflection)
EXPOSURES_RU = (1.0, 1000.0, 7500.0)
DISPLAY_GAMMA = 2.2  # [D14] sec. 7


def displayed_srgb(xyz: Array, exposure_ru: float) -> Array:
    """Linear sRGB in [0, 1], clipped, of XYZ (..., 3) at an exposure."""
    import colour

    rgb = (exposure_ru * xyz) @ colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB.T
    return np.asarray(np.clip(rgb, 0.0, 1.0))


def pixels(xyz: Array, exposure_ru: float) -> np.ndarray:
    """8-bit sRGB pixels (..., 3) of XYZ at an exposure, gamma 2.2."""
    shown = displayed_srgb(xyz, exposure_ru) ** (1.0 / DISPLAY_GAMMA)
    return np.round(255.0 * shown).astype(np.uint8)


def delta_e(xyz: Array, reference: Array, exposure_ru: float) -> Array:
    """CIELAB difference (...,) of 1976 under D65 between two displayed colours."""
    import colour

    space = colour.RGB_COLOURSPACES["sRGB"]

    def lab(values: Array) -> Array:
        shown = displayed_srgb(values, exposure_ru) @ space.matrix_RGB_to_XYZ.T
        return np.asarray(colour.XYZ_to_Lab(shown, space.whitepoint))

    return np.asarray(np.linalg.norm(lab(xyz) - lab(reference), axis=-1))


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
