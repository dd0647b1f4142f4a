"""Conditions a scan for diffraction: levels it, clips it, fills its holes and centres it, in this order.

Levelling and clipping use valid samples only. Holes are therefore filled last, from neighbours without tilt and dust.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array, on_a_cache_line
from pipeline.errors import InputError
from pipeline.surface.fill import fill_holes
from pipeline.surface.heightfield import HeightField

Mask = NDArray[np.bool_]

LEVELS = ("none", "plane", "quadratic", "rows")


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
    centred = np.subtract(heights, centre, out=on_a_cache_line(heights.shape, np.float64))
    return HeightField(centred, field.pitch_um), replace(record, centre_um=centre)


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
    offsets = np.zeros(heights.shape[0])
    if record.level == "rows":
        offsets = _row_medians(heights - background, valid)
        background = background + offsets[:, None]
    record = replace(
        record,
        slope_deg=slopes,
        curvature_per_um=curvatures,
        row_offset_rms_um=float(np.std(offsets)),
        removed_rms_um=float(np.std(background[valid])),
    )
    return heights - background, record


def _polynomial(
    field: HeightField, valid: Mask, degree: int
) -> tuple[Array, tuple[float, float], tuple[float, float, float]]:
    """Fits a least-squares polynomial to the valid samples.

    Returns its values (ny, nx), um, its slopes along (x, y), degrees, and its curvatures (xx, xy, yy), 1/um.
    """
    (x, y), (pitch_x, pitch_y) = field.coordinates_um(), field.pitch_um
    # on [-1, 1] all powers have one magnitude, and the normal equations are well conditioned
    scale_x, scale_y = max(pitch_x, -x[0]), max(pitch_y, -y[0])
    # without its mean, heights with a large offset keep their digits
    mean = float(np.mean(field.heights_um, where=valid))
    heights = np.where(valid, field.heights_um - mean, 0.0)
    c = _fit(x / scale_x, y / scale_y, heights, valid, degree)
    powers_x, powers_y = _powers(x / scale_x, 2), _powers(y / scale_y, 2)
    background = mean + powers_y @ c @ powers_x.T
    slope_x, slope_y = np.degrees(np.arctan([c[0, 1] / scale_x, c[1, 0] / scale_y]))
    xx, xy, yy = 2 * c[0, 2] / scale_x**2, c[1, 1] / (scale_x * scale_y), 2 * c[2, 0] / scale_y**2
    return background, (float(slope_x), float(slope_y)), (float(xx), float(xy), float(yy))


def _fit(x: Array, y: Array, heights: Array, valid: Mask, degree: int) -> Array:
    """Fits sum c[q, p] x^p y^q with p + q <= degree <= 2 to `heights` (ny, nx), which are 0 in holes.

    Sums of monomials over a grid separate into small matrix products, so that no design matrix is needed.
    x, y: coordinates (nx,), (ny,). Returns c (3, 3).
    """
    powers_x, powers_y = _powers(x, 2 * degree), _powers(y, 2 * degree)
    moments = powers_y.T @ (valid @ powers_x)
    right = powers_y.T @ (heights @ powers_x)
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
    known = heights[valid]
    before = float(known.max() - known.min())
    if percentile is None:
        return heights, replace(record, range_before_um=before, range_after_um=before)
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
