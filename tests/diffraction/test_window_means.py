"""Means over several positions of the coherence window: of the reference and of the power spectrum."""

import numpy as np
import pytest

from pipeline.diffraction import dft_stack, expansion, power_spectrum, reference
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.reference import Reference, power_direct, xyz_direct
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


def fields_of(field: HeightField, places: windows.Places) -> list[HeightField]:
    """The field with each position of the window in the middle."""
    return [windows.around(field, place, field.shape) for place in places.pairs()]


def test_the_reference_is_the_mean_over_windows() -> None:
    field = rough(100, 60)
    places = windows.places(field.extent, Coherence(sigma_um=SIGMA))
    light = Light(illuminant=LaserLine(lambda_nm=550.0))
    wi, wr = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
    each = [xyz_direct(place, SIGMA, light, Material(), wi, wr) for place in fields_of(field, places)]
    found = Reference(field, SIGMA, 550.0, places=places).xyz(light, Material(), wi, wr)
    assert places.count == 2
    assert abs(each[0][0, 1] / each[1][0, 1] - 1.0) > 0.01
    np.testing.assert_allclose(found, np.mean(each, axis=0), rtol=1e-6)


# a stack of one window of 1.5 um has 216 x 216 samples
@pytest.mark.parametrize(
    ("nx", "ny", "count"), [(150, 150, 9), (133, 60, 3), (104, 151, 6), (221, 230, 9), (60, 80, 1)]
)
@pytest.mark.parametrize(("held_bytes", "widest"), [(2**29, 30), (0, 30), (0, 0)], ids=["held", "in parts", "each"])
def test_the_reference_agrees_with_sums_over_samples_at_every_window(
    monkeypatch: pytest.MonkeyPatch, nx: int, ny: int, count: int, held_bytes: int, widest: float
) -> None:
    """A stack in parts of its terms, one for all windows and one for each change nothing."""
    monkeypatch.setattr(reference, "_HELD_BYTES", held_bytes)
    monkeypatch.setattr(dft_stack, "_WIDEST_SIGMAS", widest)
    field = rough(nx, ny)
    places = windows.places(field.extent, Coherence(sigma_um=SIGMA))
    assert places.count == count
    uvw = np.array([[0.1, -0.7, -1.6], [-0.4, 0.3, -1.3], [0.4, -0.3, -1.1], [0.0, 0.0, -1.9], [1.2, 0.8, -0.9]])
    nm = np.array([380.0, 470.0, 500.0, 610.0, 780.0])
    sums = [[power_direct(each, SIGMA, uvw, one) for one in nm] for each in fields_of(field, places)]
    found = Reference(field, SIGMA, 380.0, places=places).power(uvw, nm)
    np.testing.assert_allclose(found, np.mean(sums, axis=0).T, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("nx", "ny", "height"), [(150, 133, 0.1), (104, 151, 0.6), (151, 66, 0.1)])
def test_e_of_one_stack_equals_sums_over_samples_at_every_window(nx: int, ny: int, height: float) -> None:
    """In both half turns, for one vector of terms and for several; 0 beyond the Nyquist limits."""
    heights = np.random.default_rng(2).uniform(-height, height, (ny, nx))
    field, azimuths = HeightField(heights, (0.1, 0.11)), Azimuths(64, 0.6, 0.3)
    places = windows.places(field.extent, Coherence(sigma_um=SIGMA))
    z = expansion.largest_phase(field.half_range_um, 380.0)
    terms, nodes = (expansion.chebyshev_order(z, tolerance) + 1 for tolerance in (1e-6, 1e-5))
    radius = power_spectrum.radii(SIGMA, 2e3 / 380.0)
    stack = power_spectrum.chebyshev_stack(field, SIGMA, radius[-1], terms, 1e-6, whole=True)
    power = power_spectrum.build(stack, azimuths, radius, 380.0, nodes, places)
    rng = np.random.default_rng(0)
    tile, ring, node, lane = (rng.integers(n, size=100) for n in power.values.shape)
    r, phi = power.radius_per_um[ring], azimuths.phi()[16 * tile + lane]
    uvw = np.stack([r * np.cos(phi), r * np.sin(phi), -power.s_per_um[node] / (2.0 * np.pi)], axis=-1)
    expected = np.mean([power_direct(each, SIGMA, uvw, 1000.0) for each in fields_of(field, places)], axis=0)
    found, unknown = power.values[tile, ring, node, lane], np.isnan(expected)
    assert unknown.any()
    assert np.all(found[unknown] == 0.0)
    level = np.mean(expected[~unknown])
    np.testing.assert_allclose(found[~unknown], expected[~unknown], rtol=1e-4, atol=2e-4 * level)


def test_e_of_a_stack_for_each_window_is_that_of_one_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    field, layout, budget = rough(150, 104), PolarLayout(rings=20, azimuths=64), plan.Budget(0.5, 7500.0)
    places = windows.places(field.extent, Coherence(sigma_um=SIGMA))
    found = []
    for widest in (30.0, 0.0):
        monkeypatch.setattr(dft_stack, "_WIDEST_SIGMAS", widest)
        trial = plan.start(field, places, SIGMA, Light(), None, budget, layout)
        found.append(trial.mean_power_spectrum(Azimuths(64)).values)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-3, atol=1e-4 * np.mean(found[0]))


def test_e_is_the_mean_over_windows_and_its_speckle_has_less_contrast() -> None:
    field = rough(150, 150)
    layout, budget = PolarLayout(rings=20, azimuths=256), plan.Budget(0.5, 7500.0)

    def mean(kind):
        places = windows.places(field.extent, Coherence(sigma_um=SIGMA, windows=kind))
        trial = plan.start(field, places, SIGMA, Light(), None, budget, layout)
        return trial.mean_power_spectrum(plan.choose(trial, None, budget, layout).azimuths)

    many, one = mean("auto"), mean("centre")
    r, phi = many.radius_per_um[40], many.azimuths.phi()[5]
    uvw = np.array([[r * np.cos(phi), r * np.sin(phi), -many.s_per_um[3] / (2.0 * np.pi)]])
    places = fields_of(field, windows.places(field.extent, Coherence(sigma_um=SIGMA)))
    assert len(places) == 9
    direct = np.mean([power_direct(place, SIGMA, uvw, 1000.0) for place in places])
    assert many.values[0, 40, 3, 5] == pytest.approx(direct, rel=2e-3)
    single, averaged = power_spectrum.speckle_contrast(one), power_spectrum.speckle_contrast(many)
    # fully developed speckle has a contrast of 1; neighbours among the nine windows overlap by half a width
    assert single == pytest.approx(1.0, abs=0.15)
    assert 0.08 < averaged < 0.35
