"""Snake skins in the manner of [D14] figs. 1, 3 and 5: their periods and disorder, not their scans.

Both are built from a smoothly distorted lattice of fingers. Distortions are periodic noise, so the field
is exactly periodic; shapes were matched by eye and by power spectrum to AFM scans of 65 um.
"""

import numpy as np

from pipeline.arrays import Array
from pipeline.fourier import backend as fourier
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Elaphe, Xenopeltis
from pipeline.surface.recipes.patch import Axis, Patch, generator, patch_of
from pipeline.surface.recipes.random import lowpass, smooth_noise

# rms blur of the probe's finite tip, um; it also keeps the steps within the samples' band
_TIP_UM = 0.04
_ELAPHE_FINGER_UM = 2.95
# what an AFM sees of the bare skin, beside waves of rms 1
_GRAIN = 0.12


def elaphe(recipe: Elaphe) -> HeightField:
    """Columns of tapered fingers, `across_um` apart along x, tips towards +y, overlapping like tiles.

    Whole periods along x. Columns place their fingers (about 2.95 um long) by phases that drift along and
    across the skin, so that there is no firm period along y. Peak to valley is exactly `height_um`.
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
    """Periods from the first sample on, [0, periods)."""
    return np.arange(axis.samples, dtype=np.float64) * (axis.periods / axis.samples)


def _elaphe_finger(s: Array, along: Array) -> Array:
    """Height of a finger: `s` columns off its ridge, `along` in fingers, whole at bases; ridge 1, floor 0.

    Half width falls from a flared base to a narrow tip. The floor sinks from tip to base into slits that
    end at a web, which joins neighbouring bases and hangs lower between them.
    """
    t = (along + 0.03 * np.cos(2 * np.pi * s)) % 1.0
    half_width = 0.14 + 0.23 * (1.0 - t) + 0.08 * np.exp(-t / 0.08)
    ridge = 1.0 / (1.0 + (s / half_width) ** 4)
    web = np.exp(-((t / 0.1) ** 2))
    floor = 0.1 * web + (1.0 - web) * (0.6 * t - 0.5)
    return floor + (1.0 - 0.15 * t - floor) * ridge


def xenopeltis(recipe: Xenopeltis) -> HeightField:
    """Rows of short fingers, `across_um` apart along x and `along_um` along y; the rows bend as they run.

    Whole periods along both axes. Each finger rises towards +y and drops at its tip, so that the profile
    along y is a sawtooth. Peak to valley is exactly `height_um`.
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
    """Height of one finger: `s` fingers off its ridge, `t` from the row's foot (0) to the next row's (1).

    A smooth foot, then a rising ridge between slits, then a round tip; ridge up to 1, foot 0.
    """
    ridge = 1.0 - np.abs(2 * s) ** 3
    inside = t < 1.0 - 0.25 * (2 * s) ** 2
    slit = np.clip((t - 0.1) / 0.3, 0.0, 1.0)
    return np.where(inside, t * ridge - 0.4 * slit * (1.0 - ridge), 0.0)


def _unevenness(rng: np.random.Generator, patch: Patch, grain_um: tuple[float, float]) -> Array:
    """Waves of the skin, rms 1, and grain of the given correlation length, (ny, nx)."""
    long_waves = smooth_noise(rng, patch.y, patch.x, (16.0, 16.0))
    waves = smooth_noise(rng, patch.y, patch.x, (6.0, 6.0))
    grain = smooth_noise(rng, patch.y, patch.x, grain_um)
    return 0.8 * long_waves + 0.6 * waves + _GRAIN * grain


def _finish(height: Array, patch: Patch, height_um: float) -> HeightField:
    """Blurred by the tip, scaled to the peak-to-valley height asked for, um."""
    tip = [np.sqrt(2) * max(_TIP_UM, 0.4 * pitch) for pitch in patch.pitch_um]
    height = lowpass(fourier.rfft2(height), patch.y, patch.x, (tip[0], tip[1]))
    low = float(height.min())
    span = float(height.max()) - low
    return HeightField((height - low) * (height_um / span), patch.pitch_um)
