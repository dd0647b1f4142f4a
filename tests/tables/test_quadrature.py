"""The wavelength quadrature of each ring."""

import numpy as np
import pytest

from pipeline.diffraction.polar_grid import Rings
from pipeline.errors import AccuracyError
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.tables.polar import quadrature

LIGHT = Light()


@pytest.mark.slow
def test_outer_rings_have_more_wavelengths() -> None:
    """Few suffice near the mirror direction, many are needed at the rim; the estimate bounds the measured error."""
    rho, tolerance = Rings(40, 0.1).rho(), 1e-3
    light = Radiometry(LIGHT, Material(normalisation="relative"), 16.25).integrand
    rules = quadrature.choose(light, rho, 16.25, tolerance)
    assert np.all(np.diff(rules.count) >= 0)
    assert rules.count[0] <= 41
    assert rules.count[-1] >= 201
    # independent waves in the window, as in speckle
    rng = np.random.default_rng(5)
    x, exact = rng.normal(0.0, 16.25 / np.sqrt(2.0), 4000), light(0.05)
    for ring in (5, 20, 39):
        chosen = slice(rules.first[ring], rules.first[ring] + rules.count[ring])

        def integrals(lambda_um: np.ndarray, weights: np.ndarray, rho_of_ring: float = rho[ring]) -> np.ndarray:
            return np.exp(2j * np.pi * np.outer(x, rho_of_ring / lambda_um)) @ weights[:, 1]

        found = integrals(rules.lambda_um[chosen], rules.weights[chosen])
        error = found - integrals(1e-3 * exact.lambda_nm, exact.weights)
        assert np.sqrt(np.mean(np.abs(error) ** 2)) < 2.0 * tolerance


def test_every_ring_integrates_white_exactly() -> None:
    """A step of 20 nm alone would err by 1 % in Z."""
    light = Radiometry(LIGHT, Material(normalisation="relative"), 16.25).integrand
    rules = quadrature.choose(light, Rings(40, 0.1).rho(), 16.25, 1e-3)
    white = light(0.05).weights.sum(axis=0)
    for first, count in zip(rules.first, rules.count, strict=True):
        np.testing.assert_allclose(rules.weights[first : first + count].sum(axis=0), white, rtol=1e-4)


def test_a_laser_line_has_one_wavelength() -> None:
    light = Light(illuminant=LaserLine(lambda_nm=532.0))
    rules = quadrature.choose(Radiometry(light, Material(), 16.25).integrand, np.arange(3.0), 16.25, 1e-3)
    np.testing.assert_array_equal(rules.lambda_um, [0.532])
    np.testing.assert_array_equal(rules.count, [1, 1, 1])


def test_a_window_too_wide_for_the_finest_step_is_refused() -> None:
    with pytest.raises(AccuracyError, match="steps finer than"):
        quadrature.choose(Radiometry(LIGHT, Material(), 300.0).integrand, np.array([2.0]), 300.0, 1e-4)
