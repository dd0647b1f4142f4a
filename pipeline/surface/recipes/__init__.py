"""Synthetic surfaces: from the numbers of a recipe to a height field, exactly periodic where it has a period.

`make` is the only entrance. The patch comes first (`patch.py`), then one closed form or one seeded
construction a file: `gratings.py`, `disc.py`, `random.py`, `snakes.py`.
"""

from typing import assert_never

from pipeline.config import models as config
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import disc, gratings, random, snakes


def make(recipe: config.Recipe) -> HeightField:
    """The height field of one recipe: float64 um, y up, the same for the same recipe.

    Gratings, discs, random and snake surfaces repeat across the patch's seams without a step; a tilted
    mirror cannot. Raises ConfigError where the pitch cannot carry the structure asked for.
    """
    match recipe:
        case config.Mirror() | config.TiltedMirror():
            return gratings.mirror(recipe)
        case config.Sinusoid():
            return gratings.sinusoid(recipe)
        case config.Rectangular():
            return gratings.rectangular(recipe)
        case config.Blazed():
            return gratings.blazed(recipe)
        case config.CompactDisc():
            return disc.compact_disc(recipe)
        case config.GaussianRandom():
            return random.gaussian(recipe)
        case config.Elaphe():
            return snakes.elaphe(recipe)
        case config.Xenopeltis():
            return snakes.xenopeltis(recipe)
        case _:
            assert_never(recipe)
