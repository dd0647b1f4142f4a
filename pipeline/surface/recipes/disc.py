"""A compact disc: tracks of pits and lands whose lengths are 3 to 11 channel bits."""

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import CompactDisc
from pipeline.surface.recipes.patch import LONGEST_RUN, SHORTEST_RUN, Axis, generator, patch_of


def compact_disc(recipe: CompactDisc) -> HeightField:
    """Tracks along x in a plane at height 0, pits `depth_um` below it; periodic in x and y.

    The patch holds whole bits along x (at least one pit and one land) and whole tracks along y. A sample
    holds the mean height of its own pixel, so pit edges between samples keep their place and the pits' area
    is exact. Runs are uniform over 3..11 bits, independent from track to track.
    """
    patch = patch_of(recipe)
    rng = generator(recipe.seed)
    pits = np.stack([_track_bits(rng, patch.x.periods) for _ in range(patch.y.periods)])
    along = _coverage_along(pits, patch.x)
    across = _coverage_across(patch.y, recipe.pit_width_um)
    return HeightField(-recipe.depth_um * (across @ along), patch.pitch_um)


def draw_runs(rng: np.random.Generator, bits: int) -> NDArray[np.int64]:
    """An even number of run lengths of 3..11 bits that sum to `bits` >= 6: pit, land, pit, ...

    Drawn uniformly, then random runs are lengthened or shortened by single bits until the row closes.
    """
    mean = (SHORTEST_RUN + LONGEST_RUN) // 2
    # for 6 bits and more, rounding keeps 3 count <= bits <= 11 count (tightest: 2 runs of 6, 4 of 21)
    count = 2 * max(1, round(bits / (2 * mean)))
    runs = rng.integers(SHORTEST_RUN, LONGEST_RUN, size=count, endpoint=True)
    while (missing := bits - int(runs.sum())) != 0:
        movable = runs < LONGEST_RUN if missing > 0 else runs > SHORTEST_RUN
        runs[rng.choice(np.flatnonzero(movable))] += 1 if missing > 0 else -1
    return runs


def _track_bits(rng: np.random.Generator, bits: int) -> NDArray[np.bool_]:
    """One closed track, bool (bits,): True in pits, begun anywhere within its runs."""
    runs = draw_runs(rng, bits)
    track = np.repeat(np.arange(runs.size) % 2 == 0, runs)
    return np.roll(track, rng.integers(bits))


def _coverage_along(pits: NDArray[np.bool_], axis: Axis) -> NDArray[np.float64]:
    """Share of each sample's pitch that is pit, (tracks, nx), from bool bits (tracks, bits)."""
    bits = pits.shape[1]
    edges = np.arange(axis.samples + 1) * (bits / axis.samples)
    # pit length below a position is linear within a bit: its differences are exact coverages
    below = np.pad(np.cumsum(pits, axis=1, dtype=np.float64), ((0, 0), (1, 0)))
    lengths = np.stack([np.interp(edges, np.arange(bits + 1), row) for row in below])
    coverage: NDArray[np.float64] = np.diff(lengths, axis=1) * (axis.samples / bits)
    return coverage


def _coverage_across(axis: Axis, width_um: float) -> NDArray[np.float64]:
    """Share of each sample's pitch inside each track's pit band, (ny, tracks); bands lie mid-track."""
    track_um = axis.size_um / axis.periods
    centres = (np.arange(axis.periods) + 0.5) * track_um
    edges = np.arange(axis.samples + 1)[:, None] * axis.pitch_um
    inside = np.clip(edges - (centres - 0.5 * width_um), 0.0, width_um)
    return np.diff(inside, axis=0) / axis.pitch_um
