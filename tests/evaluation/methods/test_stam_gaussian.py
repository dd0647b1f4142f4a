"""Stam's Gaussian surface: closed forms, sums over lags written out, and the mean of many random surfaces."""

from math import factorial

import numpy as np
import pytest

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import power_direct
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.evaluation.methods.stam_gaussian import (
    DiscWindow,
    GaussianSurface,
    GaussianWindow,
    StamGaussian,
    autocovariance,
)
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence, folded_window, sigma_f
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Mirror
from pipeline.surface.source import SurfaceSource

LAMBDA_NM = 500.0


def pairs(count: int, seed: int = 0) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    theta, phi = np.arccos(rng.uniform(0.2, 1.0, (2, count))), rng.uniform(0, 2 * np.pi, (2, count))
    return geometry.direction(theta[0], phi[0]), geometry.direction(theta[1], phi[1])


def config_of(sigma_um: float, **sections: object) -> Config:
    surface = SurfaceSource(recipe=Mirror(kind="mirror"))
    coherence = Coherence(sigma_um=sigma_um)
    return Config(name="test", surface=surface, coherence=coherence, **sections)


def lags(shape: tuple[int, int], pitch: tuple[float, float]) -> Array:
    """Distances of a patch's samples from [0, 0], the short way round, um."""
    y, x = (np.fft.fftfreq(n, 1.0 / (n * p)) for n, p in zip(shape, pitch[::-1], strict=True))
    return np.hypot(y[:, None], x)


def test_a_mirror_shows_its_window() -> None:
    """No heights, no scatter: the window's |transform|^2, 1 at its peak. A disc's is dark at 0.61 / radius (Airy)."""
    u = np.array([0.0, 0.004, 0.012, 0.0201])
    uvw = np.stack([u, np.zeros(4), np.full(4, -1.9)], axis=-1)
    flat = HeightField(np.full((40, 50), 3.0), (0.5, 0.5))
    f = u / (1e-3 * LAMBDA_NM)
    found = StamGaussian(flat, config_of(4.0)).power(uvw, np.array([LAMBDA_NM]))[:, 0]
    np.testing.assert_allclose(found, np.exp(-((f / sigma_f(4.0)) ** 2)), atol=1e-12)
    disc = DiscWindow(0.61 / (f[1]))
    found = StamGaussian(flat, config_of(4.0), disc).power(uvw, np.array([LAMBDA_NM]))[:, 0]
    assert found[0] == pytest.approx(1.0)
    assert found[1] < 1e-6 < found[2]


@pytest.mark.parametrize("window", [GaussianWindow(3.0), DiscWindow(6.0)], ids=["Gaussian", "disc"])
def test_a_window_spreads_light_over_the_area_it_says(window: GaussianWindow | DiscWindow) -> None:
    """Integral of W over frequencies = 1 / (4 pi sigma^2): with it a mirror's albedo is 1 in `absolute`."""
    f = np.linspace(0.0, 60.0, 400_001)
    area = 2.0 * np.pi * np.trapezoid(f * window.power(f), f)
    assert 4.0 * np.pi * window.sigma_um**2 * area == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("sigma_h_um", [0.005, 0.06, 0.25], ids=["g = 0.02", "g = 2", "g = 36"])
def test_gaussian_correlation_has_a_closed_form(sigma_h_um: float) -> None:
    """C = exp(-d^2 / l^2): exp(-g) sum g^n / n! exp(-pi^2 f^2 / b) / (4 sigma^2 b), b = 1 / (4 sigma^2) + n / l^2.

    That is Stam's own series, from Born's approximation to ray optics.
    """
    length, sigma, shape, pitch = 1.1, 1.5, (200, 180), (0.12, 0.12)
    covariance = sigma_h_um**2 * np.exp(-((lags(shape, pitch) / length) ** 2))
    surface = GaussianSurface(covariance, pitch, GaussianWindow(sigma), 380.0)
    wi, wr = pairs(50)
    uvw = geometry.uvw(wi, wr)
    f2 = (uvw[:, 0] ** 2 + uvw[:, 1] ** 2) / (1e-3 * LAMBDA_NM) ** 2
    g = (2.0 * np.pi / (1e-3 * LAMBDA_NM) * uvw[:, 2] * sigma_h_um) ** 2
    expected = np.zeros(len(uvw))
    for n in range(160):
        b = 1.0 / (4.0 * sigma**2) + n / length**2
        weight = np.exp(n * np.log(g) - g - np.log(float(factorial(n))))
        expected += weight * np.exp(-(np.pi**2) * f2 / b) / (4.0 * sigma**2 * b)
    found = surface.power(uvw, np.array([LAMBDA_NM]))[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
    assert np.max(expected) > 1e-3


def rough(ny: int, nx: int, pitch: tuple[float, float], seed: int = 3) -> HeightField:
    """Smoothed noise: every azimuth differs."""
    white = np.random.default_rng(seed).standard_normal((ny, nx))
    smooth = np.fft.ifft2(np.fft.fft2(white) * np.exp(-(lags((ny, nx), pitch) ** 2) * 20.0)).real
    return HeightField(0.06 * smooth / smooth.std(), pitch)


def test_gaussian_window_against_the_sum_over_lags() -> None:
    """sum A(d) exp(-g (1 - C)) exp(2 pi i f.d) over an oblong patch's lags, all its copies under A."""
    field, sigma = rough(90, 60, (0.1, 0.12)), 2.5
    wi, wr = pairs(30)
    uvw = geometry.uvw(wi, wr)
    found = StamGaussian(field, config_of(sigma)).power(uvw, np.array([LAMBDA_NM]))[:, 0]
    covariance, k = autocovariance(field), 2.0 * np.pi / (1e-3 * LAMBDA_NM)
    for (u, v, w), here in zip(uvw, found, strict=True):
        # the window's lags have sigma sqrt 2; folded_window has the middle sample where lags have none
        x, y = (
            folded_window(n, p, np.sqrt(2.0) * sigma, f)
            for n, p, f in zip((60, 90), field.pitch_um, (u / 0.5, v / 0.5), strict=True)
        )
        kept = np.fft.fftshift(np.exp(-((k * w) ** 2) * (covariance[0, 0] - covariance)))
        area = 4.0 * np.pi * sigma**2 / (field.pitch_um[0] * field.pitch_um[1])
        assert here == pytest.approx((y @ kept @ x).real / area, rel=1e-6, abs=1e-9)


def test_disc_window_against_the_sum_over_lags() -> None:
    """The same under a disc, whose autocorrelation ends at twice its radius; Airy's far tails are left out."""
    field, disc = rough(90, 90, (0.1, 0.1)), DiscWindow(6.0)
    wi, wr = pairs(60)
    uvw = geometry.uvw(wi, wr)
    found = StamGaussian(field, config_of(2.0), disc).power(uvw, np.array([LAMBDA_NM]))[:, 0]
    covariance, k = autocovariance(field), 2.0 * np.pi / (1e-3 * LAMBDA_NM)
    index = np.arange(-120, 121)
    x, y = np.meshgrid(index * 0.1, index * 0.1)
    half = np.minimum(np.hypot(x, y) / (2.0 * disc.radius_um), 1.0)
    overlap = 2.0 / np.pi * (np.arccos(half) - half * np.sqrt(1.0 - half**2))
    tiled = covariance[np.ix_(index % 90, index % 90)]
    expected = []
    for u, v, w in uvw:
        kept = overlap * np.exp(-((k * w) ** 2) * (covariance[0, 0] - tiled))
        expected.append(np.sum(kept * np.cos(2.0 * np.pi * (u * x + v * y) / 0.5)) * 0.1**2)
    expected = np.array(expected) / (np.pi * disc.radius_um**2)
    assert np.sum(found) == pytest.approx(np.sum(expected), rel=0.03)
    bright = expected > 1e-4
    assert np.count_nonzero(bright) > 5
    np.testing.assert_allclose(found[bright], expected[bright], rtol=0.05)


@pytest.mark.slow
def test_many_random_surfaces_scatter_like_this_in_the_mean() -> None:
    """Exact |P|^2 of 300 Gaussian surfaces of one covariance: their mean is Stam's expectation, within its error."""
    shape, pitch, sigma, count = (96, 96), (0.1, 0.1), 1.6, 300
    gain2 = np.fft.fft2(np.exp(-((lags(shape, pitch) / 0.5) ** 2))).real.clip(0.0)
    gain = 0.07 * np.sqrt(gain2)
    covariance = np.fft.ifft2(gain**2).real
    uv = np.concatenate([[[0.0, 0.0], [0.05, 0.0]], np.random.default_rng(5).uniform(-0.8, 0.8, (24, 2))])
    uvw = np.concatenate([uv, np.full((26, 1), -1.7)], axis=1)
    x, y = (np.stack([folded_window(96, 0.1, sigma, f / 0.5) for f in uv[:, axis]]) for axis in (0, 1))
    total = np.sum(np.abs(x[0])) * np.sum(np.abs(y[0]))
    rng, found = np.random.default_rng(1), []
    for _ in range(count):
        heights = np.fft.ifft2(np.fft.fft2(rng.standard_normal(shape)) * gain).real
        p = np.exp(2j * np.pi / 0.5 * -1.7 * heights)
        found.append(np.abs(np.sum((y @ p) * x, axis=1) / total) ** 2)
    # the sums are the project's own
    np.testing.assert_allclose(found[-1], power_direct(HeightField(heights, pitch), sigma, uvw, LAMBDA_NM), rtol=1e-9)
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(count)
    expected = GaussianSurface(covariance, pitch, GaussianWindow(sigma), 380.0).power(uvw, np.array([LAMBDA_NM]))
    score = (mean - expected[:, 0]) / error
    assert np.max(np.abs(score)) < 4.0
    assert np.mean(score**2) == pytest.approx(1.0, abs=0.6)


def test_low_heights_scatter_their_own_spectrum() -> None:
    """g << 1, Born's approximation: (k w)^2 times the heights' power spectrum under the window."""
    field, sigma = rough(64, 64, (0.1, 0.1)), 1.0
    low = HeightField(1e-3 * field.heights_um, field.pitch_um)
    wi, wr = pairs(60)
    uvw = geometry.uvw(wi, wr)
    f = uvw[:, :2] / (1e-3 * LAMBDA_NM)
    away = np.hypot(f[:, 0], f[:, 1]) > 8.0 * sigma_f(sigma)
    power = np.abs(np.fft.fft2(low.heights_um - low.heights_um.mean()) / 64**2) ** 2
    phi = np.fft.fftfreq(64, 0.1)
    expected = []
    for (fx, fy), w in zip(f[away], uvw[away, 2], strict=True):
        seen = np.exp(-((fx - phi[None, :]) ** 2 + (fy - phi[:, None]) ** 2) / sigma_f(sigma) ** 2)
        expected.append((2.0 * np.pi / (1e-3 * LAMBDA_NM) * w) ** 2 * np.sum(power * seen))
    found = StamGaussian(low, config_of(sigma)).power(uvw[away], np.array([LAMBDA_NM]))[:, 0]
    assert len(found) > 20
    # the terms' tolerance, 1e-10 of a mirror, is a tenth of the darkest here
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-10)


def test_exchanging_light_and_view_changes_nothing_but_the_cosine() -> None:
    method = StamGaussian(rough(64, 64, (0.1, 0.1)), config_of(1.5, material=Material(fresnel="conductor")))
    wi, wr = pairs(20)
    there, back = method.xyz(wi, wr) / wi[:, 2:], method.xyz(wr, wi) / wr[:, 2:]
    np.testing.assert_allclose(there, back, rtol=1e-11)


def test_beyond_the_band_nothing_is_claimed() -> None:
    method = StamGaussian(rough(32, 32, (0.3, 0.3)), config_of(2.0))
    uvw = np.array([[0.82, 0.0, -1.0], [0.85, 0.0, -1.0], [0.0, -0.85, -1.0]])
    assert np.isfinite(method.power(uvw, np.array([500.0])))[:, 0].tolist() == [True, False, False]
    assert isinstance(method, Monochromatic)
    assert method.stored_bytes > 0
