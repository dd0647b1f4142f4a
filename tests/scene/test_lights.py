"""Lights as parts of the sphere: what is drawn lies in them, and lattices cover them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.optics import geometry
from pipeline.scene.lights import SUN_DIAMETER_DEG
from pipeline.scene.patches import SphericalPatch, cap
from tests.scene.scenes import ROWS, latlong, scene, write_environment

EXTENDED: list[dict[str, Any]] = [
    {"kind": "cone", "theta_deg": 30.0, "phi_deg": 200.0, "diameter_deg": 20.0},
    {"kind": "sun", "theta_deg": 60.0, "phi_deg": -50.0},
    {"kind": "range", "theta_deg": [20.0, 50.0], "phi_deg": [300.0, 400.0]},
    {"kind": "range", "theta_deg": [0.0, 90.0]},
]


@pytest.mark.parametrize("entry", EXTENDED)
@pytest.mark.parametrize("spacing", [0.002, 0.03, 1.0])
def test_every_direction_of_a_light_is_near_its_lattice(entry: dict[str, Any], spacing: float) -> None:
    """Cells with sides of h have no direction farther than h / sqrt(2) from a middle; powers sum to the light's."""
    light = scene(lights=[{**entry, "power": 3.0}]).lights[0]
    if light.solid_angle / spacing**2 > 1e5:
        pytest.skip("a lattice that nobody makes")
    middles, powers = light.lattice(spacing)
    drawn = light.draw(np.random.default_rng(5), 300)
    nearest = np.min(np.linalg.norm(drawn[:, None] - middles[None], axis=2), axis=1)
    assert nearest.max() <= spacing / np.sqrt(2.0)
    assert powers.sum() == pytest.approx(3.0, rel=1e-12)
    assert all(light.holds(one) for one in drawn)


@pytest.mark.parametrize("entry", EXTENDED)
def test_directions_are_drawn_uniformly_over_the_solid_angle(entry: dict[str, Any]) -> None:
    """The mean of what is drawn is the mean of a fine lattice, weighted by solid angle."""
    light = scene(lights=[entry]).lights[0]
    middles, powers = light.lattice(0.05 * np.sqrt(light.solid_angle))
    drawn = light.draw(np.random.default_rng(6), 40000)
    allowed = 5.0 * drawn.std(axis=0) / np.sqrt(len(drawn)) + 2e-3 * np.sqrt(light.solid_angle)
    assert np.all(np.abs(drawn.mean(axis=0) - powers @ middles / powers.sum()) <= allowed)


def test_the_sun_is_seen_under_half_a_degree() -> None:
    sun = scene(lights=[{"kind": "sun", "theta_deg": 30.0}]).lights[0]
    drawn = sun.draw(np.random.default_rng(1), 5000)
    apart = np.degrees(np.arccos(np.clip(drawn @ geometry.direction(np.radians(30.0), 0.0), -1.0, 1.0)))
    assert apart.max() == pytest.approx(0.5 * SUN_DIAMETER_DEG, rel=1e-3)
    assert sun.solid_angle == pytest.approx(6.72e-5, rel=1e-3)


def test_a_cap_of_half_the_sphere_has_its_solid_angle() -> None:
    patch = cap(geometry.direction(0.4, 0.7), 0.5 * np.pi)
    _, areas = patch.lattice(0.1)
    assert patch.solid_angle == pytest.approx(2.0 * np.pi)
    assert areas.sum() == pytest.approx(2.0 * np.pi)
    assert SphericalPatch((0.0, np.pi)).solid_angle == pytest.approx(4.0 * np.pi)


def test_a_lamp_in_an_environment_is_a_bright_direction(tmp_path: Path) -> None:
    """Its place follows OpenEXR's latitude and longitude; the rest of the map is the remainder: nothing is lost."""
    path = write_environment(tmp_path / "sky.exr", latlong())
    light = scene(lights=[{"kind": "environment", "path": path, "power": 2.0}]).lights[0]
    (lamp,) = light.map.bright
    assert np.linalg.norm(lamp.centre - geometry.direction(np.pi / 4, np.pi / 2)) < 1e-3
    edges = np.cos(np.pi * np.arange(ROWS + 1) / ROWS)
    power = latlong() * (edges[:-1] - edges[1:])[:, None]
    assert lamp.power == pytest.approx(power[latlong() == 1000.0].sum() / power.sum(), rel=1e-6)
    assert lamp.power + light.map.remainder.sum() == pytest.approx(1.0)
    for spacing in (0.05, 0.5):
        middles, powers = light.lattice(spacing)
        drawn = light.draw(np.random.default_rng(2), 40000)
        assert powers.sum() == pytest.approx(2.0)
        mean = powers @ middles / powers.sum()
        assert np.all(np.abs(drawn.mean(axis=0) - mean) <= 5.0 / np.sqrt(len(drawn)) + 0.1 * spacing)


def test_a_lamp_across_the_edge_of_a_map_is_one(tmp_path: Path) -> None:
    moved = np.roll(latlong(), -ROWS // 2, axis=1)
    path = write_environment(tmp_path / "sky.exr", moved, "Y")
    (lamp,) = scene(lights=[{"kind": "environment", "path": path}]).lights[0].map.bright
    assert np.linalg.norm(lamp.centre - geometry.direction(np.pi / 4, np.pi)) < 1e-3
