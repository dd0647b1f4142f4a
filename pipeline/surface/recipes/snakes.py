"""Synthetic snake skins with the periods and the disorder of those in [D14], figs. 1, 3 and 5.

Both are smoothly distorted lattices of fingers. The distortions are periodic noise, so that the field is exactly
periodic. The shapes were matched to AFM scans of 65 um by eye and by power spectrum.
"""

import numpy as np

from pipeline.arrays import Array
from pipeline.fourier import backend as fourier
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Elaphe, Xenopeltis
from pipeline.surface.recipes.patch import Axis, Patch, generator, patch_of
from pipeline.surface.recipes.random import lowpass, smooth_noise

# rms blur by the finite tip of the probe, um, which also limits steps to frequencies below the Nyquist limit
_TIP_UM = 0.04
_ELAPHE_FINGER_UM = 2.95
# rms of the skin's grain, relative to that of its waves
_GRAIN = 0.12


def elaphe(recipe: Elaphe) -> HeightField:
    """Makes columns of tapered fingers, `across_um` apart along x, which overlap like tiles with tips towards +y.

    The patch holds whole periods along x. The phases of the fingers (about 2.95 um long) drift along and across the
    skin, so that there is no fixed period along y. The peak-to-valley height is exactly `height_um`.
    """
    patch = patch_of(recipe)
    rng = generator(recipe.seed)
    across = _lattice(patch.x) + 0.12 * smooth_noise(rng, patch.y, patch.x, (3.0, 14.0))
    fingers = max(1, round(patch.y.size_um / _ELAPHE_FINGER_UM))
    along = _lattice(Axis(patch.y.size_um, patch.y.samples, fingers))[:, None]
    along = along + 0.35 * smooth_noise(rng, patch.y, patch.x, (4.0, 14.0))
    along += 0.15 * smooth_noise(rng, patch.y, patch.x, (1.2, 10.0))
    height = _elaphe_finger(across % 1.0 - 0.5, along)
    height += 0.35 * _unevenness(rng, patch, (0.1, 0.3))
    return _finish(height, patch, recipe.height_um)


def _lattice(axis: Axis) -> Array:
    """Returns the position of each sample from the first one, in periods, (samples,), in [0, periods)."""
    return np.arange(axis.samples, dtype=np.float64) * (axis.periods / axis.samples)


def _elaphe_finger(s: Array, along: Array) -> Array:
    """Computes the height of fingers, about 1 on ridges and 0 on the floor.

    s: distance from the ridge, in columns. along: position along the fingers, an integer at their bases.
    The half width decreases from a flared base to a narrow tip. From tip to base, the floor sinks into slits that end
    at a web, which joins neighbouring bases and is lower between them.
    """
    t = (along + 0.03 * np.cos(2 * np.pi * s)) % 1.0
    half_width = 0.14 + 0.23 * (1.0 - t) + 0.08 * np.exp(-t / 0.08)
    ridge = 1.0 / (1.0 + (s / half_width) ** 4)
    web = np.exp(-((t / 0.1) ** 2))
    floor = 0.1 * web + (1.0 - web) * (0.6 * t - 0.5)
    return floor + (1.0 - 0.15 * t - floor) * ridge


def xenopeltis(recipe: Xenopeltis) -> HeightField:
    """Makes meandering rows of short fingers, `across_um` apart along x and `along_um` apart along y.

    The patch holds whole periods along both axes. Each finger rises towards +y and drops at its tip, so that the
    profile along y is a sawtooth. The peak-to-valley height is exactly `height_um`.
    """
    patch = patch_of(recipe)
    rng = generator(recipe.seed)
    rows, fingers = patch.y.periods, patch.x.periods
    along = _lattice(patch.y)[:, None] + 0.45 * smooth_noise(rng, patch.y, patch.x, (5.0, 12.0))
    row = np.floor(along).astype(np.int64)
    each_row = Axis(float(rows), rows, rows)
    drift = smooth_noise(rng, each_row, patch.x, (2.0, 0.5))
    lean = smooth_noise(rng, patch.y, patch.x, (3.0, 2.0))
    across = _lattice(patch.x) + 0.25 * np.take_along_axis(drift, row % rows, axis=0) + 0.2 * lean
    finger = np.floor(across).astype(np.int64)
    tallness = rng.uniform(0.8, 1.0, (rows, fingers))
    height = _xenopeltis_finger(across - finger - 0.5, along - row)
    height *= tallness[row % rows, finger % fingers]
    height += 0.13 * _unevenness(rng, patch, (0.15, 0.15))
    return _finish(height, patch, recipe.height_um)


def _xenopeltis_finger(s: Array, t: Array) -> Array:
    """Computes the height of one finger: a smooth foot at 0, a rising ridge between slits, and a round tip near 1.

    s: distance from the ridge, in fingers. t: position from the foot of the row (0) to that of the next row (1).
    """
    ridge = 1.0 - np.abs(2 * s) ** 3
    inside = t < 1.0 - 0.25 * (2 * s) ** 2
    slit = np.clip((t - 0.1) / 0.3, 0.0, 1.0)
    return np.where(inside, t * ridge - 0.4 * slit * (1.0 - ridge), 0.0)


def _unevenness(rng: np.random.Generator, patch: Patch, grain_um: tuple[float, float]) -> Array:
    """Makes long waves of rms 1 and grain of the correlation lengths `grain_um` (x, y), (ny, nx)."""
    long_waves = smooth_noise(rng, patch.y, patch.x, (16.0, 16.0))
    waves = smooth_noise(rng, patch.y, patch.x, (6.0, 6.0))
    grain = smooth_noise(rng, patch.y, patch.x, grain_um)
    return 0.8 * long_waves + 0.6 * waves + _GRAIN * grain


def _finish(height: Array, patch: Patch, height_um: float) -> HeightField:
    """Blurs heights by the probe's tip and scales them to the peak-to-valley height `height_um`."""
    tip = [np.sqrt(2) * max(_TIP_UM, 0.4 * pitch) for pitch in patch.pitch_um]
    height = lowpass(fourier.rfft2(height), patch.y, patch.x, (tip[0], tip[1]))
    low = float(height.min())
    span = float(height.max()) - low
    return HeightField((height - low) * (height_um / span), patch.pitch_um)
