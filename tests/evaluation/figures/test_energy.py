"""Energy balance and reciprocity: closed forms against integrals over the hemisphere."""

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.figures import energy
from pipeline.evaluation.figures.order_efficiencies import LAMBDA_MIN_NM, known_gratings
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.methods.own_methods import Exact, PolarTableMethod
from pipeline.optics.material import Material
from pipeline.progress import silent
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField

pytestmark = pytest.mark.physics

# lobes twice as wide as sunlight's: a quarter of the views
SIGMA = 8.0
FLAT = HeightField(np.zeros((8, 16)), (2.0, 2.0))


def small(kind: str, sigma_um: float = 4.8, pitch_um: float = 0.15) -> BenchSurface:
    """A surface of a recipe, 19.2 um wide."""
    recipe = {"kind": kind, "size_um": 19.2, "pitch_um": pitch_um}
    settings = {"name": kind, "surface": {"recipe": recipe}, "coherence": {"sigma_um": sigma_um}}
    config = Config.model_validate(settings)
    return BenchSurface(config, recipes.make(config.surface.recipe), scan=False)


@pytest.mark.parametrize("grating", known_gratings(), ids=lambda grating: grating.name)
@pytest.mark.parametrize("w", [-1.9, -0.7])
def test_all_orders_share_the_mirrors_light(grating, w: float) -> None:
    assert energy.order_sum(grating, SIGMA, w) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
def test_a_flat_mirror_has_albedo_1(degrees: float) -> None:
    """Over the lobe, and over the whole hemisphere: nothing is elsewhere."""
    reference = Reference(FLAT, SIGMA, LAMBDA_MIN_NM)
    assert energy.albedo(reference, SIGMA, np.radians(degrees), 6.0) == pytest.approx(1.0, abs=1e-3)
    assert energy.albedo(reference, SIGMA, np.radians(degrees)) == pytest.approx(1.0, abs=1e-3)


def test_gratings_reflect_what_their_orders_add_up_to() -> None:
    """The BRDF over the hemisphere is sum |c_m|^2 G / w^2, which is neither 1 nor sum |c_m|^2."""
    blaze = known_gratings()[2]
    reference = Reference(blaze.field(blaze.samples), SIGMA, LAMBDA_MIN_NM)
    degrees = np.array([0.0, 40.0])
    found = np.array([energy.albedo(reference, SIGMA, theta) for theta in np.radians(degrees)])
    np.testing.assert_allclose(found, energy.closed_albedo(blaze, np.radians(degrees)), atol=5e-3)
    assert found[0] > 1.05
    assert found[1] < 0.8


def test_long_periods_keep_their_energy() -> None:
    for grating in known_gratings():
        assert energy.closed_albedo(grating, np.array([0.3]), 60.0)[0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("method", [Exact, pytest.param(PolarTableMethod, marks=pytest.mark.slow)])
def test_light_and_view_may_be_exchanged(method) -> None:
    surface = small("elaphe")
    gold = Material(fresnel="conductor", normalisation="absolute")
    wi, wr = energy.pairs(40)
    gilded = method(surface.field, surface.config.model_copy(update={"material": gold}))
    assert np.max(gilded.xyz(wi, wr)) > 0.0
    assert energy.asymmetry(gilded, wi, wr) < 1e-10


def test_asymmetry_sees_a_brdf_that_is_not_reciprocal() -> None:
    """Radiance itself holds cos(ti) as a factor of the BRDF."""

    class Lambertian:
        source, stored_bytes = "a diffuse surface lit by radiance, not irradiance", 0

        def xyz(self, wi: np.ndarray, wr: np.ndarray) -> np.ndarray:  # noqa: ARG002
            return np.ones((len(wi), 3))

    assert energy.asymmetry(Lambertian(), *energy.pairs(20)) > 0.1


@pytest.mark.slow
def test_the_page_holds() -> None:
    bench = Bench(small("blazed", 16.25), small("elaphe"), small("xenopeltis", pitch_um=0.1), quick=True)
    page = energy.make(bench, silent)
    assert [check.id for check in page.checks if check.verdict == "misses"] == []
    assert sum(check.verdict == "holds" for check in page.checks) > 10
    assert page.pictures[0].png.startswith(b"\x89PNG")
