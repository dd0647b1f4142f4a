"""The polar table: B-splines between texels, its rim, and the lobe of a mirror in closed form."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import spline_filter1d

from kernels import cubic_spline
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import whole
from pipeline.optics.light import Light, trapezoid
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import quadrature
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.spectral_integral import Integrand
from pipeline.tables.polar.table import PolarTable
from tests.diffraction.fields import SIGMA, power_spectrum_of


def test_spline_coefficients_equal_those_of_scipy() -> None:
    rng = np.random.default_rng(1)
    samples = rng.random((40, 4, 64), np.float32)
    found = cubic_spline.coefficients(samples.copy())
    around = spline_filter1d(samples.astype(float), 3, axis=2, mode="grid-wrap")
    # rings continue below the first as the opposite half turn
    both = np.concatenate([np.roll(around[:0:-1], 32, axis=2), around])
    expected = spline_filter1d(both, 3, axis=0, mode="mirror")[39:]
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_a_thinned_rings_coefficients_are_those_of_the_spline_through_fewer_samples() -> None:
    rng = np.random.default_rng(4)
    samples, every = rng.random((30, 2, 256), np.float32), np.repeat([4, 2, 1], 10)
    across = cubic_spline.coefficients(samples.copy())
    around = (np.roll(across, 1, axis=2) + 4.0 * across + np.roll(across, -1, axis=2)) / 6.0
    place = np.linspace(0.0, 256.0, 777)
    for ring, found in enumerate(cubic_spline.coefficients(samples.copy(), every)):
        knots = np.append(around[ring, 0, :: every[ring]], around[ring, 0, 0])
        through = CubicSpline(np.arange(0, 257, every[ring]), knots, bc_type="periodic")
        fine = CubicSpline(
            np.arange(257), np.append(values_at_knots(found[0]), values_at_knots(found[0])[0]), bc_type="periodic"
        )
        np.testing.assert_allclose(fine(place), through(place), atol=4e-6)


def values_at_knots(coefficients: np.ndarray) -> np.ndarray:
    """The spline of periodic B-spline coefficients at its knots."""
    return (np.roll(coefficients, 1) + 4.0 * coefficients + np.roll(coefficients, -1)) / 6.0


def table_of(function, azimuths: Azimuths, rings: Rings) -> PolarTable:
    """A table of function(u, v) in X, twice the function in Y and the function times |w| / w_max in Z."""
    rho, phi = rings.rho()[:, None], azimuths.phi()
    values = function(rho * np.cos(phi), rho * np.sin(phi))
    samples = np.zeros((rings.count, 12, azimuths.count), np.float32)
    samples[:, 0], samples[:, 4] = values, 2.0 * values
    # |w| / w_max = (T_0 + T_1) / 2
    samples[:, 8] = samples[:, 9] = 0.5 * values
    coefficients = cubic_spline.coefficients(samples)
    return PolarTable(coefficients.reshape(rings.count, 3, 4, azimuths.count), whole(PolarGrid(rings, azimuths)))


def directions(rho: np.ndarray, phi: np.ndarray, share: float) -> np.ndarray:
    """(u, v, w) at polar coordinates of (u, v), for |w| = share w_max."""
    return np.stack([rho * np.cos(phi), rho * np.sin(phi), -share * np.sqrt(4.0 - rho**2)], axis=-1)


@pytest.mark.parametrize("azimuths", [Azimuths(256), Azimuths(256, 0.6, 0.5)])
def test_a_smooth_function_is_interpolated_everywhere_and_at_the_origin(azimuths: Azimuths) -> None:
    """The function is odd in u: without the opposite half turn below the first ring it would err at the origin."""

    def function(u, v):
        return np.exp(-(u**2) - 0.5 * (v - 0.2) ** 2) * (2.0 + u)

    table = table_of(function, azimuths, Rings(200, 0.1))
    rng = np.random.default_rng(2)
    # at the rim the spline ends with zero slope, so the last rings are less accurate by a digit
    for rho, tolerance in ((1e-9, 2e-5), (3e-3, 2e-5), (0.02, 2e-5), (0.3, 2e-5), (1.6, 2e-5), (1.9, 3e-4)):
        phi = rng.uniform(-np.pi, np.pi, 400)
        uvw = directions(np.full(400, rho), phi, 0.7)
        expected = function(uvw[:, 0], uvw[:, 1])
        found = table.look_up(uvw)
        np.testing.assert_allclose(found[:, 0], expected, atol=tolerance)
        np.testing.assert_allclose(found[:, 1], 2.0 * expected, atol=2.0 * tolerance)
        np.testing.assert_allclose(found[:, 2], 0.7 * expected, atol=tolerance)


def test_look_ups_are_nan_beyond_the_largest_rho_only() -> None:
    table = table_of(lambda u, v: 1.0 + 0.0 * u * v, Azimuths(32), Rings(20, 0.1, 1.5))
    inside, outside = table.look_up(directions(np.array([1.5, 1.51]), np.zeros(2), 0.5))
    np.testing.assert_allclose(inside, [1.0, 2.0, 0.5], rtol=1e-5)
    assert np.all(np.isnan(outside))


def test_look_ups_are_finite_at_the_rim_and_for_vanishing_w() -> None:
    table = table_of(lambda u, v: 1.0 + 0.0 * u * v, Azimuths(32), Rings(20, 0.1))
    uvw = np.array([[2.0, 0.0, 0.0], [0.0, -2.0, -1e-12], [1.2, 0.0, -1e-300], [0.0, 0.0, -2.0]])
    found = table.look_up(uvw)
    assert np.all(np.isfinite(found))
    np.testing.assert_allclose(found[:, 0], 1.0, rtol=1e-5)


def test_the_table_of_a_mirror_is_its_specular_lobe() -> None:
    """|P|^2 = exp(-(rho / lambda)^2 / sigma_f^2) at every w, which gives the whole table in closed form."""
    field = HeightField(np.full((100, 100), 3.0), (0.15, 0.15))
    power = power_spectrum_of(field, Azimuths(32))
    rings, rule = Rings(120, 0.1), trapezoid(Light(), 5.0)
    (table,) = polar.build(power, rings, [Integrand(quadrature.uniform(rule, 120))], 4)
    rho, phi = np.linspace(0.0, 0.3, 40), np.linspace(0.0, 6.0, 40)
    uvw = np.stack([rho * np.cos(phi), rho * np.sin(phi), np.full(40, -1.3)], axis=-1)
    lobe = np.exp(-((rho[:, None] / (1e-3 * rule.lambda_nm)) ** 2) * (2.0 * np.pi * SIGMA) ** 2)
    np.testing.assert_allclose(table.look_up(uvw), lobe @ rule.weights, atol=3e-5)
