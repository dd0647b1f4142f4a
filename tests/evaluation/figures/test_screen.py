"""The screen of [D14] table 2: where its pixels look, what they average, its laser, and its benchmark."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference, xyz_direct
from pipeline.evaluation.figures.screen import LIGHT, Screen, experiment, screen_bands
from pipeline.optics import geometry
from pipeline.optics.csv_columns import shipped
from pipeline.optics.light import illuminant_at, trapezoid
from pipeline.surface.heightfield import HeightField
from pipeline.surface.source import SurfaceSource

SCREEN = Screen(LIGHT, 5)


def config() -> Config:
    recipe = {"kind": "elaphe", "size_um": 20.0, "pitch_um": 0.1}
    return Config(name="skin", surface=SurfaceSource.model_validate({"recipe": recipe}))


def test_the_middle_is_the_mirror_direction_and_the_screen_is_parallel_to_the_beam() -> None:
    wi, wr = SCREEN.directions()
    np.testing.assert_allclose(geometry.uvw(wi, wr)[12, :2], 0.0, atol=1e-15)
    mirror = wr[12]
    place = 100.0 * wr / (wr @ mirror)[:, None]
    # one plane, 100 mm along the mirror direction; the beam lies in it, as they meet at a right angle
    np.testing.assert_allclose(place @ mirror, 100.0)
    np.testing.assert_allclose((place - 100.0 * mirror) @ mirror, 0.0, atol=1e-12)
    assert wi[0] @ mirror == pytest.approx(0.0, abs=1e-15)


def test_pixels_stand_where_the_screen_has_them() -> None:
    """+x away from the normal, +y up, first row at the top; a pixel's middle from the spot in mm."""
    _, wr = SCREEN.directions()
    mirror = wr[12]
    offset = (100.0 * wr / (wr @ mirror)[:, None] - 100.0 * mirror).reshape(5, 5, 3)
    # the light comes from -x, so the mirror direction leans towards +x and the sample's +y is the screen's
    right, up = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5)]), np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(SCREEN.axis_mm(), [-80.0, -40.0, 0.0, 40.0, 80.0])
    np.testing.assert_allclose(offset @ right, np.tile(SCREEN.axis_mm(), (5, 1)), atol=1e-12)
    np.testing.assert_allclose(offset @ up, np.tile(-SCREEN.axis_mm()[:, None], (1, 5)), atol=1e-12)


def test_all_of_it_is_above_the_horizon_which_its_edge_touches() -> None:
    _, wr = Screen(LIGHT, 101).directions()
    assert wr[:, 2].min() > 0.0
    assert wr[:, 2].min() < 0.01


def test_a_pixel_averages_the_directions_within_it() -> None:
    """XYZ linear over the screen keep their middles; a curved one gains the variance within a pixel."""
    one, nine = SCREEN, replace(SCREEN, samples=3)

    def across(wi: np.ndarray, wr: np.ndarray) -> np.ndarray:
        mirror = np.array([-wi[0, 0], -wi[0, 1], wi[0, 2]])
        x = 100.0 * (wr / (wr @ mirror)[:, None])[:, 1]
        return np.stack([np.ones_like(x), x, x**2], axis=-1)

    plain, averaged = one.show(across), nine.show(across)
    np.testing.assert_allclose(averaged[..., :2], plain[..., :2], atol=1e-10)
    # three points 40/3 mm apart: variance 2/3 (40/3)^2
    np.testing.assert_allclose(averaged[..., 2] - plain[..., 2], 2.0 / 3.0 * (40.0 / 3.0) ** 2)


def test_the_benchmark_is_the_window_in_space() -> None:
    """Gold, laser and geometry at once: the fast reference and the sum over samples, at every nanometre."""
    laser = experiment(config())
    heights = np.random.default_rng(5).uniform(-0.1, 0.1, (48, 60))
    field = HeightField(heights, (0.12, 0.1))
    wi, wr = (d[[0, 7, 12, 18]] for d in SCREEN.directions())
    found = Reference(field, 1.2, 380.0).xyz(laser.light, laser.material, wi, wr)
    np.testing.assert_allclose(found, xyz_direct(field, 1.2, laser.light, laser.material, wi, wr), rtol=1e-8)


def test_a_gold_mirror_shows_the_laser_in_its_spot_alone() -> None:
    """|P(0)|^2 = 1 and wi.wr = 0, so Y = R / R0 G cos ti / w^2 = R / R0 (1 / c^2) c / (2 c)^2, c = 1 / sqrt 2."""
    laser = experiment(config())
    field = HeightField(np.zeros((100, 100)), (0.1, 0.1))
    reference = Reference(field, laser.coherence.sigma_um, 380.0)
    shown = SCREEN.show(lambda wi, wr: reference.xyz(laser.light, laser.material, wi, wr))
    spot = shown[2, 2, 1]
    # a V-cavity hides nothing at 45 deg, and gold reflects there as at normal incidence to 2 %
    assert spot == pytest.approx(np.sqrt(0.5), rel=0.02)
    others = np.delete(shown[..., 1].ravel(), 12)
    assert others.max() < 1e-12 * spot
    # gold and this laser are yellow: more X than Y than Z
    assert shown[2, 2, 0] > spot > shown[2, 2, 2]


def test_the_laser_is_dark_below_its_onset_and_rises_above() -> None:
    path = str(files("pipeline.optics").joinpath("data", "supercontinuum.csv"))
    nm = np.arange(380.0, 781.0)
    power = illuminant_at(path, nm)
    assert np.all(power[nm <= 435] == 0.0)
    assert power[nm == 450] == pytest.approx(0.5 * 0.55, rel=0.05)
    assert np.all(np.diff(power) >= 0.0)
    assert power[-1] == 1.0
    table = shipped("supercontinuum.csv", 2)
    assert (table[0, 0], table[-1, 0]) == (380.0, 780.0)
    assert trapezoid(experiment(config()).light, 1.0).weights[:, 1].sum() == pytest.approx(1.0)


def test_bands_rise_again_outwards() -> None:
    axis = np.linspace(-100.0, 100.0, 101)
    falling = np.exp(-np.abs(axis) / 20.0)
    flat = screen_bands(np.tile(falling[:, None], (1, 101)), axis)
    assert (flat.contrast, flat.share) == (0.0, 0.0)
    # a band of three times the light at its place, on one side
    banded = falling.copy()
    banded[np.argmin(np.abs(axis - 40.0))] *= 3.0
    found = screen_bands(np.tile(banded[:, None], (1, 101)), axis)
    before = np.exp(-38.0 / 20.0)
    band = 3.0 * np.exp(-40.0 / 20.0)
    assert found.contrast == pytest.approx(band / before - 1.0)
    light = 2.0 * falling[axis > 8.0].sum() + 2.0 * np.exp(-2.0)
    assert found.share == pytest.approx((band - before) / light)
    np.testing.assert_allclose(found.profile, banded)


def test_the_spot_and_its_vertical_band_are_no_horizontal_band() -> None:
    axis = np.linspace(-100.0, 100.0, 101)
    image = np.tile(np.exp(-np.abs(axis) / 20.0)[:, None], (1, 101))
    image[:, np.abs(axis) < 12.0] += 5.0 * np.cos(axis / 5.0)[:, None] ** 2
    assert screen_bands(image, axis).contrast == 0.0
