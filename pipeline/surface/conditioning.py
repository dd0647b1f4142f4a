"""Conditions a scan for diffraction: levels it, clips it, fills its holes and centres it, in this order.

Levelling and clipping use valid samples only. Holes are therefore filled last, from neighbours without tilt and dust.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array, on_a_cache_line
from pipeline.errors import InputError
from pipeline.surface.fill import fill_holes
from pipeline.surface.heightfield import HeightField

Mask = NDArray[np.bool_]

LEVELS = ("none", "plane", "quadratic", "rows")
# rows that are levelled at once
_ROWS_AT_ONCE = 64


@dataclass(frozen=True)
class ConditioningRecord:
    """The changes made to a scan; every value can be written as JSON.

    holes: samples without a height, filled by harmonic interpolation. hole_share: their share of all samples.
    level: the background that was subtracted: "none", "plane", "quadratic" or "rows".
    slope_deg: slope subtracted along (x, y) at the middle of the patch, degrees.
    curvature_per_um: second derivatives subtracted, (xx, xy, yy), 1/um.
    row_offset_rms_um: standard deviation of the subtracted row medians.
    removed_rms_um: standard deviation of the whole background.
    clip_percentile: (low, high), percent. clip_um: the heights at these percentiles, after levelling.
    clipped_low, clipped_high: samples moved to a limit. clipped_share: their share of the valid samples.
    range_before_um, range_after_um: peak to valley before and after the clipping. range_kept: their ratio.
    centre_um: middle of the height range, which was subtracted last.
    """

    holes: int
    hole_share: float
    level: str
    slope_deg: tuple[float, float] = (0.0, 0.0)
    curvature_per_um: tuple[float, float, float] = (0.0, 0.0, 0.0)
    row_offset_rms_um: float = 0.0
    removed_rms_um: float = 0.0
    clip_percentile: tuple[float, float] | None = None
    clip_um: tuple[float, float] | None = None
    clipped_low: int = 0
    clipped_high: int = 0
    clipped_share: float = 0.0
    range_before_um: float = 0.0
    range_after_um: float = 0.0
    range_kept: float = 1.0
    centre_um: float = 0.0


def condition(
    field: HeightField, level: str, clip_percentile: tuple[float, float] | None
) -> tuple[HeightField, ConditioningRecord]:
    """Levels, clips, fills and centres a height field.

    field: heights, um; samples that are not finite are holes. level: one of LEVELS (see `_level`).
    clip_percentile: (low, high) percentiles of the valid samples, to which heights are limited against dust.
    Returns the conditioned field and the record of the changes.
    Raises InputError where no sample is valid; ValueError for an unknown level.
    """
    if level not in LEVELS:
        raise ValueError(f"expected one of {LEVELS}, got {level!r}")
    valid = np.isfinite(field.heights_um)
    if not valid.any():
        raise InputError("expected heights, found a hole in every sample of the scan; choose another channel")
    holes = int(valid.size - np.count_nonzero(valid))
    record = ConditioningRecord(holes, holes / valid.size, level)
    heights, record = _level(field, valid, record)
    heights, record = _clip(heights, valid, clip_percentile, record)
    if holes:
        heights = fill_holes(heights, valid, field.pitch_um)
    centre = 0.5 * (float(heights.max()) + float(heights.min()))
    # the scan's own heights stay as they are; the levelled ones serve nothing else
    is_levelled = level != "none" and clip_percentile is None and not holes
    out = heights if is_levelled else on_a_cache_line(heights.shape, np.float64)
    return HeightField(np.subtract(heights, centre, out=out), field.pitch_um), replace(record, centre_um=centre)


# --- levelling ---------------------------------------------------------------------------------------


def _level(field: HeightField, valid: Mask, record: ConditioningRecord) -> tuple[Array, ConditioningRecord]:
    """Subtracts the background that `record.level` names, and records it.

    plane, quadratic: the least-squares polynomial of total degree 1, 2 in x and y. rows: the plane, and then the
    median of each row, which removes steps between scan lines (the fast axis is x).
    """
    heights = field.heights_um
    if record.level == "none":
        return heights, record
    background, slopes, curvatures = _polynomial(field, valid, degree=2 if record.level == "quadratic" else 1)
    levelled, offsets = on_a_cache_line(heights.shape, np.float64), np.zeros(heights.shape[0])
    for rows in _blocks(heights):
        np.subtract(heights[rows], background.of(rows), out=levelled[rows])
    if record.level == "rows":
        offsets = _row_medians(levelled, valid)
        levelled -= offsets[:, None]
    record = replace(
        record,
        slope_deg=slopes,
        curvature_per_um=curvatures,
        row_offset_rms_um=float(np.std(offsets)),
        removed_rms_um=_removed_rms(background, offsets, valid),
    )
    return levelled, record


def _blocks(heights: Array | Mask) -> list[slice]:
    """Divides rows into blocks: arrays of all samples would cost more time for their pages than for their values."""
    return [slice(first, first + _ROWS_AT_ONCE) for first in range(0, len(heights), _ROWS_AT_ONCE)]


@dataclass(frozen=True)
class _Background:
    """A polynomial over the samples: sum along_y[:, p] x^p.

    along_y: its coefficients in every row, um, (ny, 3). powers_x: of x, (3, nx).
    """

    along_y: Array
    powers_x: Array

    def of(self, rows: slice) -> Array:
        """Computes its values in some rows, (rows, nx), um."""
        constant, linear, square = self.along_y[rows].T[:, :, None]
        values: Array = linear * self.powers_x[1] + constant
        if square.any():
            values += square * self.powers_x[2]
        return values


def _removed_rms(background: _Background, offsets: Array, valid: Mask) -> float:
    """Computes the standard deviation of what was subtracted from the valid samples, um; offsets: of rows, (ny,)."""
    # relative to a value among them, so that the squares lose no digits
    middle = float(np.mean(background.along_y[:, 0] + offsets))
    total = squares = 0.0
    for rows in _blocks(valid):
        removed = np.where(valid[rows], background.of(rows) + (offsets[rows, None] - middle), 0.0)
        total += float(np.sum(removed))
        squares += float(np.sum(np.vecdot(removed, removed)))
    count = np.count_nonzero(valid)
    return sqrt(max(0.0, squares / count - (total / count) ** 2))


def _polynomial(
    field: HeightField, valid: Mask, degree: int
) -> tuple[_Background, tuple[float, float], tuple[float, float, float]]:
    """Fits a least-squares polynomial to the valid samples.

    Returns it, its slopes along (x, y), degrees, and its curvatures (xx, xy, yy), 1/um.
    """
    (x, y), (pitch_x, pitch_y) = field.coordinates_um(), field.pitch_um
    # on [-1, 1] all powers have one magnitude, and the normal equations are well conditioned
    scale_x, scale_y = max(pitch_x, -x[0]), max(pitch_y, -y[0])
    # without its mean, heights with a large offset keep their digits
    mean = float(np.mean(field.heights_um, where=valid))
    c = _fit(x / scale_x, y / scale_y, field.heights_um, mean, valid, degree)
    along_y = _powers(y / scale_y, 2) @ c
    along_y[:, 0] += mean
    slope_x, slope_y = np.degrees(np.arctan([c[0, 1] / scale_x, c[1, 0] / scale_y]))
    xx, xy, yy = 2 * c[0, 2] / scale_x**2, c[1, 1] / (scale_x * scale_y), 2 * c[2, 0] / scale_y**2
    background = _Background(along_y, np.ascontiguousarray(_powers(x / scale_x, 2).T))
    return background, (float(slope_x), float(slope_y)), (float(xx), float(xy), float(yy))


def _fit(x: Array, y: Array, heights: Array, mean: float, valid: Mask, degree: int) -> Array:
    """Fits sum c[q, p] x^p y^q with p + q <= degree <= 2 to the valid `heights` (ny, nx) minus `mean`.

    Sums of monomials over a grid separate into small matrix products, so that no design matrix is needed.
    x, y: coordinates (nx,), (ny,). Returns c (3, 3).
    """
    powers_x, powers_y = np.ascontiguousarray(_powers(x, 2 * degree).T), _powers(y, 2 * degree)
    counts, sums = np.empty((2, len(y), len(powers_x)))
    for rows in _blocks(heights):
        # a matrix product would start threads, which cost more than these few sums
        counts[rows] = np.vecdot(valid[rows].astype(np.float64)[:, None], powers_x)
        sums[rows] = np.vecdot(np.where(valid[rows], heights[rows] - mean, 0.0)[:, None], powers_x)
    moments, right = powers_y.T @ counts, powers_y.T @ sums
    terms = [(q, p) for q in range(degree + 1) for p in range(degree + 1 - q)]
    gram = np.array([[moments[q + s, p + r] for s, r in terms] for q, p in terms])
    # lstsq returns the solution of least norm: terms that a single row, or holes, leave undetermined are 0
    solution = np.linalg.lstsq(gram, np.array([right[term] for term in terms]), rcond=None)[0]
    coefficients = np.zeros((3, 3))
    for term, value in zip(terms, solution, strict=True):
        coefficients[term] = value
    return coefficients


def _powers(x: Array, highest: int) -> Array:
    """Returns the powers x^0 .. x^highest, (len(x), highest + 1)."""
    return np.vander(x, highest + 1, increasing=True)


def _row_medians(heights: Array, valid: Mask) -> Array:
    """Computes the median of each row's valid samples, (ny,); 0, the level of the plane, for an empty row."""
    medians = np.zeros(heights.shape[0])
    whole = valid.all(axis=1)
    medians[whole] = np.median(heights[whole], axis=1)
    for j in np.flatnonzero(~whole & valid.any(axis=1)):
        medians[j] = np.median(heights[j, valid[j]])
    return medians


# --- clipping ----------------------------------------------------------------------------------------


def _clip(
    heights: Array, valid: Mask, percentile: tuple[float, float] | None, record: ConditioningRecord
) -> tuple[Array, ConditioningRecord]:
    """Limits heights to percentiles of the valid samples, and records the change."""
    highest, lowest = (
        float(end(heights, where=valid, initial=outside)) for end, outside in ((np.max, -np.inf), (np.min, np.inf))
    )
    before = highest - lowest
    if percentile is None:
        return heights, replace(record, range_before_um=before, range_after_um=before)
    known = heights[valid]
    low, high = (float(value) for value in np.percentile(known, percentile))
    below, above = int(np.count_nonzero(known < low)), int(np.count_nonzero(known > high))
    record = replace(
        record,
        clip_percentile=percentile,
        clip_um=(low, high),
        clipped_low=below,
        clipped_high=above,
        clipped_share=(below + above) / known.size,
        range_before_um=before,
        range_after_um=high - low,
        range_kept=(high - low) / before if before > 0 else 1.0,
    )
    return np.clip(heights, low, high), record
