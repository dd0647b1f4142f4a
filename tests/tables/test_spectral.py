"""The spectral form of a table, which answers single wavelengths."""

import numpy as np

from pipeline.diffraction import power_spectrum
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.reference import power_direct
from pipeline.tables.polar import spectral
from tests.diffraction.fields import SIGMA, power_spectrum_of, rough


def test_the_spectral_form_agrees_with_sums_over_samples() -> None:
    """Between the nodes in every coordinate; errors are relative to the local value and the median of the speckle."""
    field = rough(height=0.08)
    power = power_spectrum_of(field, Azimuths(1536), spacing=power_spectrum.SPACING_OF_A_LINE)
    table = spectral.build(power)
    rng = np.random.default_rng(6)
    rho, phi, share = rng.uniform(0.05, 1.9, 60), rng.uniform(-np.pi, np.pi, 60), rng.uniform(0.1, 1.0, 60)
    uvw = np.stack([rho * np.cos(phi), rho * np.sin(phi), -share * np.sqrt(4.0 - rho**2)], axis=-1)
    wavelengths = np.array([380.0, 455.5, 633.0, 780.0])
    exact = np.stack([np.nan_to_num(power_direct(field, SIGMA, uvw, nm)) for nm in wavelengths], axis=-1)
    found = spectral.look_up(table, uvw, wavelengths)
    error = np.abs(found - exact) / (exact + np.median(exact))
    assert np.percentile(error, 90) < 2e-3
    assert error.max() < 3e-2


def test_the_spectral_form_is_nan_outside_the_power_spectrum() -> None:
    table = spectral.build(power_spectrum_of(rough(), Azimuths(64), 500.0))
    found = spectral.look_up(table, np.array([[1.9, 0.0, -0.1], [0.1, 0.0, -1.9]]), np.array([400.0, 500.0]))
    np.testing.assert_array_equal(np.isnan(found), [[True, False], [True, False]])
