"""Secondary horizontal bands of an image: light that rises again outwards from the primary band."""

from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.arrays import Array

# a step of luminance that is barely seen (Weber's fraction): a band of less contrast counts as none
VISIBLE_CONTRAST = 0.02
# of the brightest row: a darker one counts as that dark, for beyond the scan's Nyquist limit all is dark
_DARK_SHARE = 1e-9


@dataclass(frozen=True)
class Bands:
    """Secondary horizontal bands above and below the primary one.

    profile: mean luminance of each row (rows,), from the top. contrast: the largest rise above the darkest row
    further in, over that row. share: of the light outside the primary band, the part that is such a rise.
    """

    profile: Array
    contrast: float
    share: float


def bands_of(profile: Array, axis: Array, primary: float, reach: float = inf) -> Bands:
    """Find the bands of an image's rows.

    profile: mean luminance of each row (rows,). axis: place of each row from the mirror direction, evenly spaced, in
    any unit. primary: half-width of the primary band; reach: where the search ends; both in that unit.
    """
    dark = _DARK_SHARE * float(profile.max())
    contrast, excess, light = 0.0, 0.0, 0.0
    for side in (axis <= 0.0, axis >= 0.0):
        outwards = np.flatnonzero(side)[np.argsort(np.abs(axis[side]))]
        values, distance = profile[outwards], np.abs(axis[outwards])
        outside = (distance > primary) & (distance < reach)
        floor = np.minimum.accumulate(values)[outside]
        rise = values[outside] - floor
        contrast = max(contrast, float(np.max(rise / np.maximum(floor, dark))))
        excess, light = excess + float(rise.sum()), light + float(values[outside].sum())
    return Bands(profile, contrast, excess / light)
