"""The Gaussian coherence window and its transform."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.coherence import folded_window, reach_sigmas, sigma_f, window

SIGMA_UM = 16.25


@pytest.mark.parametrize("multiple", [0.0, 0.5, 1.0, 3.0])
def test_window_transforms_to_a_gaussian_of_sigma_f(multiple):
    """The window's Fourier transform, summed numerically, is exp(-f^2 / (2 sigma_f^2)).

    The trapezoidal rule over +-9 sigma at sigma / 20 errs by exp(-40): only rounding is left.
    """
    x = np.arange(-180, 181) * SIGMA_UM / 20.0
    f = multiple * sigma_f(SIGMA_UM)
    g = window(x, SIGMA_UM)
    transform = np.sum(g * np.cos(2.0 * np.pi * f * x)) / np.sum(g)
    assert transform == pytest.approx(np.exp(-0.5 * multiple**2), abs=1e-14)


def test_window_falls_to_its_standard_deviation():
    """g(0) = 1 and g(sigma) = exp(-1/2), on both sides."""
    np.testing.assert_allclose(
        window(np.array([-SIGMA_UM, 0.0, SIGMA_UM]), SIGMA_UM), [np.exp(-0.5), 1.0, np.exp(-0.5)], rtol=1e-15
    )


@given(
    n=st.integers(1, 40),
    pitch_um=st.floats(0.05, 4.0),
    sigma_um=st.floats(0.5, 20.0),
    f_per_um=st.floats(-3.0, 3.0),
)
def test_folded_window_is_the_sum_over_all_copies(n, pitch_um, sigma_um, f_per_um):
    """Each sample meets the window once in every copy of the patch, with the phase of that copy's place."""
    period = n * pitch_um
    x = (np.arange(n) - n // 2) * pitch_um
    copies = np.arange(-2 - int(12 * sigma_um / period), 3 + int(12 * sigma_um / period))[:, None]
    place = x + copies * period
    terms = np.exp(-0.5 * (place / sigma_um) ** 2) * np.exp(2j * np.pi * f_per_um * place)
    # phases of 2 pi f x, up to 12 sigma away, carry a rounding of their own size; so does each of the additions
    rounding = np.finfo(float).eps * (len(copies) + 4.0 + 8.0 * np.pi * abs(f_per_um) * 12.0 * sigma_um)
    found = folded_window(n, pitch_um, sigma_um, f_per_um)
    assert found.shape == (n,)
    assert np.all(np.abs(found - terms.sum(axis=0)) <= rounding * np.abs(terms).sum(axis=0) + 1e-14)


@pytest.mark.parametrize(("n", "pitch_um"), [(1, 7.0), (64, 1.0), (65, 1.0), (1000, 0.05), (3, 0.5)])
def test_folded_window_keeps_the_windows_area(n, pitch_um):
    """Folding loses nothing: the samples add up to sqrt(2 pi) sigma / pitch, however small the patch.

    By Poisson's sum the samples' total misses the integral by 2 exp(-2 pi^2 (sigma / pitch)^2) < 1e-40.
    """
    total = folded_window(n, pitch_um, SIGMA_UM, 0.0).sum()
    assert total == pytest.approx(np.sqrt(2.0 * np.pi) * SIGMA_UM / pitch_um, rel=1e-13)


def test_window_is_centred_on_the_middle_of_the_patch():
    """The brightest sample is the middle one, n // 2, not the corner where the patch's seam is."""
    for n in (8, 9):
        assert np.argmax(np.abs(folded_window(n, 10.0, SIGMA_UM, 0.0))) == n // 2


def test_reach_is_where_the_transform_has_fallen_to_the_tolerance():
    """exp(-reach^2 / 2) = tolerance: the 4 sigma_f of [D14] leave 3.4e-4."""
    assert reach_sigmas(np.exp(-8.0)) == pytest.approx(4.0, rel=1e-14)
    assert reach_sigmas(1.0) == 0.0


@given(st.floats(1e-15, 0.9), st.floats(1e-15, 0.9))
def test_tighter_tolerance_reaches_further(a, b):
    """The reach never grows with the tolerance."""
    assert (reach_sigmas(a) >= reach_sigmas(b)) == (a <= b) or reach_sigmas(a) == reach_sigmas(b)
