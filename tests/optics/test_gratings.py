"""Closed forms of gratings against Fourier sums, energy and the grating equation."""

import numpy as np
import pytest

from pipeline.diffraction.reference import power_direct
from pipeline.optics import geometry, gratings
from pipeline.optics.gratings import in_plane, period_um, viewing_angle
from pipeline.surface import recipes
from pipeline.surface.recipes.parameters import Blazed

S = np.array([-3.0, -11.7, -24.0])[:, None]
ORDERS = np.arange(-6, 7)
THETA_I = np.radians(75.0)


def coefficients(heights: np.ndarray, s: np.ndarray) -> np.ndarray:
    """|c_m|^2 (s, orders) of one period of heights by the sum itself."""
    places = (np.arange(len(heights)) + 0.5) / len(heights)
    waves = np.exp(2j * np.pi * np.outer(places, ORDERS))
    return np.abs(np.exp(1j * s * heights) @ waves / len(heights)) ** 2


def test_a_sinusoid_is_a_bessel_function() -> None:
    heights = 0.13 * np.cos(2.0 * np.pi * (np.arange(64) + 0.5) / 64)
    np.testing.assert_allclose(gratings.sinusoid(ORDERS, S, 0.13), coefficients(heights, S), atol=1e-13)


@pytest.mark.parametrize("samples", [16, 61])
def test_a_sampled_blaze_is_the_sum_over_its_samples(samples: int) -> None:
    heights = 0.25 * (np.arange(samples) + 0.5) / samples
    found = gratings.sampled_blaze(ORDERS, S, 0.25, samples)
    np.testing.assert_allclose(found, coefficients(heights, S), atol=1e-13)


@pytest.mark.parametrize(("samples", "duty"), [(16, 0.5), (60, 0.3)])
def test_a_sampled_rectangle_is_the_sum_over_its_samples(samples: int, duty: float) -> None:
    heights = np.where(np.arange(samples) < round(duty * samples), 0.12, 0.0)
    found = gratings.sampled_rectangle(ORDERS, S, 0.12, duty, samples)
    np.testing.assert_allclose(found, coefficients(heights, S), atol=1e-13)


@pytest.mark.parametrize("samples", [64, 256])
def test_sampling_errors_have_the_documented_bounds(samples: int) -> None:
    """1 / (3 M^2) of a blaze and 4 / (3 M^2) of a rectangle, approached and not passed by more than orders / M."""
    blaze = gratings.sampled_blaze(ORDERS, S, 0.25, samples) - gratings.blaze(ORDERS, S, 0.25)
    rectangle = gratings.sampled_rectangle(ORDERS, S, 0.12, 0.5, samples) - gratings.rectangle(ORDERS, S, 0.12, 0.5)
    for error, bound in ((blaze, 1.0 / 3.0), (rectangle, 4.0 / 3.0)):
        assert np.all(error > -1e-15)
        assert 0.5 * bound < samples**2 * np.max(error) < 1.1 * bound


@pytest.mark.parametrize("duty", [0.5, 0.23])
def test_orders_share_all_the_light(duty: float) -> None:
    """sum |c_m|^2 = 1 at any s: Parseval. The tails of steps fall as 1 / m^2."""
    orders, s = np.arange(-4000, 4001), -17.3
    assert np.sum(gratings.sinusoid(orders[3900:4101], s, 0.2)) == pytest.approx(1.0, abs=1e-12)
    assert np.sum(gratings.blaze(orders, s, 0.3)) == pytest.approx(1.0, abs=1e-4)
    assert np.sum(gratings.rectangle(orders, s, 0.15, duty)) == pytest.approx(1.0, abs=2e-4)


def test_a_blaze_rising_towards_x_sends_light_towards_minus_x() -> None:
    """Half a wavelength high at normal incidence: all of it into m = 1, which leaves towards -x."""
    wi, ratio = np.array([0.0, 0.0, 1.0]), 1e-3
    wr = gratings.view_of_order(wi, 1, ratio)
    assert wr[0] == pytest.approx(-ratio)
    s = 2.0 * np.pi * geometry.uvw(wi, wr)[2]
    assert gratings.blaze(1, s, 0.5) == pytest.approx(1.0, abs=1e-6)


def test_order_zero_is_the_mirror_direction_and_far_orders_do_not_propagate() -> None:
    wi = geometry.direction(0.7, 0.4)
    np.testing.assert_allclose(gratings.view_of_order(wi, 0, 0.3), wi * [-1.0, -1.0, 1.0], atol=1e-15)
    wr = gratings.view_of_order(wi, np.arange(-9, 10), 0.3)
    propagates = np.isfinite(wr[:, 2])
    np.testing.assert_allclose(np.linalg.norm(wr[propagates], axis=-1), 1.0, atol=1e-15)
    # |0.593 + 0.3 m| < 0.968
    assert list(np.arange(-9, 10)[propagates]) == [-5, -4, -3, -2, -1, 0, 1]


def test_the_efficiency_of_an_order_is_the_integral_over_its_lobe() -> None:
    """|c|^2 G / w^2 is the integral of the BRDF times cos over a narrow lobe: a mirror's is 1 at every angle."""
    wi = geometry.direction(np.radians([0.0, 30.0, 80.0]), 0.3)
    np.testing.assert_allclose(gratings.efficiency(1.0, wi, gratings.view_of_order(wi, 0, 0.5)), 1.0, atol=1e-12)
    # 1 / cos(tr) at normal incidence
    wr = gratings.view_of_order(wi[0], 1, 0.6)
    assert gratings.efficiency(0.4, wi[0], wr) == pytest.approx(0.4 / 0.8)


# --- the grating equation ----------------------------------------------------------------------------


def test_the_mirror_direction_is_order_zero_of_every_period() -> None:
    np.testing.assert_allclose(viewing_angle(THETA_I, [0.5, 2.5], 0.55, order=0), THETA_I)
    assert np.isinf(period_um(THETA_I, THETA_I, 0.55))
    wi, wr = in_plane(THETA_I, 0.7, THETA_I)
    np.testing.assert_allclose(geometry.uvw(wi, wr)[:2], 0.0, atol=1e-15)


@pytest.mark.parametrize("order", [1, 2, -3])
def test_period_and_angle_are_inverse(order: int) -> None:
    wavelengths = np.linspace(0.38, 0.78, 9)
    theta = np.radians(20.0)
    phi = viewing_angle(theta, 5.0, wavelengths, order)
    assert np.all(np.isfinite(phi))
    np.testing.assert_allclose(period_um(theta, phi, wavelengths, order), 5.0, rtol=1e-13)


def test_an_order_beyond_the_horizon_has_no_angle() -> None:
    """sin 75 deg - 0.78 / 0.39 = -1.03."""
    assert np.isnan(viewing_angle(THETA_I, 0.39, 0.78))
    assert np.isfinite(viewing_angle(THETA_I, 0.40, 0.78))
    assert np.isnan(viewing_angle(THETA_I, 2.5, 0.55, order=-1))


@pytest.mark.parametrize("azimuth_deg", [0.0, 33.0, 180.0, 270.0])
def test_order_m_has_the_frequency_minus_m_over_a_along_the_light(azimuth_deg: float) -> None:
    azimuth = np.radians(azimuth_deg)
    for order in (1, 2):
        phi = viewing_angle(THETA_I, 2.5, 0.55, order)
        wi, wr = in_plane(THETA_I, azimuth, phi)
        f = geometry.uvw(wi, wr)[:2] / 0.55
        expected = -order / 2.5 * np.array([np.cos(azimuth), np.sin(azimuth)])
        np.testing.assert_allclose(f, expected, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(wr), 1.0)


def test_the_blaze_sends_its_light_into_the_first_order_of_a_light_from_minus_x() -> None:
    """A sawtooth rising towards +x reflects towards -x: m = 1 leans back towards a light at -x, m = -1 at +x."""
    field = recipes.make(Blazed(kind="blazed", size_um=30.0, pitch_um=0.1))
    phi = viewing_angle(np.radians(20.0), 2.5, 0.55)
    powers = []
    for azimuth in (0.0, np.pi):
        wi, wr = in_plane(np.radians(20.0), azimuth, phi[None])
        powers.append(power_direct(field, 7.0, geometry.uvw(wi, wr), 550.0)[0])
    assert powers[1] > 10 * powers[0]
