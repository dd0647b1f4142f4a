"""Displayed colours and their differences, against colour-science used directly."""

import colour
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.optics.colour import (
    EXPOSURES_RU,
    SRGB_FROM_XYZ,
    SRGB_TO_XYZ,
    WHITE_XYZ,
    colour_errors,
    delta_e,
    displayed_srgb,
    pixels,
)

D65_XY = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
WHITE = colour.xy_to_XYZ(D65_XY)
colours = arrays(np.float64, (4, 3), elements=st.floats(0.0, 1.5))
exposures = st.floats(0.1, 1e4)


def test_srgb_is_the_librarys():
    space = colour.RGB_COLOURSPACES["sRGB"]
    np.testing.assert_array_equal(SRGB_TO_XYZ, space.matrix_RGB_to_XYZ)
    np.testing.assert_array_equal(SRGB_FROM_XYZ, space.matrix_XYZ_to_RGB)
    np.testing.assert_allclose(WHITE_XYZ, colour.xy_to_XYZ(space.whitepoint), rtol=1e-15)


@given(a=colours, b=colours, exposure=exposures)
def test_difference_is_colour_sciences(a, b, exposure):
    """XYZ times exposure, to linear sRGB, clipped, back, CIELAB under D65, dE*ab of 1976."""

    def lab(xyz):
        shown = np.clip(colour.XYZ_to_RGB(exposure * xyz, "sRGB", apply_cctf_encoding=False), 0.0, 1.0)
        return colour.XYZ_to_Lab(colour.RGB_to_XYZ(shown, "sRGB", apply_cctf_decoding=False), D65_XY)

    expected = colour.delta_E(lab(a), lab(b), method="CIE 1976")
    np.testing.assert_allclose(delta_e(a, b, exposure), expected, atol=1e-9)


@given(a=colours, b=colours, exposure=exposures)
def test_difference_is_a_distance(a, b, exposure):
    """Nothing from a colour to itself, the same both ways."""
    assert np.all(delta_e(a, a, exposure) == 0.0)
    np.testing.assert_array_equal(delta_e(a, b, exposure), delta_e(b, a, exposure))


def test_black_and_overexposed_white_are_100_apart():
    """Lightness runs from 0 to 100; sRGB's matrices, given to 4 digits, leave a few 1e-3."""
    assert delta_e(np.zeros(3), 1e-3 * WHITE, 7500.0) == pytest.approx(100.0, abs=0.02)


def test_clipping_hides_differences_between_overexposed_colours():
    """Two highlights of different brightness look the same once the screen is saturated."""
    assert delta_e(WHITE, 3.0 * WHITE, 7500.0) == 0.0
    assert delta_e(WHITE, 3.0 * WHITE, 0.1) > 10.0


@pytest.mark.parametrize(
    ("linear", "code"), [(0.0, 0), (0.00037, 1), (0.002, 7), (0.5, 188), (0.21404, 127), (1.0, 255), (40.0, 255)]
)
def test_pixels_have_the_curve_of_srgb(linear, code):
    """IEC 61966-2-1: a straight line near black, and linear one half is code 188."""
    shown = pixels(linear / 50.0 * WHITE, 50.0)
    assert shown.dtype == np.uint8
    assert np.all(np.abs(shown.astype(int) - code) <= (0 if linear in (0.0, 40.0) else 1))


@given(xyz=arrays(np.float64, 3, elements=st.floats(0.0, 1.0)), low=exposures, high=exposures)
def test_displayed_colours_stay_on_screen(xyz, low, high):
    """Every shown value lies in [0, 1], and a longer exposure never darkens one, nor its pixel.

    The matrix subtracts terms of up to 5e4, whose rounding 1e-11 is left in the difference.
    """
    low, high = sorted((low, high))
    darker, brighter = displayed_srgb(xyz, low), displayed_srgb(xyz, high)
    assert np.all((darker >= 0.0) & (brighter <= 1.0))
    assert np.all(brighter >= darker - 1e-11)
    assert np.all(pixels(xyz, high).astype(int) + 1 >= pixels(xyz, low))


def test_statistics_are_of_the_differences():
    """Mean, 99th percentile and maximum over the directions, at each exposure of the paper."""
    rng = np.random.default_rng(5)
    a, b = rng.random((2, 30, 20, 3)) * 1e-3
    found = colour_errors(a, b, 50.0)
    assert [e.exposure_ru for e in found] == sorted([*EXPOSURES_RU, 50.0])
    for e in found:
        difference = delta_e(a, b, e.exposure_ru).ravel()
        assert e.mean == pytest.approx(difference.mean())
        assert e.percentile_99 == pytest.approx(np.percentile(difference, 99))
        assert e.maximum == difference.max() > e.percentile_99 > e.mean
