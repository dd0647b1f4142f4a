"""Pairs of a scene: reproducible, in it, with the density of what it shows."""

from typing import Any

import numpy as np
import pytest

from pipeline.optics import geometry
from pipeline.scene.pairs import border_pairs, flank_pairs, random_pairs
from pipeline.scene.visited import rho_max, visited
from tests.scene.scenes import scene

FLAT: list[dict[str, Any]] = [
    {"lights": [{"theta_deg": 30.0, "phi_deg": 90.0}], "views": {"theta_max_deg": 40.0}},
    {"lights": [{"theta_deg": 0.0}, {"kind": "sun", "theta_deg": 50.0}], "views": {"phi_deg": [-30.0, 60.0]}},
    {
        "lights": [{"kind": "range", "theta_deg": [0.0, 60.0]}],
        "views": {"theta_min_deg": 20.0, "theta_max_deg": 50.0},
    },
    {
        "lights": [{"kind": "cone", "theta_deg": 20.0, "diameter_deg": 10.0}],
        "cameras": [{"position": [100.0, -50.0, 200.0], "fov_deg": 20.0, "size": [80, 60]}],
        "sample": [50.0, 30.0],
    },
]


@pytest.mark.parametrize("keys", FLAT)
@pytest.mark.parametrize("count", [1, 7, 5000])
def test_pairs_are_reproducible_unit_vectors_above_the_horizon(keys: dict[str, Any], count: int) -> None:
    found, again, other = (random_pairs(scene(**keys), count, seed) for seed in (3, 3, 4))
    for one, two, three in zip(found, again, other, strict=True):
        assert one.shape == (count, 3)
        np.testing.assert_array_equal(one, two)
        np.testing.assert_allclose(np.linalg.norm(one, axis=1), 1.0, rtol=1e-12)
        assert one[:, 2].min() > 0.0
        assert one.shape == three.shape
    assert not np.array_equal(found[1], other[1])


@pytest.mark.parametrize("keys", FLAT)
def test_every_pair_is_within_the_gap_of_a_visited_direction(keys: dict[str, Any]) -> None:
    """The lattice misses nothing that is drawn, at any density, and |(u, v)| keeps its bound."""
    made = scene(**keys)
    uvw = geometry.uvw(*random_pairs(made, 500, 11))
    for count in (300, 20000):
        found = visited(made, count)
        apart = np.linalg.norm(uvw[:, None] - found.uvw[None], axis=2)
        assert np.all(np.any(apart <= found.gap * (1.0 + 1e-9), axis=1))
        assert found.weight.sum() == pytest.approx(1.0)
        assert found.uvw.shape == found.wi.shape == (len(found.gap), 3)
    assert np.hypot(uvw[:, 0], uvw[:, 1]).max() <= rho_max(made)


def test_views_and_lights_stay_in_their_ranges() -> None:
    wi, wr = random_pairs(scene(**FLAT[2]), 4000, 1)
    theta = np.degrees(np.arccos(wr[:, 2]))
    assert 20.0 <= theta.min() < 20.2
    assert 49.8 < theta.max() <= 50.0
    assert np.degrees(np.arccos(wi[:, 2])).max() <= 60.0
    turned = np.degrees(np.arctan2(*random_pairs(scene(**FLAT[1]), 4000, 1)[1][:, 1::-1].T))
    assert -30.0 <= turned.min() < -29.0
    assert 59.0 < turned.max() <= 60.0


def test_lights_are_drawn_by_their_power() -> None:
    wi, _ = random_pairs(scene(lights=[{"theta_deg": 10.0}, {"theta_deg": 20.0, "power": 3.0}]), 10000, 2)
    assert np.mean(wi[:, 2] < np.cos(np.radians(15.0))) == pytest.approx(0.75, abs=0.02)


def test_a_camera_sees_a_flat_sample_in_perspective() -> None:
    """A pixel's view points from its place on the sample to the camera."""
    wi, wr = random_pairs(scene(**FLAT[3]), 2000, 5)
    place = np.array([100.0, -50.0, 200.0]) - 200.0 / wr[:, 2:] * wr
    np.testing.assert_allclose(place[:, 2], 0.0, atol=1e-9)
    assert 24.0 < np.abs(place[:, 0]).max() <= 25.0
    assert 14.0 < np.abs(place[:, 1]).max() <= 15.0
    assert np.degrees(np.arccos(wi @ geometry.direction(np.radians(20.0), 0.0))).max() <= 5.0


def test_flank_pairs_are_those_that_the_scene_sees() -> None:
    rho, phi = np.full(200, 0.02), np.linspace(0.0, 6.0, 200)
    mirror = {"position": [0.0, 0.0, 100.0], "up": [0.0, 1.0, 0.0], "size": [64, 64], "fov_deg": 20.0}
    seen = {"lights": [{"theta_deg": 0.0}], "cameras": [mirror], "sample": [50.0, 50.0]}
    for keys, share in (
        (seen, 1.0),
        (FLAT[3], 0.0),
        (FLAT[0], 1.0),
        ({**FLAT[0], "views": {"theta_max_deg": 20.0}}, 0.0),
    ):
        wi, wr = flank_pairs(scene(**keys), rho, phi, 7)
        seen_here = np.isfinite(wr[:, 2])
        assert seen_here.mean() == share
        uvw = geometry.uvw(wi[seen_here], wr[seen_here])
        np.testing.assert_allclose(np.hypot(uvw[:, 0], uvw[:, 1]), 0.02, rtol=1e-9)


@pytest.mark.parametrize("keys", [FLAT[2], {"lights": [{"kind": "range", "theta_deg": [0, 60]}]}])
def test_lights_of_some_extent_have_border_pairs_all_around(keys: dict[str, Any]) -> None:
    made = scene(**keys)
    uvw = geometry.uvw(*border_pairs(made, 400, 4))
    assert len(uvw) >= 250
    assert np.hypot(uvw[:, 0], uvw[:, 1]).min() > rho_max(made) - 0.2
    assert np.ptp(np.histogram(np.arctan2(uvw[:, 1], uvw[:, 0]), 8)[0]) < 60


def test_border_pairs_lie_at_the_edge_of_what_is_visited() -> None:
    """Under one light the border is that of the disc of views about -wi; the whole hemisphere has none."""
    made = scene(**FLAT[0])
    wi, wr = border_pairs(made, 300, 4)
    assert len(wi) == 300
    assert np.linalg.norm(wr[:, :2], axis=1).min() > np.sin(np.radians(40.0)) - 0.12
    assert len(border_pairs(None, 300, 4)[0]) == 0
