"""Synthetic surfaces: from the numbers of a recipe to a height field, exactly periodic where it has a period.

`make` is the only entrance. The patch comes first (`patch.py`), then one closed form or one seeded
construction a file: `gratings.py`, `disc.py`, `random.py`, `snakes.py`.
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
    """The height field of one recipe: float64 um, y up, the same for the same recipe.

    Gratings, discs, random and snake surfaces repeat across the patch's seams without a step; a tilted
    mirror cannot. Raises ConfigError where the pitch cannot carry the structure asked for.
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
