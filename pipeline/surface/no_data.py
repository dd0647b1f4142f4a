"""Recognises numbers that stand for no data by their values: far from all heights, and held by many samples."""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array

Mask = NDArray[np.bool_]

# numbers that programs write for no data; heights of this size, whatever their unit, are beyond all instruments
_CONVENTIONAL = (999, 9999, 99999, 999999, 32767, 32768, 2147483647, 2147483648)
_BEYOND_OUTLIERS, _BEYOND_HEIGHTS = 1e9, 1e30
# distance of a no-data number from all heights, in ranges of these
_APART_KNOWN, _APART = 1.0, 3.0
# other numbers are taken for no data if at least so many samples and this share hold one, and at most that share;
# and if the rest takes at least so many values, which the levels of a step grating do not
LEAST_COUNT, _LEAST_SHARE, _LARGEST_SHARE, LEAST_VALUES = 4, 5e-5, 0.5, 32
# samples from which ranges and numbers of values are estimated
_ESTIMATED_FROM = 100_000
# a value among the heights is taken for no data if it alone is held by more than this share of the samples, and by so
# many times those of each of its nearest values; values closer than this share of the range differ by rounding only
_PLATEAU_SHARE, _PLATEAU, _NEAREST, ROUNDING = 0.01, 10, 5, 1e-6
# distance from all others, in ranges, of an extreme value that is told
_DOUBTFUL = 0.1


def numbers(heights: Array, hole: Mask, is_image: bool) -> list[float]:
    """Lists the no-data numbers: extreme values, far from all others, of convention or shared by many samples."""
    found: list[float] = []
    known, wild = _within_reason(heights, hole)
    found += [float(value) for value in np.unique(wild)[:8]]
    while known.size > LEAST_VALUES and len(found) < 16:
        low, high = float(known.min()), float(known.max())
        extreme = (known == low) | (known == high)
        few = sample_without(known, extreme)
        if not few.size:
            break
        # of all between the lowest and the highest, the nearest to either
        nearest = (
            float(np.min(known, where=~extreme, initial=np.inf)),
            float(np.max(known, where=~extreme, initial=-np.inf)),
        )
        candidates = [
            value
            for value, beside in zip((low, high), nearest, strict=True)
            if _is_no_data(known, value, abs(beside - value), few, is_image)
        ]
        if not candidates:
            break
        # the farther one first: the other may be a height
        middle = float(np.median(few))
        value = max(candidates, key=lambda candidate: abs(candidate - middle))
        found.append(value)
        known = known[known != value]
    return found


def _within_reason(heights: Array, hole: Mask) -> tuple[Array, Array]:
    """Returns the known values (n,) of a size that heights may have, and the larger ones (m,) but infinities."""
    # all of most scans: then without a copy
    if not hole.any() and max(-float(heights.min()), float(heights.max())) < _BEYOND_HEIGHTS:
        return heights.reshape(-1), np.empty(0)
    with np.errstate(invalid="ignore"):
        small = np.abs(heights) < _BEYOND_HEIGHTS
    return heights[~hole & small], heights[~hole & ~small & np.isfinite(heights)]


def _is_no_data(known: Array, value: float, gap: float, few: Array, is_image: bool) -> bool:
    """Whether the lowest or highest value is a number for no data.

    gap: its distance from the nearest other value. few: a sample of the values between the lowest and highest.
    """
    range_ = spread(few)
    size = abs(value)
    if not is_image and (size >= _BEYOND_OUTLIERS or size in _CONVENTIONAL):
        return range_ > 0 and gap >= _APART_KNOWN * range_
    count = int(np.count_nonzero(known == value))
    if not max(LEAST_COUNT, _LEAST_SHARE * known.size) <= count <= _LARGEST_SHARE * known.size:
        return False
    # differences by rounding make no different values
    steps = np.unique(np.round((few - value) / gap, 6))
    return range_ > 0 and gap >= _APART * range_ and steps.size >= LEAST_VALUES


def doubtful_extremes(known: Array) -> list[str]:
    """Tells of a lowest or highest value that many samples hold, too close to the others to be taken for no data.

    Clipped heights end at the others, and the levels of a grating have few values between them.
    """
    few = np.sort(sample(known))
    levels, counts = np.unique(few, return_counts=True)
    if levels.size < LEAST_VALUES:
        return []
    doubts = []
    for end, beside in ((0, 1), (-1, -2)):
        gap = abs(float(levels[beside] - levels[end]))
        inner = np.diff(levels[1:-1])
        held = counts[end] / few.size
        if _PLATEAU_SHARE < held <= _LARGEST_SHARE and gap > max(_DOUBTFUL * spread(few), inner.max()):
            value = f"{levels[end]:.6g}"
            doubts.append(
                f"{100 * held:.2g} % of the samples hold one value, {value}, apart from all others: if they were not "
                f"measured, set surface.no_data = [{value}]"
            )
    return doubts


def plateau(known: Array) -> tuple[float, float] | None:
    """Finds a value among the heights that far more samples hold than its nearest values, as voids set to 0 do.

    Two such values are levels of a grating, and one at either end of the heights is where they were clipped.
    Returns the value and the distance within which samples hold it.
    """
    few = sample(known)
    if few.size < 100 or np.ptp(few) == 0:
        return None
    tolerance = ROUNDING * float(np.ptp(few))
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


def sample(values: Array) -> Array:
    """Takes every n-th of many values."""
    # an odd step meets all columns of the usual widths
    return values[:: values.size // _ESTIMATED_FROM | 1]


def sample_without(values: Array, excluded: Mask) -> Array:
    """Takes every n-th of the values that are not excluded, `sample(values[~excluded])`, without a copy of all."""
    places = np.flatnonzero(excluded)
    count = values.size - places.size
    kept = np.arange(0, count, count // _ESTIMATED_FROM | 1)
    # the place of the i-th value that is kept: i, and one more for each excluded one before it
    taken: Array = values.reshape(-1)[kept + np.searchsorted(places - np.arange(places.size), kept, "right")]
    return taken


def spread(values: Array) -> float:
    """Estimates the range of 99 % of the values, which dust does not widen."""
    low, high = np.percentile(sample(values), (0.5, 99.5))
    return float(high - low)
