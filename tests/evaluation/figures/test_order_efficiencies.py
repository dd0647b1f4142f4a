"""Order efficiencies: every route against closed forms, and a page that would say so if one failed."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.evaluation.figures import order_efficiencies
from pipeline.evaluation.figures.order_efficiencies import Answers, KnownGrating, known_gratings
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.progress import silent
from pipeline.surface import recipes

pytestmark = pytest.mark.physics

SIGMA = 8.0
AT = order_efficiencies.propagating(np.array([430.0, 650.0]))


@pytest.fixture(scope="module")
def found() -> dict[str, Answers]:
    return {grating.name: order_efficiencies.answers(grating, SIGMA, AT) for grating in known_gratings()}


@pytest.mark.parametrize("grating", known_gratings(), ids=lambda grating: grating.name)
def test_every_route_meets_the_closed_form(found: dict[str, Answers], grating: KnownGrating) -> None:
    """Sums to rounding where the samples' own closed form is known, all routes to 1e-4 of the mirror."""
    each = found[grating.name]
    np.testing.assert_allclose(each.direct, each.samples, atol=1e-12)
    np.testing.assert_allclose(each.reference, each.samples, atol=1e-9)
    np.testing.assert_allclose(each.reference, each.profile, atol=order_efficiencies.TOLERANCE)
    np.testing.assert_allclose(each.polar, each.profile, atol=order_efficiencies.TOLERANCE)
    # and there is something to meet
    assert each.profile.max() > 0.3


def test_orders_have_directions() -> None:
    """Light and view of every order are unit vectors: |(u, v)| and |w| leave room for two of them."""
    rho2 = np.sum(AT.uvw[:, :2] ** 2, axis=1)
    assert np.all(rho2 + AT.uvw[:, 2] ** 2 <= 4.0)
    np.testing.assert_allclose(
        AT.uvw[:, 0], AT.order * 1e-3 * AT.lambda_nm / order_efficiencies.PERIOD_UM, atol=1e-12
    )
    np.testing.assert_array_equal(AT.uvw[:, 1], 0.0)
    assert set(AT.light) == {0, 1, 2, 3}
    assert AT.order.min() < -5
    assert AT.order.max() > 5


@pytest.mark.parametrize("spacing", [0.25, 0.4])
def test_interpolation_over_radii_errs_by_its_remainder(spacing: float) -> None:
    """8 points of exp(-x^2) about its peak, halfway between two: the bound is met and not far above."""
    nodes = spacing * (np.arange(8) - 3.5)
    weights = [np.prod([-b / (a - b) for b in nodes if b != a]) for a in nodes]
    error = abs(np.dot(weights, np.exp(-(nodes**2))) - 1.0)
    assert 0.5 * order_efficiencies.between_radii(spacing) < error <= order_efficiencies.between_radii(spacing)


def test_the_samples_needed_are_the_fewest() -> None:
    for grating in known_gratings()[1:]:
        samples = order_efficiencies.samples_needed(grating, AT)
        assert order_efficiencies.sampling_error(grating, samples, AT) <= order_efficiencies.TOLERANCE
        assert order_efficiencies.sampling_error(grating, samples - 2, AT) > order_efficiencies.TOLERANCE


def test_a_wrong_profile_fails(found: dict[str, Answers]) -> None:
    """Orders in the wrong direction fail the checks of their algorithms, and of no other."""
    blaze = known_gratings()[2]
    right = found[blaze.name]
    mirrored = replace(right, direct=right.direct[::-1], reference=right.reference[::-1])
    missed = {check.id for check in order_efficiencies.checks_of(blaze, mirrored) if check.verdict == "misses"}
    assert missed == {"blaze.direct", "blaze.reference", "blaze.reference.profile"}


@pytest.mark.slow
def test_the_page_holds() -> None:
    recipe = {"kind": "blazed", "size_um": 20.0, "pitch_um": 0.25}
    config = Config.model_validate(
        {"name": "blazed", "surface": {"recipe": recipe}, "coherence": {"sigma_um": SIGMA}}
    )
    surface = BenchSurface(config, recipes.make(config.surface.recipe), scan=False)
    page = order_efficiencies.make(Bench(surface, surface, surface, quick=True), silent)
    assert [check.id for check in page.checks if check.verdict != "holds"] == []
    assert all(picture.png.startswith(b"\x89PNG") for picture in page.pictures)
    assert len(order_efficiencies.propagating(np.array([400.0, 560.0, 720.0])).order) > 50
