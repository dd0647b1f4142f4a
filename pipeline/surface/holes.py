"""Finds the samples of a scan that were not measured, and crops the rows and columns that hold nothing else.

Formats mark voids as NaN or by a mask. Others leave a number there: one of convention, the last line once more, or
zeros in lines that were never scanned. Such numbers are recognised by what no measured height does: many samples hold
the same value, far from all others, or whole rows hold one value where all other rows are rough.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.surface.scan import Scan

Mask = NDArray[np.bool_]
MaskUse = Literal["holes", "ignore", "keep"]
Box = tuple[slice, slice]

# share of samples without a measured height from which a warning tells of holes
TOLD_SHARE = 0.02
# numbers that programs write for no data; heights of this size, whatever their unit, are beyond all instruments
_CONVENTIONAL = (999, 9999, 99999, 999999, 32767, 32768, 2147483647, 2147483648)
_BEYOND_OUTLIERS, _BEYOND_HEIGHTS = 1e9, 1e30
# distance of a no-data number from all heights, in ranges of these
_APART_KNOWN, _APART = 1.0, 3.0
# other numbers are taken for no data if at least so many samples and this share hold one, and at most that share;
# and if the rest takes at least so many values, which the levels of a step grating do not
_LEAST_COUNT, _LEAST_SHARE, _LARGEST_SHARE, _LEAST_VALUES = 4, 5e-5, 0.5, 32
# samples from which ranges and numbers of values are estimated
_ESTIMATED_FROM = 100_000
# a value among the heights is taken for no data if it alone is held by more than this share of the samples, and by so
# many times those of each of its nearest values; values closer than this share of the range differ by rounding only
_PLATEAU_SHARE, _PLATEAU, _NEAREST, _ROUNDING = 0.01, 10, 5, 1e-6
# a row of one value is not measured where neighbours in other rows differ in more than this share, and where at most
# this share of their samples, or so many times a typical value's share, holds the value
_ROUGH, _RARE, _TYPICAL = 0.2, 0.02, 4.0
# the share where such rows hold different values or lie within the scan, as rows of coarse codes do by chance
_VERY_ROUGH = 0.8
_LEAST_ROWS = 8
# bends of a straight row, in those of typical samples: what is left is rounding
_STRAIGHT = 1e-3
# a value this close to the end of the others' range, in shares of it, is where they are clipped, and rows of it are
# not measured only in one block at an edge
_CLIPPED = 0.02
# repeats of the last line, and how much more often than any other line is repeated
_LEAST_REPEATS, _MORE_REPEATS, _OTHER_REPEATS = 3, 4, 0.05
# distance from all others, in ranges, of an extreme value that is told
_DOUBTFUL = 0.1
# populations of heights: least share of the smaller, distance in um and in ranges of the wider
_POPULATION, _CLIFF_UM, _CLIFF = 0.005, 2.0, 5.0


@dataclass(frozen=True)
class Unmeasured:
    """Samples without a measured height, found in one way.

    found: "NaN", "mask", "no-data number", "one value among heights", "rows of one value", "straight rows" or
        "repeated rows" (or columns). stated: whether the
    file or the config states it. samples: their number. share: of all samples of the file. value: the number that
    they hold, in the file's unit; None for several, and for NaN.
    """

    found: str
    stated: bool
    samples: int
    share: float
    value: float | None = None

    def __str__(self) -> str:
        """Describes it in a few words."""
        value = "" if self.value is None else f" ({self.value:.6g})"
        return f"{self.found}{value}: {self.samples} samples, {100 * self.share:.2g} %"


@dataclass(frozen=True)
class Measured:
    """The measured part of a scan.

    heights: as stored, float64 (ny, nx), with NaN in holes; without the rows and columns at the edges that were not
    measured. unmeasured: what was found. share: of all samples of the file, those without a measured height.
    cropped: rows or columns removed at the (bottom, top, left, right). holes: samples of `heights` without a height.
    masked_share: of all samples, those that the file's mask covers. warnings: sentences for the user.
    """

    heights: Array
    unmeasured: tuple[Unmeasured, ...]
    share: float
    cropped: tuple[int, int, int, int]
    holes: int
    masked_share: float
    warnings: tuple[str, ...]


def measured_part(scan: Scan, mask: MaskUse | None = None, no_data: tuple[float, ...] | None = None) -> Measured:
    """Finds holes, and crops rows and columns at the edges that hold nothing else.

    scan: one channel. mask: whether samples under the file's mask are holes ("holes"), all others are ("keep"), or
    the mask counts for nothing ("ignore"; None: likewise, with a warning). no_data: the stored numbers that mean no
    data; None finds them, and rows that were not scanned, by their values.
    Returns the part that was measured; all of a scan in which nothing was.
    """
    heights = scan.heights.copy()
    hole = np.isnan(heights)
    found: list[Unmeasured] = []
    doubts: list[str] = []

    def add(kind: str, stated: bool, new: Mask, value: float | None = None) -> None:
        new &= ~hole
        samples = int(np.count_nonzero(new))
        if samples:
            found.append(Unmeasured(kind, stated, samples, samples / hole.size, value))
            hole[new] = True
            heights[new] = np.nan

    samples = int(np.count_nonzero(hole))
    if samples:
        found.append(Unmeasured("NaN", True, samples, samples / hole.size))
    if scan.mask is not None and mask in ("holes", "keep"):
        add("mask", True, scan.mask if mask == "holes" else ~scan.mask)
    if no_data is not None:
        for value in no_data:
            add("no-data number", True, np.isclose(heights, value, rtol=1e-6, atol=0.0), value)
    else:
        for value in _numbers(heights, hole, scan.full_code is not None):
            add("no-data number", False, heights == value, value)
        for axis, lines in ((0, "rows"), (1, "columns")):
            new, values = _constant_lines(np.moveaxis(heights, axis, 0), np.moveaxis(hole, axis, 0))
            level = values[0] if len(values) == 1 else None
            add(f"{lines} of one value", False, np.moveaxis(new, 0, axis), level)
            new = _straight_lines(np.moveaxis(heights, axis, 0))
            add(f"straight {lines}", False, np.moveaxis(new, 0, axis))
            new = _repeated_lines(np.moveaxis(heights, axis, 0), np.moveaxis(hole, axis, 0))
            add(f"repeated {lines}", False, np.moveaxis(new, 0, axis))
        plateau = _plateau(heights[~hole])
        if plateau is not None:
            value, tolerance = plateau
            add("one value among heights", False, np.abs(heights - value) <= tolerance, value)
        doubts = _doubtful_extremes(heights[~hole])
    box, cropped = _box(hole)
    masked_share = 0.0 if scan.mask is None else float(np.mean(scan.mask))
    kept = np.ascontiguousarray(heights[box])
    holes = int(np.count_nonzero(hole[box]))
    share = float(np.mean(hole))
    warnings = (
        *_mask_warnings(masked_share, mask),
        *_hole_warnings(tuple(found), share, cropped, holes / kept.size),
        *doubts,
    )
    return Measured(kept, tuple(found), share, cropped, holes, masked_share, warnings)


def far_apart(heights_um: Array) -> str | None:
    """Describes two far-apart populations of heights; None where there are none.

    Their distance is more than 2 um, deeper than any relief that the scalar model of visible light describes, and
    more than five times the range of either.
    """
    values = np.sort(_sample(heights_um[np.isfinite(heights_um)]))
    least = max(2, int(_POPULATION * values.size))
    if values.size < 4 * least:
        return None
    steps = np.diff(values)[least - 1 : 1 - least]
    split = least + int(np.argmax(steps))
    low, high = values[:split], values[split:]
    gap = float(high[0] - low[-1])
    if gap < max(_CLIFF_UM, _CLIFF * max(_range(low), _range(high))):
        return None
    share = 100 * min(low.size, high.size) / values.size
    return (
        f"heights lie in two groups {gap:.3g} um apart, the smaller with {share:.2g} % of the samples: if one stands "
        "for samples that were not measured, name its numbers in surface.no_data"
    )


# --- numbers -----------------------------------------------------------------------------------------


def _numbers(heights: Array, hole: Mask, is_image: bool) -> list[float]:
    """Lists the no-data numbers: extreme values, far from all others, of convention or shared by many samples."""
    found: list[float] = []
    with np.errstate(invalid="ignore"):
        known = heights[~hole & (np.abs(heights) < _BEYOND_HEIGHTS)]
        wild = heights[~hole & (np.abs(heights) >= _BEYOND_HEIGHTS) & np.isfinite(heights)]
    found += [float(value) for value in np.unique(wild)[:8]]
    while known.size > _LEAST_VALUES and len(found) < 16:
        low, high = float(known.min()), float(known.max())
        between = known[(known > low) & (known < high)]
        candidates = [value for value in (low, high) if _is_no_data(known, value, between, is_image)]
        if not candidates:
            break
        # the farther one first: the other may be a height
        middle = float(np.median(_sample(between)))
        value = max(candidates, key=lambda candidate: abs(candidate - middle))
        found.append(value)
        known = known[known != value]
    return found


def _is_no_data(known: Array, value: float, between: Array, is_image: bool) -> bool:
    """Whether the lowest or highest value is a number for no data. between: those between the lowest and highest."""
    if not between.size:
        return False
    gap = float(np.min(np.abs(between - value)))
    spread = _range(between)
    size = abs(value)
    if not is_image and (size >= _BEYOND_OUTLIERS or size in _CONVENTIONAL):
        return spread > 0 and gap >= _APART_KNOWN * spread
    count = int(np.count_nonzero(known == value))
    if not max(_LEAST_COUNT, _LEAST_SHARE * known.size) <= count <= _LARGEST_SHARE * known.size:
        return False
    # differences by rounding make no different values
    steps = np.unique(np.round((_sample(between) - value) / gap, 6))
    return spread > 0 and gap >= _APART * spread and steps.size >= _LEAST_VALUES


def _doubtful_extremes(known: Array) -> list[str]:
    """Tells of a lowest or highest value that many samples hold, too close to the others to be taken for no data.

    Clipped heights end at the others, and the levels of a grating have few values between them.
    """
    few = np.sort(_sample(known))
    levels, counts = np.unique(few, return_counts=True)
    if levels.size < _LEAST_VALUES:
        return []
    doubts = []
    for end, beside in ((0, 1), (-1, -2)):
        gap = abs(float(levels[beside] - levels[end]))
        inner = np.diff(levels[1:-1])
        held = counts[end] / few.size
        if _PLATEAU_SHARE < held <= _LARGEST_SHARE and gap > max(_DOUBTFUL * _range(few), inner.max()):
            value = f"{levels[end]:.6g}"
            doubts.append(
                f"{100 * held:.2g} % of the samples hold one value, {value}, apart from all others: if they were not "
                f"measured, set surface.no_data = [{value}]"
            )
    return doubts


def _plateau(known: Array) -> tuple[float, float] | None:
    """Finds a value among the heights that far more samples hold than its nearest values, as voids set to 0 do.

    Two such values are levels of a grating, and one at either end of the heights is where they were clipped.
    Returns the value and the distance within which samples hold it.
    """
    few = _sample(known)
    if few.size < 100 or np.ptp(few) == 0:
        return None
    tolerance = _ROUNDING * float(np.ptp(few))
    levels, first, counts = np.unique(np.round((few - few.min()) / tolerance), return_index=True, return_counts=True)
    spikes = [
        i
        for i in np.flatnonzero(counts > _PLATEAU_SHARE * few.size)
        if counts[i]
        > _PLATEAU * max((*counts[max(i - _NEAREST, 0) : i], *counts[i + 1 : i + 1 + _NEAREST]), default=0)
    ]
    if len(spikes) != 1:
        return None
    i = spikes[0]
    fewest = _PLATEAU_SHARE * few.size
    ends = i < _NEAREST or i >= levels.size - _NEAREST or counts[:i].sum() < fewest or counts[i + 1 :].sum() < fewest
    return None if ends or counts[i] > _LARGEST_SHARE * few.size else (float(few[first[i]]), tolerance)


def _sample(values: Array) -> Array:
    """Takes every n-th of many values."""
    # an odd step meets all columns of the usual widths
    return values[:: values.size // _ESTIMATED_FROM | 1]


def _range(values: Array) -> float:
    """Estimates the range of 99 % of the values, which dust does not widen."""
    low, high = np.percentile(_sample(values), (0.5, 99.5))
    return float(high - low)


# --- lines -------------------------------------------------------------------------------------------


def _constant_lines(heights: Array, hole: Mask) -> tuple[Mask, list[float]]:
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
    counts = np.unique(_sample(others), return_counts=True)[1]
    if counts.size < _LEAST_VALUES:
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
    return bool(whole and max(before, after) > 0 and not 0 < before < _LEAST_COUNT and not 0 < after < _LEAST_COUNT)


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
    if max(first, last) >= _LEAST_COUNT:
        run[:first] = first >= last
        run[held.size - last :] |= last > first
    return run


def _straight_lines(heights: Array) -> Mask:
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
        if not np.nanmax(_bends(heights[inwards[:_LEAST_COUNT]])) <= _STRAIGHT * bend:
            continue
        bends = _bends(heights[inwards])
        straight = np.nanmax(bends, axis=1, initial=0.0) <= _STRAIGHT * bend
        others = np.flatnonzero(~straight)
        count = int(others[0])
        rough = bends[others]
        if others.size >= _LEAST_ROWS and np.count_nonzero(rough <= _STRAIGHT * bend) <= _RARE * rough.size:
            new[inwards[:count]] = True
    return new


def _bends(rows: Array) -> Array:
    """Computes the magnitudes of second differences along rows, NaN beside holes."""
    bends: Array = np.abs(np.diff(rows, 2, axis=1))
    return bends


def _repeated_lines(heights: Array, hole: Mask) -> Mask:
    """Finds copies of the last line that was scanned: a run of equal rows at an edge, where no others are equal."""
    new = np.zeros(hole.shape, bool)
    rows = np.flatnonzero(~hole.all(axis=1))
    if rows.size < _LEAST_ROWS + _LEAST_REPEATS:
        return new
    # rows of one value are judged by `_constant_lines`
    varies = np.nanmax(heights[rows], axis=1) > np.nanmin(heights[rows], axis=1)
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
            and varies[np.searchsorted(rows, real)]
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
        found.append(same and float(np.ptp(apart[known])) <= _ROUNDING * float(np.ptp(heights[a][known])))
    return found


def _adjacent(rows: NDArray[np.intp]) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in pairwise(rows)]


# --- edges and words ---------------------------------------------------------------------------------


def _box(hole: Mask) -> tuple[Box, tuple[int, int, int, int]]:
    """Returns the smallest box that holds all measured samples, and what it lacks at the four edges."""
    rows, columns = (np.flatnonzero(~hole.all(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return (slice(None), slice(None)), (0, 0, 0, 0)
    bottom, top, left, right = (int(n) for n in (rows[0], rows[-1], columns[0], columns[-1]))
    ny, nx = hole.shape
    return (slice(bottom, top + 1), slice(left, right + 1)), (bottom, ny - 1 - top, left, nx - 1 - right)


def _mask_warnings(share: float, use: MaskUse | None) -> list[str]:
    if use is not None or share == 0:
        return []
    remedy = "set surface.mask = 'holes' where it marks bad data, 'keep' where it marks what to keep, or 'ignore'"
    return [f"the file has a mask, which covers {100 * share:.2g} % of the samples and is ignored: {remedy}"]


def _hole_warnings(
    found: tuple[Unmeasured, ...], share: float, cropped: tuple[int, int, int, int], filled: float
) -> list[str]:
    guessed = [entry for entry in found if not entry.stated]
    if share < TOLD_SHARE and not guessed:
        return []
    done = [
        f"{n} {lines} {edge} cropped"
        for n, lines, edge in zip(
            cropped,
            ("rows", "rows", "columns", "columns"),
            ("at the bottom", "at the top", "at the left", "at the right"),
            strict=True,
        )
        if n
    ]
    if filled:
        done.append(
            f"{100 * filled:.2g} % of the rest filled smoothly, which scatters less light than the surface did"
        )
    what = "; ".join(str(entry) for entry in found)
    keep = "; if they are heights, set surface.no_data = []" if guessed else ""
    return [f"{100 * share:.2g} % of the scan was not measured ({what}): {', '.join(done)}{keep}"]
