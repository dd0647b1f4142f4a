"""A compact disc: tracks of pits and lands, 3 to 11 channel bits long."""

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import CompactDisc
from pipeline.surface.recipes.patch import LONGEST_RUN, SHORTEST_RUN, Axis, generator, patch_of


def compact_disc(recipe: CompactDisc) -> HeightField:
    """Makes tracks along x in a plane at height 0, with pits `depth_um` below it; periodic in x and y.

    The patch holds a whole number of bits along x (at least one pit and one land) and of tracks along y. Each sample
    is the mean height over its pixel, which keeps pit edges between samples in place and the area of the pits exact.
    Run lengths are uniform over 3..11 bits and independent between tracks.
    """
    patch = patch_of(recipe)
    rng = generator(recipe.seed)
    pits = np.stack([_track_bits(rng, patch.x.periods) for _ in range(patch.y.periods)])
    along = _coverage_along(pits, patch.x)
    across = _coverage_across(patch.y, recipe.pit_width_um)
    return HeightField(-recipe.depth_um * (across @ along), patch.pitch_um)


def draw_runs(rng: np.random.Generator, bits: int) -> NDArray[np.int64]:
    """Draws an even number of run lengths of 3..11 bits (pit, land, pit, ...) whose sum is `bits` >= 6.

    They are drawn uniformly; then random runs are changed by single bits until the sum fits.
    """
    mean = (SHORTEST_RUN + LONGEST_RUN) // 2
    # for bits >= 6, rounding keeps 3 count <= bits <= 11 count (closest: 2 runs of 6 bits in all, 4 of 21)
    count = 2 * max(1, round(bits / (2 * mean)))
    runs = rng.integers(SHORTEST_RUN, LONGEST_RUN, size=count, endpoint=True)
    while (missing := bits - int(runs.sum())) != 0:
        movable = runs < LONGEST_RUN if missing > 0 else runs > SHORTEST_RUN
        runs[rng.choice(np.flatnonzero(movable))] += 1 if missing > 0 else -1
    return runs


def _track_bits(rng: np.random.Generator, bits: int) -> NDArray[np.bool_]:
    """Draws one periodic track, bool (bits,), True in pits, with a random offset of its first run."""
    runs = draw_runs(rng, bits)
    track = np.repeat(np.arange(runs.size) % 2 == 0, runs)
    return np.roll(track, rng.integers(bits))


def _coverage_along(pits: NDArray[np.bool_], axis: Axis) -> NDArray[np.float64]:
    """Computes the share of pit in each sample's pitch, (tracks, nx), from bits (tracks, bits), True in pits."""
    bits = pits.shape[1]
    edges = np.arange(axis.samples + 1) * (bits / axis.samples)
    # the cumulative length of pits is linear within a bit, so that its differences are exact
    below = np.pad(np.cumsum(pits, axis=1, dtype=np.float64), ((0, 0), (1, 0)))
    lengths = np.stack([np.interp(edges, np.arange(bits + 1), row) for row in below])
    coverage: NDArray[np.float64] = np.diff(lengths, axis=1) * (axis.samples / bits)
    return coverage


def _coverage_across(axis: Axis, width_um: float) -> NDArray[np.float64]:
    """Computes the share of each sample's pitch in the band of pits of each track, (ny, tracks).

    width_um: width of the bands, which are centred on the tracks.
    """
    track_um = axis.size_um / axis.periods
    centres = (np.arange(axis.periods) + 0.5) * track_um
    edges = np.arange(axis.samples + 1)[:, None] * axis.pitch_um
    inside = np.clip(edges - (centres - 0.5 * width_um), 0.0, width_um)
    return np.diff(inside, axis=0) / axis.pitch_um
