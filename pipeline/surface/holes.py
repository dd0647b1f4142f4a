"""Finds the samples of a scan that were not measured, and crops the rows and columns that hold nothing else.

Formats mark voids as NaN or by a mask. Others leave a number there: one of convention, the last line once more, or
zeros in lines that were never scanned. Such numbers are recognised by what no measured height does: many samples hold
the same value, far from all others, or whole rows hold one value where all other rows are rough.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.arrays import Array
from pipeline.surface.no_data import Mask, doubtful_extremes, numbers, plateau, sample_without, spread
from pipeline.surface.scan import Scan
from pipeline.surface.unscanned import constant_lines, repeated_lines, smooth_edge, straight_lines

MaskUse = Literal["holes", "ignore", "keep"]
Box = tuple[slice, slice]

# share of samples without a measured height from which a warning tells of holes
TOLD_SHARE = 0.02
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
    heights = scan.heights
    hole = np.isnan(heights)
    found: list[Unmeasured] = []
    doubts: list[str] = []

    def add(kind: str, stated: bool, new: Mask, value: float | None = None) -> None:
        nonlocal heights
        new &= ~hole
        samples = int(np.count_nonzero(new))
        if samples:
            found.append(Unmeasured(kind, stated, samples, samples / hole.size, value))
            hole[new] = True
            # the scan's own array stays as it was read; most scans need no other
            heights = heights.copy() if heights is scan.heights else heights
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
        for value in numbers(heights, hole, scan.full_code is not None):
            add("no-data number", False, heights == value, value)
        for axis, lines in ((0, "rows"), (1, "columns")):
            new, values = constant_lines(np.moveaxis(heights, axis, 0), np.moveaxis(hole, axis, 0))
            level = values[0] if len(values) == 1 else None
            add(f"{lines} of one value", False, np.moveaxis(new, 0, axis), level)
            new = straight_lines(np.moveaxis(heights, axis, 0))
            add(f"straight {lines}", False, np.moveaxis(new, 0, axis))
            new = repeated_lines(np.moveaxis(heights, axis, 0), np.moveaxis(hole, axis, 0))
            add(f"repeated {lines}", False, np.moveaxis(new, 0, axis))
        if (found_one := plateau(sample_without(heights, hole))) is not None:
            value, tolerance = found_one
            add("one value among heights", False, np.abs(heights - value) <= tolerance, value)
        doubts = [*doubtful_extremes(sample_without(heights, hole)), *_smooth_warnings(heights)]
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
    values = np.sort(sample_without(heights_um, ~np.isfinite(heights_um)))
    least = max(2, int(_POPULATION * values.size))
    if values.size < 4 * least:
        return None
    steps = np.diff(values)[least - 1 : 1 - least]
    split = least + int(np.argmax(steps))
    low, high = values[:split], values[split:]
    gap = float(high[0] - low[-1])
    if gap < max(_CLIFF_UM, _CLIFF * max(spread(low), spread(high))):
        return None
    share = 100 * min(low.size, high.size) / values.size
    return (
        f"heights lie in two groups {gap:.3g} um apart, the smaller with {share:.2g} % of the samples: if one stands "
        "for samples that were not measured, name its numbers in surface.no_data"
    )


def _box(hole: Mask) -> tuple[Box, tuple[int, int, int, int]]:
    """Returns the smallest box that holds all measured samples, and what it lacks at the four edges."""
    rows, columns = (np.flatnonzero(~hole.all(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return (slice(None), slice(None)), (0, 0, 0, 0)
    bottom, top, left, right = (int(n) for n in (rows[0], rows[-1], columns[0], columns[-1]))
    ny, nx = hole.shape
    return (slice(bottom, top + 1), slice(left, right + 1)), (bottom, ny - 1 - top, left, nx - 1 - right)


def _smooth_warnings(heights: Array) -> list[str]:
    count = smooth_edge(heights)
    if not count:
        return []
    return [f"{count} rows at an edge are far smoother than all others: if the tip was lifted there, crop them"]


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
