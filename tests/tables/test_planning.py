"""The planner: grids that follow the budget, the scene, the settings of a config and the surface's anisotropy."""

import numpy as np
import pytest

from pipeline.accuracy.checks import check_flank
from pipeline.diffraction import power_spectrum
from pipeline.optics import geometry
from pipeline.optics.coherence import FLANK_DELTA_E
from pipeline.optics.light import LaserLine, Light
from pipeline.stages.polar import certificate
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.planning.anisotropy import Scattering
from pipeline.tables.polar.planning.flank import _cheapest, _Numbers
from pipeline.tables.polar.planning.grids import DISTANCES
from tests.tables.planned import SIGMA, config, exact_of, planned

pytestmark = pytest.mark.slow


def test_a_finer_budget_costs_more_texels_and_nodes() -> None:
    rough, fine = (planned(config(accuracy={"delta_e": e}))[1] for e in (2.0, 0.1))
    assert fine.texels > 1.5 * rough.texels
    assert fine.s_nodes >= rough.s_nodes


def test_numbers_that_a_config_sets_are_kept() -> None:
    found = config(table={"rings": 20, "azimuths": 160, "w_terms": 4, "terms": 20})
    table, chosen = planned(found)
    assert (chosen.rings.count, chosen.azimuths.count, chosen.w_terms) == (20, 160, 4)
    assert chosen.terms == 20
    assert chosen.probed_delta_e is None
    assert table.values.shape == (20, 3, 4, 160)


@pytest.mark.parametrize("lights", [("D65", "A"), (LaserLine(lambda_nm=532.0),) * 2])
def test_a_plan_serves_every_illuminant_and_observer(lights: tuple[str | LaserLine, str | LaserLine]) -> None:
    """One power spectrum is made for all of them, so the planner reads none of a config's."""
    observers = ("CIE 1931 2 Degree Standard Observer", "CIE 1964 10 Degree Standard Observer")
    found = [
        plan.numbers(
            0.1, SIGMA, Light(illuminant=light, observer=seen), None, plan.Budget(0.1, 7500.0), PolarLayout()
        )
        for light, seen in zip(lights, observers, strict=True)
    ]
    assert found[0] == found[1]


def test_one_number_is_kept_while_the_other_is_searched() -> None:
    _, chosen = planned(config(table={"rings": 36}, accuracy={"delta_e": 1.0}))
    assert chosen.rings.count == 36
    _, chosen = planned(config(table={"azimuths": 320}, accuracy={"delta_e": 1.0}))
    assert chosen.azimuths.count == 320
    assert chosen.probed_delta_e is not None


def test_the_plan_of_a_flat_mirror_keeps_its_budget() -> None:
    recipe = {"kind": "mirror", "size_um": 6.4, "pitch_um": 0.1}
    found = config(surface={"recipe": recipe}, coherence={"sigma_um": 1.6}, accuracy={"delta_e": 0.5})
    table, _ = planned(found)
    assert certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found).measured <= 0.5


def test_a_scene_bounds_the_rings() -> None:
    scene = {"lights": [{"theta_deg": 30}], "views": {"theta_max_deg": 40}}
    found = config(scene=scene)
    table, chosen = planned(found)
    reach = np.sin(np.radians(30.0)) + np.sin(np.radians(40.0))
    assert chosen.rings.rho_max == pytest.approx(reach)
    wi = geometry.direction(np.radians([30.0, 80.0]), 0.0)
    wr = geometry.direction(np.radians([39.9, 80.0]), 0.0)
    assert list(np.isfinite(table_evaluator(table, found.radiometry)(wi, wr)).all(axis=-1)) == [True, False]
    certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)


def test_the_stretch_follows_the_axis_of_a_grating() -> None:
    y, x = np.mgrid[-60:60, -60:60] * 0.1
    for angle in (0.0, 35.0, 90.0):
        along = x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle))
        field = HeightField(0.05 * np.cos(2.0 * np.pi * along / 1.2), (0.1, 0.1))
        stretch, axis = Scattering(power_spectrum.chebyshev_stack(field, SIGMA, 5.3, 16, 1e-5)).anisotropy()
        apart = np.angle(np.exp(2j * (axis - np.radians(angle)))) / 2.0
        assert abs(np.degrees(apart)) < 2.0
        # the seams of a rotated grating scatter too
        assert stretch < 0.65


def test_an_isotropic_surface_is_not_stretched() -> None:
    rng = np.random.default_rng(4)
    field = HeightField(rng.normal(0.0, 0.03, (120, 120)), (0.1, 0.1))
    stretch, _ = Scattering(power_spectrum.chebyshev_stack(field, SIGMA, 4.9, 16, 1e-5)).anisotropy()
    assert stretch > 0.95


@pytest.mark.parametrize("kind", ["mirror", "elaphe", "blazed"])
def test_a_plan_keeps_the_limit_of_the_flank_with_a_margin(kind: str) -> None:
    """A mirror needs no terms in |w| and its rings close, a grating both."""
    found = config(surface={"recipe": {"kind": kind, "size_um": 12, "pitch_um": 0.1}})
    table, _ = planned(found)
    flank = check_flank(table_evaluator(table, found.radiometry), exact_of(found), found)
    assert flank is not None
    assert flank.colour.maximum <= 0.9 * FLANK_DELTA_E


def test_the_flank_gets_the_numbers_of_the_fewest_bytes_that_keep_its_limit() -> None:
    """Rings, terms and nodes are tried in the order of bytes, and those that cannot help are left out."""
    numbers = [_Numbers(w, s, distance) for w in (8, 12) for s in (14, 16) for distance in DISTANCES]
    tried = []

    def needing(least: _Numbers) -> _Numbers | None:
        def kept(one: _Numbers) -> bool:
            tried.append(one)
            return one.w_terms >= least.w_terms and one.s_nodes >= least.s_nodes and one.distance <= least.distance

        return _cheapest(numbers, kept)

    for least in (_Numbers(8, 14, 0.82), _Numbers(8, 16, 0.42), _Numbers(12, 14, 0.5), _Numbers(12, 16, 0.25)):
        tried.clear()
        assert needing(least) == least
        assert len(tried) <= 11
    assert needing(_Numbers(16, 14, 0.82)) is None
