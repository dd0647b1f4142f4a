"""FFTW behind `scipy.fft` against scipy's own transforms, alone and in what is made of them."""

from types import SimpleNamespace

import numpy as np
import pyfftw
import pytest
import scipy.fft

from pipeline import resources
from pipeline.fourier import backend
from pipeline.surface import recipes, statistics
from pipeline.surface.recipes import random, snakes
from pipeline.surface.recipes.parameters import Elaphe, GaussianRandom

PLAIN = SimpleNamespace(
    rfft2=lambda values, shape=None: scipy.fft.rfft2(values, s=shape),
    irfft2=lambda spectrum, shape: scipy.fft.irfft2(spectrum, s=shape),
)
RECIPES = {
    "elaphe": Elaphe(kind="elaphe", size_um=12.0, pitch_um=0.09),
    "gaussian": GaussianRandom(
        kind="gaussian", size_um=(9.0, 7.0), pitch_um=0.1, sigma_h_um=0.05, correlation_um=0.6
    ),
}


@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 9), (36, 30), (37, 41), (64, 53)], ids=str)
def test_transforms_are_scipys(shape: tuple[int, int]) -> None:
    values = np.random.default_rng(3).standard_normal(shape)
    kept = values.copy()
    half = scipy.fft.rfft2(values)
    np.testing.assert_allclose(backend.rfft2(values), half, atol=1e-12)
    larger = (shape[0] + 3, shape[1] + 2)
    np.testing.assert_allclose(backend.rfft2(values, larger), scipy.fft.rfft2(values, s=larger), atol=1e-12)
    np.testing.assert_allclose(backend.irfft2(half, shape), values, atol=1e-14)
    # what was given stays as it was
    np.testing.assert_array_equal(values, kept)
    np.testing.assert_array_equal(half, scipy.fft.rfft2(values))


def test_a_transform_leaves_nothing_in_memory() -> None:
    """The recipe's heights are all that is held afterwards; arrays of less than 32 MiB may stay in the heap."""
    # loads the libraries
    recipes.make(RECIPES["gaussian"])
    before = resources.held_bytes()
    made = recipes.make(GaussianRandom(kind="gaussian", size_um=105.0, pitch_um=0.05))
    assert made.heights_um.nbytes > 2**25
    assert resources.held_bytes() - before < 2 * made.heights_um.nbytes


def test_fftw_does_the_work_here_and_nowhere_else(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    inner = pyfftw.interfaces.scipy_fft.__ua_function__
    monkeypatch.setattr(
        pyfftw.interfaces.scipy_fft, "__ua_function__", lambda *of: asked.append(of[0].__name__) or inner(*of)
    )
    backend.rfft2(np.ones((4, 4)))
    assert asked == ["rfft2"]
    scipy.fft.rfft2(np.ones((4, 4)))
    assert asked == ["rfft2"]


@pytest.mark.parametrize("name", RECIPES)
def test_recipes_and_statistics_are_those_of_plain_scipy(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = recipes.make(RECIPES[name])
    found = statistics.measure(made, 4.0, 380.0)
    for module in (random, snakes):
        monkeypatch.setattr(module, "fourier", PLAIN)
    plain = recipes.make(RECIPES[name])
    np.testing.assert_allclose(made.heights_um, plain.heights_um, atol=1e-13)
    expected = statistics.measure(plain, 4.0, 380.0)
    assert len(found.periods) == len(expected.periods)
    for one, other in zip(found.periods, expected.periods, strict=True):
        assert vars(one) == pytest.approx(vars(other), rel=1e-9)
    assert found.seam_energy == pytest.approx(expected.seam_energy, rel=1e-9)


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_is_the_same_to_the_last_bit_every_time(name: str) -> None:
    np.testing.assert_array_equal(recipes.make(RECIPES[name]).heights_um, recipes.make(RECIPES[name]).heights_um)
