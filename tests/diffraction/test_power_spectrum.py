"""The polar power spectrum E(r, phi, s) against sums over samples."""

import numpy as np
import pytest

from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.reference import power_direct
from tests.diffraction.fields import SIGMA, power_spectrum_of, rough


@pytest.mark.parametrize("height", [0.0, 0.1, 0.6])
def test_every_node_equals_the_sum_over_samples(height: float) -> None:
    """In both half turns, for one vector of terms and for several; 0 beyond the Nyquist limits."""
    field, azimuths = rough(height=height), Azimuths(64, 0.6, 0.3)
    power = power_spectrum_of(field, azimuths)
    rng = np.random.default_rng(0)
    tile, ring, node, lane = (rng.integers(n, size=150) for n in power.values.shape)
    r, phi = power.radius_per_um[ring], azimuths.phi()[16 * tile + lane]
    # at 1 um, (u, v) is the frequency and |w| = s / (2 pi)
    uvw = np.stack([r * np.cos(phi), r * np.sin(phi), -power.s_per_um[node] / (2.0 * np.pi)], axis=-1)
    expected = power_direct(field, SIGMA, uvw, 1000.0)
    found = power.values[tile, ring, node, lane]
    unknown = np.isnan(expected)
    assert np.all(found[unknown] == 0.0)
    level = np.mean(expected[~unknown])
    np.testing.assert_allclose(found[~unknown], expected[~unknown], rtol=1e-4, atol=2e-4 * level)


def test_e_is_zero_beyond_the_nyquist_limit() -> None:
    field = rough(pitch=(0.2, 0.2))
    power = power_spectrum_of(field, Azimuths(32))
    r, phi = power.radius_per_um, power.azimuths.phi()[0]
    assert phi == 0.0
    np.testing.assert_array_equal(power.values[0, :, :, 0].max(axis=1) == 0.0, r > 2.5)


def test_thinned_azimuths_equal_those_of_a_coarser_grid() -> None:
    field = rough()
    fine, coarse = (power_spectrum_of(field, Azimuths(n, 0.7, 0.1)) for n in (128, 64))
    thinned = fine.thinned(2)
    assert thinned.azimuths == coarse.azimuths
    np.testing.assert_allclose(thinned.values, coarse.values, rtol=1e-4, atol=1e-7)
