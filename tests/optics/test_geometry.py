"""The geometry of light and view: vectors whose lengths and factors are known in closed form."""

import numpy as np
import pytest
from hypothesis import given

from pipeline.optics import geometry
from tests.optics.directions import directions, tilted

NORMAL = np.array([0.0, 0.0, 1.0])


@given(wi=directions(), wr=directions())
def test_uvw_adds_to_zero_with_both_directions(wi, wr):
    """(u, v, w) = -wi - wr, so that w is minus the sum of the cosines and lies in [-2, 0)."""
    uvw = geometry.uvw(wi, wr)
    np.testing.assert_allclose(uvw + wi + wr, 0.0, atol=1e-15)
    assert -2.0 <= uvw[2] < 0.0
    assert uvw[0] ** 2 + uvw[1] ** 2 <= 4.0


@given(wi=directions())
def test_mirror_direction_has_no_lateral_frequency(wi):
    """Light and its mirror direction give u = v = 0: that is where a flat surface's peak is."""
    mirrored = wi * np.array([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(geometry.uvw(wi, mirrored), [0.0, 0.0, -2.0 * wi[2]], atol=1e-15)


@pytest.mark.parametrize(
    ("theta_deg", "phi_deg", "expected"),
    [
        (0.0, 77.0, (0.0, 0.0, 1.0)),
        (30.0, 0.0, (0.5, 0.0, np.sqrt(0.75))),
        (90.0, 90.0, (0.0, 1.0, 0.0)),
        (45.0, 180.0, (-np.sqrt(0.5), 0.0, np.sqrt(0.5))),
    ],
)
def test_azimuth_turns_from_x_towards_y(theta_deg, phi_deg, expected):
    """Polar angles are from the normal, azimuths from +x towards +y."""
    np.testing.assert_allclose(tilted(theta_deg, phi_deg), expected, atol=1e-15)


def test_directions_broadcast():
    """A column of polar angles and a row of azimuths make a grid of unit vectors."""
    grid = geometry.direction(np.linspace(0.0, 1.5, 4)[:, None], np.linspace(0.0, 6.0, 5))
    assert grid.shape == (4, 5, 3)
    np.testing.assert_allclose(np.linalg.norm(grid, axis=-1), 1.0, rtol=1e-15)


@given(wr=directions())
def test_half_angle_is_half_the_angle_between(wr):
    """Seen from light along the normal, the half angle is half the view's polar angle."""
    expected = np.cos(0.5 * np.arctan2(np.hypot(wr[0], wr[1]), wr[2]))
    assert geometry.cos_half(NORMAL, wr) == pytest.approx(expected, rel=1e-14)


@given(wi=directions(), wr=directions())
def test_half_angle_is_the_half_vectors(wi, wr):
    """The half vector makes the same angle with light and view, and `cos_half` is its cosine."""
    half = (wi + wr) / np.linalg.norm(wi + wr)
    assert geometry.cos_half(wi, wr) == pytest.approx(half @ wi, rel=1e-10)
    assert geometry.cos_half(wi, wr) == pytest.approx(half @ wr, rel=1e-10)


def test_obliquity_is_4_at_normal_incidence():
    """(1 + 1)^2 / (1 * 1) = 4."""
    assert geometry.obliquity(NORMAL, NORMAL) == 4.0


@pytest.mark.parametrize("theta_deg", [10.0, 40.0, 75.0])
def test_obliquity_over_w_squared_is_1_in_the_mirror_direction(theta_deg):
    """G / w^2 = (2 cos^2)^2 / (cos^2 * 4 cos^2) = 1: a mirror reflects alike at every angle."""
    wi, wr = tilted(theta_deg), tilted(theta_deg, 180.0)
    w = geometry.uvw(wi, wr)[2]
    assert geometry.obliquity(wi, wr) / w**2 == pytest.approx(1.0, rel=1e-13)


@given(wi=directions(), wr=directions())
def test_factors_are_reciprocal(wi, wr):
    """Exchanging light and view changes neither the obliquity, the half angle nor the shadowing."""
    for factor in (geometry.obliquity, geometry.v_cavity, geometry.cos_half):
        assert factor(wi, wr) == pytest.approx(factor(wr, wi), rel=1e-14)


@given(wi=directions(), wr=directions())
def test_v_cavity_is_a_share(wi, wr):
    """Grooves hide some of the light or none."""
    assert 0.0 < geometry.v_cavity(wi, wr) <= 1.0


def test_v_cavity_hides_nothing_at_normal_incidence():
    """From above, no wall of a groove hides another."""
    assert geometry.v_cavity(NORMAL, NORMAL) == 1.0


@pytest.mark.parametrize("theta_deg", [20.0, 59.0, 61.0, 75.0, 88.0])
def test_v_cavity_by_hand(theta_deg):
    """Light along the normal: 2 (n.h)(n.wr) / (wr.h) = 2 cos t, once that is below 1 (beyond 60 degrees)."""
    expected = min(1.0, 2.0 * np.cos(np.radians(theta_deg)))
    assert geometry.v_cavity(NORMAL, tilted(theta_deg, 33.0)) == pytest.approx(expected, rel=1e-13)


def test_v_cavity_is_finite_where_light_and_view_graze_from_opposite_sides():
    """1 + wi.wr is zero there: no half vector, and no warning."""
    grazing = np.nextafter(0.5 * np.pi, 0.0)
    wi, wr = geometry.direction(grazing, 0.0), geometry.direction(grazing, np.pi)
    assert 0.0 <= geometry.v_cavity(wi, wr) <= 1.0
