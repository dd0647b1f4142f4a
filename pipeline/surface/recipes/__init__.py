"""Synthetic surfaces: height fields from the parameters of a recipe, exactly periodic where the recipe has a period.

`make` chooses the construction. `patch.py` lays out the samples; `gratings.py`, `disc.py`, `random.py` and
`snakes.py` hold closed forms and seeded constructions.
"""

from typing import assert_never

from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import disc, gratings, random, snakes
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


def make(recipe: Recipe) -> HeightField:
    """Makes the height field of a recipe; equal recipes give equal heights.

    All surfaces but the tilted mirror repeat across the seams of the patch without a step.

    recipe: kind and parameters.
    Returns heights (ny, nx), um, y upwards.
    Raises ConfigError where the pitch is too coarse for the structure, or the patch too small.
    """
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
