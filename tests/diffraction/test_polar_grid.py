"""The mappings between directions, rings and azimuths."""

import numpy as np
import pytest

from pipeline.diffraction.polar_grid import Azimuths, Rings

GRIDS = [Azimuths(64), Azimuths(96, 0.4, 0.3), Azimuths(32, 0.7, -1.5)]


@pytest.mark.parametrize("azimuths", GRIDS)
def test_azimuth_from_uv_inverts_phi(azimuths: Azimuths) -> None:
    angles = azimuths.phi()
    uv = 0.7 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    apart = (azimuths.azimuth_from_uv(uv) - np.arange(azimuths.count) + 0.5 * azimuths.count) % azimuths.count
    np.testing.assert_allclose(apart, 0.5 * azimuths.count, atol=1e-9)


@pytest.mark.parametrize("azimuths", GRIDS)
def test_half_a_turn_is_half_the_azimuths_for_every_stretch(azimuths: Azimuths) -> None:
    angles, half = azimuths.phi(), azimuths.count // 2
    turned = (angles[half:] - angles[:half]) % (2.0 * np.pi)
    np.testing.assert_allclose(turned, np.pi, atol=1e-12)


def test_stretched_azimuths_are_denser_about_their_axis() -> None:
    angles = Azimuths(128, 0.25, np.radians(30.0)).phi()
    gap = np.abs(np.angle(np.exp(1j * (np.roll(angles, -1) - angles))))
    at_axis, across = (np.argmin(np.abs(np.angle(np.exp(1j * (angles - np.radians(d)))))) for d in (30.0, 120.0))
    assert gap[across] / gap[at_axis] == pytest.approx(16.0, rel=0.1)


def test_rings_extend_from_zero_beyond_what_is_looked_up_and_ring_from_rho_inverts_rho() -> None:
    rings = Rings(50, 0.1, 1.2)
    rho = rings.rho()
    assert (rho[0], rho[-1]) == pytest.approx((0.0, 1.15 * 1.2))
    assert Rings(50, 0.1, 1.9).last == 2.0
    np.testing.assert_allclose(rings.ring_from_rho(rho), np.arange(50), atol=1e-9)
    # evenly spaced near the origin, in a constant ratio at the rim
    assert (rho[2] - rho[1]) / rho[1] == pytest.approx(1.0, rel=0.02)
    assert (rho[-1] / rho[-2]) == pytest.approx(rho[-2] / rho[-3], rel=1e-3)
