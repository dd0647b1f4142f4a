"""NMM: which wavelengths land, the white centre, and the limit in which it is the whole integral."""

import numpy as np
import pytest

from pipeline.diffraction.reference import Reference
from pipeline.errors import ConfigError
from pipeline.evaluation.methods.dft_terms import FULL
from pipeline.evaluation.methods.flss import Flss
from pipeline.evaluation.methods.nmm import Nmm, landing
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import trapezoid
from pipeline.scene.pairs import random_pairs
from tests.evaluation.methods.surfaces import ELAPHE, SIGMA, config, made

RANGE = (380.0, 780.0)


def around_the_mirror(radii: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Views of a light straight above, `count` on each circle of sin(theta) = radius."""
    phi = 0.1 + 2 * np.pi * np.arange(count) / count
    wr = geometry.direction(np.arcsin(radii)[:, None], phi).reshape(-1, 3)
    return np.broadcast_to([0.0, 0.0, 1.0], wr.shape), wr


def test_wavelengths_land_on_whole_coefficients_of_either_axis() -> None:
    """X |u| / lambda or Y |v| / lambda is whole, and every whole number within the range is there."""
    uv, size = np.array([[0.4, -0.031], [-1.3, 0.0], [0.0, 0.0]]), (10.0, 26.0)
    chosen = landing(uv, size, RANGE)
    assert not np.any(chosen.direction == 2)
    assert np.all((chosen.lambda_nm >= RANGE[0]) & (chosen.lambda_nm <= RANGE[1]))
    for d in (0, 1):
        found = np.sort(chosen.lambda_nm[chosen.direction == d])
        every = [1e3 * s * abs(f) / n for s, f in zip(size, uv[d], strict=True) for n in range(1, 100)]
        expected = sorted(nm for nm in every if RANGE[0] <= nm <= RANGE[1])
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    # 4000 nm / n, n = 6 .. 10, and 806 nm / 2
    assert np.sum(chosen.direction == 0) == 6


def test_every_nanometre_of_the_range_is_counted_once() -> None:
    rng = np.random.default_rng(0)
    uv = rng.uniform(-1.5, 1.5, (200, 2))
    # both sets alike: two wavelengths of the same length share one stretch
    uv[0] = 0.7
    chosen = landing(uv, (26.0, 26.0), RANGE)
    np.testing.assert_allclose(np.bincount(chosen.direction, chosen.share_nm), 400.0, rtol=1e-12)
    assert chosen.share_nm.min() >= 0.0


def test_a_mirror_is_white_in_its_own_reflection() -> None:
    """XYZ of the light with Y = 1: a mirror under 1 RU."""
    of = config({"kind": "mirror", "size_um": 26.0, "pitch_um": 0.1})
    straight = np.array([[0.0, 0.0, 1.0]])
    found = Nmm(made(of), of).xyz(straight, straight)[0]
    np.testing.assert_allclose(found, trapezoid(of.light, 1.0).weights.sum(axis=0), rtol=1e-12)
    assert found[1] == pytest.approx(1.0, rel=1e-12)


def test_the_centre_is_white_whatever_the_surface_and_nothing_else_is() -> None:
    """Inside lambda_max / X a mirror's XYZ, on Elaphe far above the truth; outside it no direction is as bright."""
    field = made(ELAPHE)
    method = Nmm(field, ELAPHE)
    white = trapezoid(ELAPHE.light, 1.0).weights.sum(axis=0)
    assert method.white_radius == pytest.approx(0.78 / min(field.size_um))

    inside = around_the_mirror(method.white_radius * np.linspace(0.0, 0.999, 8), 24)
    factor = brdf.direction_factor(ELAPHE.material, trapezoid(ELAPHE.light, 1.0), *inside)[:, None]
    np.testing.assert_allclose(method.xyz(*inside), factor * white, rtol=1e-12)
    exact = Reference(field, SIGMA, 380.0).xyz(ELAPHE.light, ELAPHE.material, *inside, step_nm=5.0)
    assert np.all(exact[:, 1] < 0.5)

    outside = around_the_mirror(np.linspace(1.001 * method.white_radius, 0.98, 60), 24)
    found = method.xyz(*outside)
    assert found[:, 1].max() < 0.3
    # a wavelength lands everywhere outside
    assert found[:, 1].min() > 0.0


def test_the_white_circle_may_be_drawn_elsewhere() -> None:
    field = made(ELAPHE)
    wi, wr = around_the_mirror(np.array([0.05]), 6)
    white = Nmm(field, ELAPHE, white_radius=0.06).xyz(wi, wr)
    assert np.all(white[:, 1] > 0.99)
    assert np.all(Nmm(field, ELAPHE, white_radius=0.04).xyz(wi, wr)[:, 1] < 0.3)


@pytest.mark.slow
def test_as_coefficients_crowd_it_becomes_the_whole_integral() -> None:
    """Patches of 4, 12 and 36 sigma: the wavelengths that land go from every other lobe to five a lobe."""
    errors = []
    wi, wr = random_pairs(None, 300, seed=3)
    away = np.hypot(*(wi + wr)[:, :2].T) > 0.3
    wi, wr = wi[away], wr[away]
    for sigmas in (4.0, 12.0, 36.0):
        recipe = {"kind": "gaussian", "size_um": sigmas, "pitch_um": 0.12, "sigma_h_um": 0.06, "correlation_um": 0.4}
        of = config(recipe, sigma=1.0)
        field = made(of)
        exact = Flss(field, of, reach=FULL, step_nm=1.0).xyz(wi, wr)
        found = Nmm(field, of, reach=FULL).xyz(wi, wr)
        errors.append(float(np.mean(np.abs(found - exact) / np.maximum(exact, 1e-6))))
    assert errors[0] > 5 * errors[1] > 10 * errors[2]
    assert errors[2] < 2e-3


def test_orders_of_a_grating_keep_their_colour() -> None:
    """A blaze of whole periods: light along u lands on its orders' own coefficients, in the integral's colour."""
    of = config({"kind": "blazed", "period_um": 2.0, "size_um": 26.0, "pitch_um": 0.1})
    field = made(of)
    u = np.linspace(0.2, 0.38, 40)
    wr = np.stack([u, np.zeros_like(u), np.sqrt(1 - u**2)], axis=-1)
    wi = np.broadcast_to([0.0, 0.0, 1.0], wr.shape)
    exact = Reference(field, SIGMA, 380.0).xyz(of.light, of.material, wi, wr)
    found = Nmm(field, of).xyz(wi, wr)
    # a lobe exp(-d^2 / (sigma_f X)^2) is summed at whole d: 1 + 2 exp(-(pi sigma_f X)^2) = 1.037 of it, by Poisson
    lobe = field.size_um[0] * sigma_f(SIGMA)
    assert np.median(found[:, 1] / exact[:, 1]) == pytest.approx(1 + 2 * np.exp(-((np.pi * lobe) ** 2)), rel=0.03)
    chromaticity, expected = (xyz[:, :2] / xyz.sum(axis=1, keepdims=True) for xyz in (found, exact))
    # where two orders meet, only their lobes' flanks are left, and those are off by more
    assert np.median(np.abs(chromaticity - expected)) < 0.005


@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_materials_enter_as_they_do_in_the_integral(normalisation: str) -> None:
    """Gold, crowded coefficients: the same factors inside and outside the sum as the reference has."""
    recipe = {"kind": "gaussian", "size_um": 30.0, "pitch_um": 0.12, "sigma_h_um": 0.06, "correlation_um": 0.4}
    of = config(recipe, sigma=1.0, material={"fresnel": "conductor", "normalisation": normalisation})
    field = made(of)
    wi, wr = random_pairs(None, 40, seed=8)
    exact = Flss(field, of, reach=FULL, step_nm=1.0).xyz(wi, wr)
    assert np.median(np.abs(Nmm(field, of, reach=FULL).xyz(wi, wr) / exact - 1)) < 2e-3


def test_beyond_the_band_nothing_is_added() -> None:
    """A pitch of 0.3 um: directions whose every wavelength lies beyond 1.67 / um are dark, not NaN."""
    of = config({"kind": "gaussian", "size_um": 30.0, "pitch_um": 0.3}, sigma=2.0)
    wi, wr = geometry.direction(np.radians([70.0]), 0.0), geometry.direction(np.radians([30.0]), 0.0)
    np.testing.assert_array_equal(Nmm(made(of), of).xyz(wi, wr), 0.0)


def test_a_laser_line_leaves_nothing_to_select() -> None:
    of = config({"kind": "mirror", "size_um": 10.0}, spectrum={"illuminant": {"lambda_nm": 532.0}})
    with pytest.raises(ConfigError, match=r"spectrum\.illuminant"):
        Nmm(made(of), of)
