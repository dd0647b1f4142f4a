"""Series of exp(i z t): predicted errors bound the actual ones, and are close to them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import jv

from pipeline.diffraction.expansion import bessel, chebyshev_order, float32_rounding, largest_phase, plan_taylor
from pipeline.errors import AccuracyError
from pipeline.optics.light import LaserLine, Light, trapezoid
from pipeline.surface.heightfield import HeightField

LASER = trapezoid(Light(illuminant=LaserLine(lambda_nm=500.0)), 1.0)
T = np.linspace(-1.0, 1.0, 401)


def field(half_range_um):
    """Random heights between -H and H."""
    heights = np.random.default_rng(3).random((20, 30))
    heights = (heights - heights.min()) / (heights.max() - heights.min())
    return HeightField(half_range_um * (2.0 * heights - 1.0), (0.1, 0.1))


def taylor_error(z, order):
    """Largest |exp(i z t) - sum_(n <= N) (i z t)^n / n!| on a grid of t, and the rounding error of the sum."""
    x = T.astype(np.longdouble) * np.longdouble(z)
    term = np.ones_like(x, dtype=np.clongdouble)
    total = term.copy()
    for n in range(1, order + 1):
        term = term * (1j * x) / n
        total += term
    exact = np.cos(x) + 1j * np.sin(x)
    rounding = 10.0 * np.finfo(np.longdouble).eps * np.exp(np.longdouble(z))
    return float(np.max(np.abs(total - exact))), float(rounding)


def test_phase_is_that_of_the_largest_height_at_normal_incidence():
    """z = 2 pi / lambda * 2 H: heights that span half a wavelength give pi."""
    assert largest_phase(0.125, 500.0) == pytest.approx(np.pi, rel=1e-15)


@settings(max_examples=60, deadline=None)
@given(half_range_um=st.floats(0.001, 0.4), order=st.integers(1, 60))
def test_taylor_truncation_bounds_the_error(half_range_um, order):
    """The error never exceeds the bound, and is nearly as large, because of the first omitted term."""
    z = largest_phase(half_range_um, 500.0)
    plan = plan_taylor(field(half_range_um), LASER, float("inf"), order)
    error, rounding = taylor_error(z, order)
    assert plan.order == order
    assert error <= plan.truncation * (1.0 + 1e-9) + rounding
    if z < order + 2:
        assert error >= plan.truncation * (1.0 - z / (order + 2)) * (1.0 - 1e-9) - rounding


@given(half_range_um=st.floats(0.001, 0.1), tolerance=st.floats(1e-4, 1e-1))
def test_automatic_order_is_the_smallest_within_the_tolerance(half_range_um, tolerance):
    """The predicted error is within the tolerance, and with three terms fewer it would not be."""
    heights = field(half_range_um)
    plan = plan_taylor(heights, LASER, tolerance)
    assert plan.error <= tolerance
    assert plan.order <= 3 or plan_taylor(heights, LASER, float("inf"), plan.order - 3).error > tolerance


@given(half_range_um=st.floats(0.001, 0.4), order=st.integers(1, 60))
def test_more_height_or_fewer_terms_never_err_less(half_range_um, order):
    """Truncation grows with the heights, and decreases with the order where that exceeds the phase."""
    here, higher = (plan_taylor(field(f * half_range_um), LASER, float("inf"), order).truncation for f in (1.0, 1.1))
    assert higher >= here
    more = plan_taylor(field(half_range_um), LASER, float("inf"), order + 1).truncation
    assert (more <= here) == (largest_phase(half_range_um, 500.0) <= order + 2) or more == pytest.approx(here)


def test_flat_surface_has_the_lowest_order_and_no_truncation():
    """The series is its first term, which float32 holds to half a unit in the last place."""
    plan = plan_taylor(HeightField(np.full((4, 5), 3.0), (0.1, 0.1)), LASER, 1e-6)
    assert plan.order == 1
    assert plan.truncation == 0.0
    assert plan.rounding == pytest.approx(2.0**-24, rel=1e-6)


@given(st.floats(0.001, 5.0), st.floats(4.0, 6.0))
def test_float32_rounding_grows_with_height(half_range_um, factor):
    """Heights four times as large lose more, although |P(0)|^2, by which the loss is divided, oscillates."""
    low, high = (float32_rounding(field(f * half_range_um), LASER) for f in (1.0, factor))
    assert 0.4 * 2.0**-24 <= low < high


def test_float32_rounding_grows_towards_short_wavelengths():
    """The same height is a larger phase for blue; red light, for which Z has no weight, is finite."""
    blue, red = (
        float32_rounding(field(0.2), trapezoid(Light(illuminant=LaserLine(lambda_nm=nm)), 1.0))
        for nm in (420.0, 780.0)
    )
    assert blue > red


@pytest.mark.parametrize(
    ("half_range_um", "order", "remedy"),
    [
        (0.1, 2, 'table.terms = "auto"'),
        (1.0, None, "surface.clip_percentile"),
        (60.0, None, "table.tolerance"),
        (1000.0, None, "table.tolerance"),
    ],
    ids=["too few terms", "too high", "hopeless", "not even close"],
)
def test_refusal_predicts_the_error_and_names_the_remedy(half_range_um, order, remedy):
    """The message states the error, the tolerance and what to change."""
    heights = field(half_range_um)
    with pytest.raises(AccuracyError) as refused:
        plan_taylor(heights, LASER, 1e-4, order)
    text = str(refused.value)
    assert remedy in text
    assert "1.0e-04" in text
    assert f"float32 rounding {float32_rounding(heights, LASER):.1e}" in text
    assert f"{2 * half_range_um:.3g} um" in text
    if order is not None:
        predicted = plan_taylor(heights, LASER, float("inf"), order)
        assert f"N = {order} would err by {predicted.error:.1e}" in text


def chebyshev_error(z, order):
    """Largest |exp(i z t) - sum_(n <= N) (2 - [n=0]) i^n J_n(z) T_n(t)| on a grid of t."""
    n = np.arange(order + 1)
    coefficients = (2.0 - (n == 0)) * 1j**n * jv(n, z)
    chebyshev = np.cos(n * np.arccos(T)[:, None])
    return np.max(np.abs(chebyshev @ coefficients - np.exp(1j * z * T)))


@given(z=st.lists(st.floats(0.0, 2000.0), max_size=4), orders=st.integers(1, 300))
def test_bessel_functions_are_scipys(z, orders):
    """To the rounding of the phase z sin t."""
    found = bessel(orders, np.array(z))
    expected = jv(np.arange(orders)[:, None], np.array(z))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15 + 3e-16 * max(z, default=0.0))


@settings(max_examples=80, deadline=None)
@given(z=st.floats(0.0, 300.0), exponent=st.floats(-11.0, -1.0))
def test_chebyshev_order_is_the_smallest_within_the_tolerance(z, exponent):
    """The truncated Jacobi-Anger sum is within the tolerance for all t; with four terms fewer it would not be.

    Rounding: N terms of at most 1, each accurate to 1e-15, with phases n arccos(t) accurate to n 1e-16.
    """
    tolerance = 10.0**exponent
    order = chebyshev_order(z, tolerance)
    rounding = 1e-15 * (order + 1) + 1e-15 * z
    assert chebyshev_error(z, order) <= tolerance + 10.0 * rounding
    assert order <= 4 or chebyshev_error(z, order - 4) > tolerance


@given(z=st.floats(0.0, 300.0), dz=st.floats(0.0, 30.0), exponent=st.floats(-12.0, -1.0), more=st.floats(0.0, 3.0))
def test_chebyshev_order_is_monotone_in_tolerance(z, dz, exponent, more):
    """A tighter tolerance never needs fewer terms; a larger phase needs at most one fewer, since J_n oscillates."""
    order = chebyshev_order(z, 10.0**exponent)
    assert chebyshev_order(z, 10.0 ** (exponent - more)) >= order
    assert chebyshev_order(z + dz, 10.0**exponent) >= order - 1
