"""The BRDF of one wavelength: closed forms of a mirror, and the colour that it integrates to."""

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.method import Monochromatic, monochromatic_brdf
from pipeline.optics import geometry
from pipeline.optics.light import Light, trapezoid
from pipeline.surface.heightfield import HeightField

SIGMA_UM = 3.2
# the rest answer for integrals alone; bumps are no mirror
ALL = [name for name in METHODS if name not in ("NMM", "GPU Gems", "D14 look-up", "Stam bumps")]


def config_of(**material) -> Config:
    return Config.model_validate(
        {
            "name": "single",
            "surface": {"recipe": {"kind": "mirror"}},
            "coherence": {"sigma_um": SIGMA_UM},
            "material": {"shadowing": False, **material},
        }
    )


def rough() -> HeightField:
    return HeightField(0.05 * np.random.default_rng(5).random((128, 128)), (0.1, 0.1))


@pytest.mark.parametrize("name", ALL)
def test_a_perfect_mirror_shows_its_window(name):
    """4 pi sigma^2 / l^2 in 1/sr in its own reflection ([D14] eq. 2 with R = 1, w = -2 cos t, G = 4 cos^2 t)."""
    config = config_of(fresnel="none", normalisation="absolute")
    method = METHODS[name](HeightField(np.zeros((128, 128)), (0.1, 0.1)), config)
    assert isinstance(method, Monochromatic)
    wavelengths = np.array([450.0, 632.8])
    theta = np.radians([0.0, 40.0])
    wi, wr = geometry.direction(theta, 0.0), geometry.direction(theta, np.pi)
    expected = np.broadcast_to(4.0 * np.pi * (SIGMA_UM / (1e-3 * wavelengths)) ** 2, (2, 2))
    found = monochromatic_brdf(method, config, wi, wr, wavelengths)
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("material", [{"fresnel": "schlick"}, {"fresnel": "conductor", "normalisation": "absolute"}])
def test_it_integrates_to_the_colour(material):
    config = config_of(**material)
    method = METHODS["exact"](rough(), config)
    rng = np.random.default_rng(1)
    wi, wr = (geometry.direction(np.arcsin(0.8 * rng.random(6)), 6.28 * rng.random(6)) for _ in range(2))
    rule = trapezoid(config.light, 1.0)
    single = np.nan_to_num(monochromatic_brdf(method, config, wi, wr, rule.lambda_nm))
    np.testing.assert_allclose(wi[:, 2:] * (single @ rule.weights), method.xyz(wi, wr), rtol=2e-3)


def test_methods_without_one_wavelength_say_so():
    # what they are does not depend on how many wavelengths they are made of
    config = config_of().model_copy(update={"light": Light(range_nm=(540.0, 560.0))})
    for name in ("NMM", "GPU Gems", "D14 look-up"):
        method = METHODS[name](grating(), config)
        assert not isinstance(method, Monochromatic)


def grating() -> HeightField:
    x = np.arange(256) * 0.1
    return HeightField(np.tile(0.05 * np.sin(2.0 * np.pi * x / 1.6), (256, 1)), (0.1, 0.1))
