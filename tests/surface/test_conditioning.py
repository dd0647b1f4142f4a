"""Laws of conditioning: levelling removes what was added, clips count, holes invent nothing."""

import json
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.surface.conditioning import LEVELS, condition
from pipeline.surface.fill import fill_holes
from pipeline.surface.heightfield import HeightField

PITCH = (0.05, 0.08)
tilts = st.floats(-2.0, 2.0)


def rough(seed: int, shape: tuple[int, int] = (41, 60)) -> HeightField:
    return HeightField(np.random.default_rng(seed).standard_normal(shape) * 0.1, PITCH)


def punched(field: HeightField, seed: int, share: float) -> HeightField:
    holes = np.random.default_rng(seed).random(field.shape) < share
    return HeightField(np.where(holes, np.nan, field.heights_um), field.pitch_um)


def surface(field: HeightField, a: float, b: float, c: float, xx: float, xy: float, yy: float) -> HeightField:
    x, y = field.coordinates_um()
    y = y[:, None]
    shape = a + b * x + c * y + 0.5 * xx * x**2 + xy * x * y + 0.5 * yy * y**2
    return HeightField(field.heights_um + shape, field.pitch_um)


@given(st.integers(0, 99), st.floats(-1e3, 1e3), tilts, tilts, st.floats(0.0, 0.9))
@settings(max_examples=60, deadline=None)
def test_plane_levelling_forgets_any_plane(seed: int, a: float, b: float, c: float, holes: float) -> None:
    base = punched(rough(seed), seed, holes)
    plain, before = condition(base, "plane", None)
    tilted, after = condition(surface(base, a, b, c, 0, 0, 0), "plane", None)
    # heights of 1e3 um carry rounding of 1e-13; the fit multiplies it by less than 1e2
    np.testing.assert_allclose(tilted.heights_um, plain.heights_um, atol=1e-10)
    for added, i in ((b, 0), (c, 1)):
        slopes = [np.tan(np.radians(record.slope_deg[i])) for record in (before, after)]
        assert slopes[1] - slopes[0] == pytest.approx(added, abs=1e-9)


@given(st.integers(0, 99), tilts, tilts, tilts, tilts, tilts, st.floats(0.0, 0.5))
@settings(max_examples=60, deadline=None)
def test_quadratic_levelling_forgets_any_bow(
    seed: int, b: float, c: float, xx: float, xy: float, yy: float, holes: float
) -> None:
    base = punched(rough(seed), seed, holes)
    plain, before = condition(base, "quadratic", None)
    bowed, after = condition(surface(base, 0.3, b, c, xx, xy, yy), "quadratic", None)
    np.testing.assert_allclose(bowed.heights_um, plain.heights_um, atol=1e-11)
    added = np.subtract(after.curvature_per_um, before.curvature_per_um)
    np.testing.assert_allclose(added, (xx, xy, yy), atol=1e-9)


def test_an_exact_plane_leaves_nothing_but_a_flat_field() -> None:
    flat = HeightField(np.zeros((30, 50)), PITCH)
    field, record = condition(surface(flat, 5.0, 0.1, -0.2, 0, 0, 0), "plane", None)
    np.testing.assert_allclose(field.heights_um, 0.0, atol=1e-13)
    assert record.slope_deg == pytest.approx(np.degrees(np.arctan((0.1, -0.2))), rel=1e-12)
    x, y = flat.coordinates_um()
    expected = np.std(0.1 * x - 0.2 * y[:, None])
    assert record.removed_rms_um == pytest.approx(expected, rel=1e-12)


def test_the_fitted_plane_is_the_least_squares_plane() -> None:
    base = punched(surface(rough(3), 1.0, 0.3, 0.2, 1.0, 0, 0), 4, 0.3)
    field, record = condition(base, "plane", None)
    x, y = base.coordinates_um()
    valid = np.isfinite(base.heights_um)
    xx, yy = np.broadcast_arrays(x, y[:, None])
    design = np.column_stack([np.ones(valid.sum()), xx[valid], yy[valid]])
    reference = np.linalg.lstsq(design, base.heights_um[valid], rcond=None)[0]
    assert np.tan(np.radians(record.slope_deg)) == pytest.approx(reference[1:], rel=1e-10)
    residual = base.heights_um[valid] - design @ reference
    np.testing.assert_allclose(field.heights_um[valid] + record.centre_um, residual, atol=1e-12)


def test_row_levelling_leaves_every_median_at_zero() -> None:
    steps = np.random.default_rng(1).standard_normal(41)
    base = punched(HeightField(rough(1).heights_um + steps[:, None], PITCH), 2, 0.1)
    field, record = condition(base, "rows", None)
    valid = np.isfinite(base.heights_um)
    medians = [np.median(row[ok]) for row, ok in zip(field.heights_um, valid, strict=True)]
    np.testing.assert_allclose(medians, -record.centre_um, atol=1e-14)
    # the plane took part of the steps; their medians scatter by 0.1 * sqrt(pi / 2 / 54)
    assert record.row_offset_rms_um == pytest.approx(steps.std(), rel=0.15)


def test_a_row_of_holes_takes_no_part_in_row_levelling() -> None:
    base = rough(1).heights_um
    base[7] = np.nan
    field, _ = condition(HeightField(base, PITCH), "rows", None)
    assert np.isfinite(field.heights_um).all()
    assert abs(np.median(field.heights_um[7]) - np.median(field.heights_um)) < 0.1


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (2, 2)])
@pytest.mark.parametrize("level", LEVELS)
def test_thin_fields_are_levelled_without_complaint(shape: tuple[int, int], level: str) -> None:
    field, _ = condition(rough(0, shape), level, None)
    assert np.isfinite(field.heights_um).all()


def test_no_levelling_only_centres() -> None:
    base = rough(2)
    field, record = condition(base, "none", None)
    np.testing.assert_array_equal(field.heights_um, base.heights_um - record.centre_um)
    assert field.heights_um.max() == pytest.approx(-field.heights_um.min(), rel=1e-12)
    assert (record.removed_rms_um, record.clip_um, record.range_kept) == (0.0, None, 1.0)


def test_the_clip_counts_what_it_moves() -> None:
    heights = np.random.default_rng(0).permutation(np.arange(1001.0)).reshape(7, 143)
    field, record = condition(HeightField(heights, PITCH), "none", (1.0, 98.0))
    # percentiles of 0..1000 are 10 and 980: 0..9 and 981..1000 lie outside
    assert record.clip_um == pytest.approx((10.0, 980.0))
    assert (record.clipped_low, record.clipped_high) == (10, 20)
    assert record.clipped_share == pytest.approx(30 / 1001)
    assert (record.range_before_um, record.range_after_um) == pytest.approx((1000.0, 970.0))
    assert record.range_kept == pytest.approx(0.97)
    np.testing.assert_allclose(field.heights_um, np.clip(heights, 10, 980) - 495, atol=1e-12)


def test_the_clip_takes_dust_but_not_its_neighbours() -> None:
    base = rough(5)
    dusty = base.heights_um.copy()
    dusty[20, 30] = 5.0
    field, record = condition(HeightField(dusty, PITCH), "none", (0.0, 99.9))
    assert record.clipped_high == 3  # 2460 samples: rank 2456.5 of 0..2459
    assert np.ptp(field.heights_um) < 1.0


@given(st.integers(0, 10**6), st.floats(0.01, 0.98))
@settings(max_examples=60, deadline=None)
def test_filled_holes_stay_within_their_neighbours(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    heights = rng.standard_normal((13, 17))
    valid = rng.random(heights.shape) >= share
    valid[rng.integers(13), rng.integers(17)] = True
    filled = fill_holes(np.where(valid, heights, np.nan), valid, PITCH)
    np.testing.assert_array_equal(filled[valid], heights[valid])
    assert filled.min() >= heights[valid].min() - 1e-12
    assert filled.max() <= heights[valid].max() + 1e-12
    # each filled sample lies within its own four neighbours
    padded = np.pad(filled, 1, constant_values=np.nan)
    around = np.stack([padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]])
    assert np.all(filled[~valid] >= np.nanmin(around, axis=0)[~valid] - 1e-12)
    assert np.all(filled[~valid] <= np.nanmax(around, axis=0)[~valid] + 1e-12)


def test_holes_in_a_plane_are_filled_by_the_plane() -> None:
    flat = HeightField(np.zeros((40, 50)), PITCH)
    plane = surface(flat, 0.0, 0.3, -0.1, 0, 0, 0).heights_um
    valid = np.ones(plane.shape, bool)
    valid[10:25, 12:30] = False
    np.testing.assert_allclose(fill_holes(plane, valid, PITCH), plane, atol=1e-12)


def test_filling_weighs_neighbours_by_distance() -> None:
    heights = np.array([[0.0, 3.0, 0.0], [1.0, np.nan, 1.0], [0.0, 3.0, 0.0]])
    # weights 1 / 0.05^2 along x and 1 / 0.10^2 along y: 4 to 1
    filled = fill_holes(heights, np.isfinite(heights), (0.05, 0.10))
    assert filled[1, 1] == pytest.approx((4 * 1.0 + 1 * 3.0) / 5)


def test_holes_are_counted_and_change_nothing_else() -> None:
    base = punched(rough(8), 8, 0.05)
    field, record = condition(base, "none", None)
    valid = np.isfinite(base.heights_um)
    assert record.holes == np.count_nonzero(~valid) > 50
    assert record.hole_share == record.holes / valid.size
    np.testing.assert_array_equal(field.heights_um[valid], base.heights_um[valid] - record.centre_um)


def test_the_record_is_json() -> None:
    _, record = condition(punched(rough(1), 1, 0.1), "rows", (0.05, 99.9))
    assert json.loads(json.dumps(asdict(record)))["level"] == "rows"


def test_nothing_but_holes_is_refused() -> None:
    with pytest.raises(InputError, match="every sample"):
        condition(HeightField(np.full((3, 3), np.nan), PITCH), "plane", None)


def test_an_unknown_level_is_refused() -> None:
    with pytest.raises(ValueError, match="cubic"):
        condition(rough(0), "cubic", None)
