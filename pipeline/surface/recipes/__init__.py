"""Synthetic surfaces: height fields from the parameters of a recipe, exactly periodic where the recipe has a period.

`make` chooses the construction. `patch.py` lays out the samples; `gratings.py`, `disc.py`, `random.py` and
`snakes.py` hold closed forms and seeded constructions.
"""

from math import log, radians, sqrt, tan
from typing import assert_never

from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import (
    Blazed,
    CompactDisc,
    Elaphe,
    GaussianRandom,
    Mirror,
    Recipe,
    Rectangular,
    Sinusoid,
    TiltedMirror,
    Xenopeltis,
)
from pipeline.surface.recipes.patch import patch_of


def make(recipe: Recipe) -> HeightField:
    """Makes the height field of a recipe; equal recipes give equal heights.

    All surfaces but the tilted mirror repeat across the seams of the patch without a step.

    recipe: kind and parameters.
    Returns heights (ny, nx), um, y upwards.
    Raises ConfigError where the pitch is too coarse for the structure, or the patch too small.
    """
    # transforms take 0.3 s to import, and parameters are read without them
    from pipeline.surface.recipes import disc, gratings, random, snakes

    match recipe:
        case Mirror() | TiltedMirror():
            return gratings.mirror(recipe)
        case Sinusoid():
            return gratings.sinusoid(recipe)
        case Rectangular():
            return gratings.rectangular(recipe)
        case Blazed():
            return gratings.blazed(recipe)
        case CompactDisc():
            return disc.compact_disc(recipe)
        case GaussianRandom():
            return random.gaussian(recipe)
        case Elaphe():
            return snakes.elaphe(recipe)
        case Xenopeltis():
            return snakes.xenopeltis(recipe)
        case _:
            assert_never(recipe)


def extent(recipe: Recipe) -> Extent:
    """Computes the extent of a recipe's height field without making it.

    Returns samples, pitch and height range; that of a random surface is expected of independent samples, which are
    as high as any of as many correlated ones.
    Raises ConfigError as `make` does.
    """
    patch = patch_of(recipe)
    match recipe:
        case Mirror():
            height = 0.0
        case TiltedMirror():
            tilts = zip(patch.size_um, (recipe.tilt_x_deg, recipe.tilt_y_deg), strict=True)
            height = sum(size * abs(tan(radians(tilt))) for size, tilt in tilts)
        case Sinusoid():
            height = 2.0 * recipe.amplitude_um
        case CompactDisc():
            height = recipe.depth_um
        case GaussianRandom():
            samples = patch.shape[0] * patch.shape[1]
            height = 2.0 * sqrt(2.0 * log(max(samples, 2))) * recipe.sigma_h_um
        case Rectangular() | Blazed() | Elaphe() | Xenopeltis():
            height = recipe.height_um
        case _:
            assert_never(recipe)
    return Extent(patch.shape, patch.pitch_um, 0.5 * height)


def making_bytes(recipe: Recipe, samples: int) -> int:
    """Computes the memory in which `make` works, bytes: so many arrays of float64 at its peak.

    Noise takes four: the random numbers, their transform, the filtered spectrum and the heights. Fingers add the
    positions along and across them, their shapes, and the three noises that join them.
    """
    match recipe:
        case Mirror() | Sinusoid() | Rectangular() | Blazed():
            arrays = 1
        case TiltedMirror() | CompactDisc():
            arrays = 2
        case GaussianRandom():
            arrays = 4
        case Elaphe() | Xenopeltis():
            arrays = 13
        case _:
            assert_never(recipe)
    return 8 * arrays * samples
