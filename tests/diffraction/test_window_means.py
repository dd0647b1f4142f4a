"""Means over several positions of the coherence window: of the reference and of the power spectrum."""

import numpy as np
import pytest

from pipeline.diffraction import power_spectrum
from pipeline.diffraction.reference import MeanReference, power_direct, xyz_direct
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan

SIGMA = 1.5


def rough(nx: int, ny: int) -> HeightField:
    """White noise on `nx` x `ny` samples."""
    return HeightField(np.random.default_rng(1).uniform(-0.08, 0.08, (ny, nx)), (0.1, 0.1))


def test_the_reference_is_the_mean_over_windows() -> None:
    places = windows.places(rough(100, 60), Coherence(sigma_um=SIGMA))
    light = Light(illuminant=LaserLine(lambda_nm=550.0))
    wi, wr = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
    each = [xyz_direct(place, SIGMA, light, Material(), wi, wr) for place in places]
    found = MeanReference(places, SIGMA, 550.0).xyz(light, Material(), wi, wr)
    assert len(places) == 2
    assert abs(each[0][0, 1] / each[1][0, 1] - 1.0) > 0.01
    np.testing.assert_allclose(found, np.mean(each, axis=0), rtol=1e-6)


def test_e_is_the_mean_over_windows_and_its_speckle_has_less_contrast() -> None:
    field = rough(150, 150)
    layout, budget = PolarLayout(rings=20, azimuths=256), plan.Budget(0.5, 7500.0)

    def mean(kind):
        fields = windows.places(field, Coherence(sigma_um=SIGMA, windows=kind))
        trial = plan.start(fields, SIGMA, Light(), None, budget, layout)
        return trial.mean_power_spectrum(plan.choose(trial, None, budget, layout).azimuths, fields[1:])

    many, one = mean("auto"), mean("centre")
    r, phi = many.radius_per_um[40], many.azimuths.phi()[5]
    uvw = np.array([[r * np.cos(phi), r * np.sin(phi), -many.s_per_um[3] / (2.0 * np.pi)]])
    places = windows.places(field, Coherence(sigma_um=SIGMA))
    assert len(places) == 9
    direct = np.mean([power_direct(place, SIGMA, uvw, 1000.0) for place in places])
    assert many.values[0, 40, 3, 5] == pytest.approx(direct, rel=2e-3)
    single, averaged = power_spectrum.speckle_contrast(one), power_spectrum.speckle_contrast(many)
    # fully developed speckle has a contrast of 1; neighbours among the nine windows overlap by half a width
    assert single == pytest.approx(1.0, abs=0.15)
    assert 0.08 < averaged < 0.35
