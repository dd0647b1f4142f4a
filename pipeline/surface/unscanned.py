"""Recognises rows that were never scanned: one value, a slope or the last line once more, where others are rough."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.surface.no_data import LEAST_COUNT, LEAST_VALUES, ROUNDING, Mask, sample

# a row of one value is not measured where neighbours in other rows differ in more than this share, and where at most
# this share of their samples, or so many times a typical value's share, holds the value
_ROUGH, _RARE, _TYPICAL = 0.2, 0.02, 4.0
# the share where such rows hold different values or lie within the scan, as rows of coarse codes do by chance
_VERY_ROUGH = 0.8
_LEAST_ROWS = 8
# bends of a straight row, in those of typical samples: what is left is rounding
_STRAIGHT = 1e-3
# mean bends of rows of a lifted tip, in those of the roughest row; the least of all other rows
_SMOOTH, _EVENLY = 0.02, 0.3
# a value this close to the end of the others' range, in shares of it, is where they are clipped, and rows of it are
# not measured only in one block at an edge
_CLIPPED = 0.02
# repeats of the last line, and how much more often than any other line is repeated
_LEAST_REPEATS, _MORE_REPEATS, _OTHER_REPEATS = 3, 4, 0.05


def constant_lines(heights: Array, hole: Mask) -> tuple[Mask, list[float]]:
    """Finds rows of one value among rough ones, and the part of the line in which a scan was stopped.

    Returns the samples, bool (ny, nx), and the values.
    """
    new = np.zeros(hole.shape, bool)
    known = ~hole
    low = np.min(heights, axis=1, where=known, initial=np.inf)
    high = np.max(heights, axis=1, where=known, initial=-np.inf)
    constant = (low == high) & (np.count_nonzero(known, axis=1) >= max(2, hole.shape[1] // 2))
    rough = np.flatnonzero(low < high)
    if not constant.any() or rough.size < _LEAST_ROWS:
        return new, []
    least = _ROUGH if np.ptp(low[constant]) == 0 and _is_edge_block(constant) else _VERY_ROUGH
    if not _is_rough(heights[rough], known[rough], least):
        return new, []
    others = np.sort(heights[rough][known[rough]])
    counts = np.unique(sample(others), return_counts=True)[1]
    if counts.size < LEAST_VALUES:
        return new, []
    # continuous values are held once each
    typical = float(np.median(counts)) / counts.sum() if np.median(counts) > 1 else 0.0
    levels = np.unique(low[constant])
    held = np.searchsorted(others, levels, "right") - np.searchsorted(others, levels, "left")
    rare = held <= others.size * max(_RARE, _TYPICAL * typical)
    apart = _CLIPPED * float(others[-1] - others[0])
    clipped = (levels >= others[0] - apart) & (levels <= others[0]) | (levels <= others[-1] + apart) & (
        levels >= others[-1]
    )
    unmeasured = [
        level
        for level in levels[rare]
        if not clipped[np.searchsorted(levels, level)] or _is_edge_block(constant & (low == level))
    ]
    rows = constant & np.isin(low, unmeasured)
    new[rows] = True
    for j in np.flatnonzero(rows):
        for beside in (j - 1, j + 1):
            if 0 <= beside < len(heights) and not rows[beside]:
                new[beside] |= _run_at_an_end(heights[beside] == low[j])
    return new, [float(value) for value in np.unique(low[rows])]


def _is_edge_block(rows: Mask) -> bool:
    """Whether the rows are blocks at one or both edges, of at least four rows each."""
    others = np.flatnonzero(~rows)
    before, after = int(others[0]), rows.size - 1 - int(others[-1])
    whole = others.size == others[-1] - others[0] + 1
    return bool(whole and max(before, after) > 0 and not 0 < before < LEAST_COUNT and not 0 < after < LEAST_COUNT)


def _is_rough(rows: Array, known: Mask, least: float) -> bool:
    """Whether neighbours in most rows differ so often that no row has one value by chance."""
    pairs = known[:, 1:] & known[:, :-1]
    changes = np.count_nonzero((rows[:, 1:] != rows[:, :-1]) & pairs, axis=1)
    share = float(np.median(changes / np.maximum(np.count_nonzero(pairs, axis=1), 1)))
    return share > least and (1 - share) ** (rows.shape[1] - 1) < 1e-4


def _run_at_an_end(held: Mask) -> Mask:
    """Returns the longer of the two runs of true that begin at an end of a row, if it has at least four samples."""
    first, last = (int(np.argmin(side)) if not side.all() else side.size for side in (held, held[::-1]))
    run = np.zeros(held.shape, bool)
    if max(first, last) >= LEAST_COUNT:
        run[:first] = first >= last
        run[held.size - last :] |= last > first
    return run


def straight_lines(heights: Array) -> Mask:
    """Finds blocks of straight, sloping rows at an edge: rows of one value from which a plane was subtracted."""
    new = np.zeros(heights.shape, bool)
    rows = np.flatnonzero(~np.isnan(heights).all(axis=1))
    if rows.size < 2 * _LEAST_ROWS:
        return new
    some = rows[:: rows.size // 64 + 1]
    bend = float(np.nanmedian(_bends(heights[some])))
    if not bend > 0:
        return new
    for inwards in (rows, rows[::-1]):
        if not np.nanmax(_bends(heights[inwards[:LEAST_COUNT]])) <= _STRAIGHT * bend:
            continue
        bends = _bends(heights[inwards])
        straight = np.nanmax(bends, axis=1, initial=0.0) <= _STRAIGHT * bend
        others = np.flatnonzero(~straight)
        count = int(others[0])
        rough = bends[others]
        if others.size >= _LEAST_ROWS and np.count_nonzero(rough <= _STRAIGHT * bend) <= _RARE * rough.size:
            new[inwards[:count]] = True
    return new


def smooth_edge(heights: Array) -> int:
    """Counts the rows of a block at an edge that is far smoother than all other rows, as rows of a lifted tip are."""
    # row by row: the bends of all would take as much memory as the scan
    means = [_mean_bend(row) for row in heights]
    bends = np.array([mean for mean in means if mean is not None])
    if bends.size < 2 * _LEAST_ROWS:
        return 0
    for inwards in (bends, bends[::-1]):
        smooth = inwards <= _SMOOTH * float(inwards.max())
        count = int(np.argmin(smooth)) if not smooth.all() else 0
        rest = inwards[count:]
        if count >= _LEAST_ROWS and rest.size >= _LEAST_ROWS and rest.min() > _EVENLY * rest.max():
            return count
    return 0


def _mean_bend(row: Array) -> float | None:
    bends = _bends(row[None])
    known = ~np.isnan(bends)
    return float(bends[known].mean()) if known.any() else None


def _bends(rows: Array) -> Array:
    """Computes the magnitudes of second differences along rows, NaN beside holes."""
    bends: Array = np.abs(np.diff(rows, 2, axis=1))
    return bends


def repeated_lines(heights: Array, hole: Mask) -> Mask:
    """Finds copies of the last line that was scanned: a run of equal rows at an edge, where no others are equal."""
    new = np.zeros(hole.shape, bool)
    rows = np.flatnonzero(~hole.all(axis=1))
    if rows.size < _LEAST_ROWS + _LEAST_REPEATS:
        return new
    edges = [*_adjacent(rows[: _LEAST_REPEATS + 1]), *_adjacent(rows[-_LEAST_REPEATS - 1 :])]
    if not any(all(_are_equal(heights, pairs)) for pairs in (edges[:_LEAST_REPEATS], edges[_LEAST_REPEATS:])):
        return new
    same = np.array(_are_equal(heights, _adjacent(rows)))
    for turned in (False, True):
        repeats = same[::-1] if turned else same
        edge = int(np.argmin(repeats)) if not repeats.all() else repeats.size
        rest = repeats[edge:]
        real = rows[::-1][edge] if turned else rows[edge]
        longest = max((len(run) for run in "".join("x" if s else " " for s in rest).split()), default=0)
        if (
            edge >= max(_LEAST_REPEATS, _MORE_REPEATS * (longest + 1) - 1)
            and rest.size >= _LEAST_ROWS
            and np.mean(rest) <= _OTHER_REPEATS
            # rows of one value are judged by `constant_lines`
            and np.nanmax(heights[real]) > np.nanmin(heights[real])
        ):
            new[slice(real + 1, None) if turned else slice(None, real)] = True
    return new


def _are_equal(heights: Array, pairs: list[tuple[int, int]]) -> list[bool]:
    """Says of pairs of rows whether they are equal, up to the constant that subtracting a plane leaves."""
    found = []
    for a, b in pairs:
        apart = heights[a] - heights[b]
        known = ~np.isnan(apart)
        same = bool(known.any()) and np.array_equal(np.isnan(heights[a]), np.isnan(heights[b]))
        found.append(same and float(np.ptp(apart[known])) <= ROUNDING * float(np.ptp(heights[a][known])))
    return found


def _adjacent(rows: NDArray[np.intp]) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in pairwise(rows)]
