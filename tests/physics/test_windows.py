"""Windows on a scan that is larger than one."""

import numpy as np
import pytest

from pipeline.diffraction import power_spectrum
from pipeline.diffraction.reference import MeanReference, power_direct, xyz_direct
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.surface.statistics import measure
from pipeline.tables.planning import plan
from pipeline.tables.polar.layout import PolarLayout

SIGMA = 1.5


def rough(nx: int, ny: int, seed: int = 1) -> HeightField:
    return HeightField(np.random.default_rng(seed).uniform(-0.08, 0.08, (ny, nx)), (0.1, 0.1))


@pytest.mark.parametrize(
    ("nx", "ny", "expected"), [(60, 60, 1), (89, 60, 1), (91, 60, 2), (91, 120, 6), (120, 120, 9), (400, 60, 3)]
)
def test_a_scan_holds_as_many_windows_as_half_a_width_apart_fit(nx: int, ny: int, expected: int) -> None:
    assert len(windows.places(rough(nx, ny), Coherence(sigma_um=SIGMA))) == expected
    assert len(windows.places(rough(nx, ny), Coherence(sigma_um=SIGMA, windows="centre"))) == 1


def test_each_place_is_in_the_middle_and_reaches_over_no_edge() -> None:
    """A mark that every window sees is moved by what the window is moved."""
    field = rough(120, 90)
    heights = field.heights_um.copy()
    heights[45 + 15, 60 - 30] = 9.0
    places = windows.places(HeightField(heights, field.pitch_um), Coherence(sigma_um=SIGMA))
    np.testing.assert_array_equal(places[0].heights_um, np.roll(heights, (15, 0), axis=(0, 1)))
    found = {tuple(int(i) for i in np.argwhere(p.heights_um == 9.0)[0]) for p in places}
    # centres at y = -+1.5 um, x = -3, 0, 3 um: half a width from the edges at least
    assert found == {(60 + dy, 30 + dx) for dy in (15, -15) for dx in (-30, 0, 30)}


def test_e_is_the_mean_over_windows_and_its_speckle_fades() -> None:
    field = rough(150, 150)
    layout, budget = PolarLayout(rings=20, azimuths=256), plan.Budget(0.5, 7500.0)

    def mean(kind):
        fields = windows.places(field, Coherence(sigma_um=SIGMA, windows=kind))
        trial = plan.start(fields, SIGMA, Light(), None, budget, layout)
        return trial.mean_power_spectrum(plan.choose(trial, None, budget, layout).azimuths, fields[1:])

    many, one = mean("auto"), mean("centre")
    r, phi = many.radius_per_um[40], many.azimuths.angles()[5]
    uvw = np.array([[r * np.cos(phi), r * np.sin(phi), -many.s_per_um[3] / (2.0 * np.pi)]])
    places = windows.places(field, Coherence(sigma_um=SIGMA))
    assert len(places) == 9
    direct = np.mean([power_direct(place, SIGMA, uvw, 1000.0) for place in places])
    assert many.values[0, 40, 3, 5] == pytest.approx(direct, rel=2e-3)
    single, averaged = power_spectrum.speckle_contrast(one), power_spectrum.speckle_contrast(many)
    # fully developed speckle has contrast 1; nine windows, two of three neighbours apart by half a width
    assert single == pytest.approx(1.0, abs=0.15)
    assert 0.08 < averaged < 0.35


def test_the_reference_is_the_mean_of_its_windows() -> None:

    places = windows.places(rough(100, 60), Coherence(sigma_um=SIGMA))
    light = Light(illuminant=LaserLine(lambda_nm=550.0))
    wi, wr = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
    each = [xyz_direct(place, SIGMA, light, Material(), wi, wr) for place in places]
    found = MeanReference(places, SIGMA, 550.0).xyz(light, Material(), wi, wr)
    assert len(places) == 2
    assert abs(each[0][0, 1] / each[1][0, 1] - 1.0) > 0.01
    np.testing.assert_allclose(found, np.mean(each, axis=0), rtol=1e-6)


def test_seams_hold_no_energy_of_a_periodic_surface_and_all_of_a_tilt() -> None:
    y, x = np.mgrid[0:64, 0:96] * 0.1
    periodic = np.cos(2.0 * np.pi * x / 3.2) * np.sin(2.0 * np.pi * y / 1.6)
    assert measure(HeightField(periodic, (0.1, 0.1)), SIGMA, 380.0).seam_energy < 0.02
    assert measure(HeightField(0.1 * x, (0.1, 0.1)), SIGMA, 380.0).seam_energy > 0.9
    assert measure(HeightField(0.0 * x, (0.1, 0.1)), SIGMA, 380.0).seam_energy == 0.0
