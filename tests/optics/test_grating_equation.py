"""The grating equation against directions, a real grating, and itself turned round."""

import numpy as np
import pytest

from pipeline.diffraction.reference import power_direct
from pipeline.optics import geometry
from pipeline.optics.grating_equation import in_plane, period_um, viewing_angle
from pipeline.surface import recipes
from pipeline.surface.recipes.parameters import Blazed

THETA_I = np.radians(75.0)


def test_the_mirror_direction_is_order_zero_of_every_period() -> None:
    np.testing.assert_allclose(viewing_angle(THETA_I, [0.5, 2.5], 0.55, order=0), THETA_I)
    assert np.isinf(period_um(THETA_I, THETA_I, 0.55))
    wi, wr = in_plane(THETA_I, 0.7, THETA_I)
    np.testing.assert_allclose(geometry.uvw(wi, wr)[:2], 0.0, atol=1e-15)


@pytest.mark.parametrize("order", [1, 2, -3])
def test_both_ways_undo_each_other(order: int) -> None:
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
def test_order_m_stands_at_minus_m_over_a_along_the_light(azimuth_deg: float) -> None:
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
