"""Plans that keep their budget, and certificates that say whether they did."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.accuracy import certificate
from pipeline.accuracy.exact import reference_of
from pipeline.config.models import Config
from pipeline.config.read import parse
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.reference import MeanReference
from pipeline.errors import AccuracyError
from pipeline.optics import geometry
from pipeline.surface import recipes, windows
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.planning import anisotropy as scattering
from pipeline.tables.planning import plan
from pipeline.tables.polar import table as polar

pytestmark = pytest.mark.slow

SIGMA = 2.0


def config(**sections) -> Config:
    recipe = {"kind": "elaphe", "size_um": 12, "pitch_um": 0.1, "height_um": 0.3}
    document = {"name": "a", "surface": {"recipe": recipe}, "coherence": {"sigma_um": SIGMA}, **sections}
    return parse(document, "a.toml", Path())


def field_of(found: Config) -> HeightField:
    return recipes.make(found.surface.recipe)


def exact_of(found: Config) -> MeanReference:
    return reference_of(field_of(found), found)


def planned(found: Config) -> tuple[polar.PolarTable, plan.Plan]:
    budget = plan.Budget(found.budget_delta_e, found.accuracy.exposure_ru)
    sigma = found.coherence.sigma_um
    fields = windows.places(field_of(found), found.coherence)
    trial = plan.start(fields, sigma, found.light, found.scene, budget, found.table)
    chosen = plan.choose(trial, found.scene, budget, found.table)
    power = trial.mean_power_spectrum(chosen.azimuths, fields[1:])
    bake = chosen.bake(found.radiometry, budget, found.table)
    return bake.table(power, chosen.rings, bake.rules(chosen.rings.rho())), chosen


@pytest.mark.parametrize("delta_e", [1.0, 0.1])
def test_a_plan_keeps_its_budget_on_directions_it_never_saw(delta_e: float) -> None:
    found = config(accuracy={"delta_e": delta_e})
    table, _ = planned(found)
    certified = certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)
    assert certified.measured <= delta_e
    assert certified.random.directions == 2000
    assert certified.reference.maximum < 1e-6
    assert [e.exposure_ru for e in certified.random.colour] == [1.0, 1000.0, 7500.0]


def test_a_finer_budget_costs_more_texels_and_nodes() -> None:
    rough, fine = (planned(config(accuracy={"delta_e": e}))[1] for e in (2.0, 0.1))
    assert fine.texels > 2 * rough.texels
    assert fine.s_nodes >= rough.s_nodes


def test_what_is_set_is_kept() -> None:
    found = config(table={"rings": 20, "azimuths": 160, "w_terms": 4, "terms": 20})
    table, chosen = planned(found)
    assert (chosen.rings.count, chosen.azimuths.count, chosen.w_terms) == (20, 160, 4)
    assert chosen.terms == 20
    assert chosen.probed_delta_e is None
    assert table.values.shape == (20, 3, 4, 160)


def test_one_axis_that_is_set_stays_while_the_other_is_searched() -> None:
    _, chosen = planned(config(table={"rings": 36}, accuracy={"delta_e": 1.0}))
    assert chosen.rings.count == 36
    _, chosen = planned(config(table={"azimuths": 320}, accuracy={"delta_e": 1.0}))
    assert chosen.azimuths.count == 320
    assert chosen.probed_delta_e is not None


def test_a_flat_mirror_is_planned_for_its_lobe() -> None:
    recipe = {"kind": "mirror", "size_um": 6.4, "pitch_um": 0.1}
    found = config(surface={"recipe": recipe}, coherence={"sigma_um": 1.6}, accuracy={"delta_e": 0.5})
    table, _ = planned(found)
    assert certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found).measured <= 0.5


def test_a_table_that_misses_its_budget_gets_no_certificate() -> None:
    found = config(table={"rings": 12, "azimuths": 32})
    table, _ = planned(found)
    with pytest.raises(AccuracyError, match=r"misses its budget.*accuracy\.delta_e allows 0\.1"):
        certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)


def test_a_budget_missed_beside_a_coarse_pitch_names_it() -> None:
    """What a pitch of 0.1 um knows ends at 5 per um, views reach 5.26; at 0.09 um they reach nothing unknown."""
    for pitch, named in ((0.1, True), (0.09, False)):
        recipe = {"kind": "sinusoid", "size_um": 9, "pitch_um": pitch, "period_um": 0.9}
        found = config(surface={"recipe": recipe}, table={"rings": 12, "azimuths": 32})
        table, _ = planned(found)
        with pytest.raises(AccuracyError) as missed:
            certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)
        assert ("bright at 5 per um" in str(missed.value)) == named


def test_the_certificate_sees_a_table_turned_the_wrong_way() -> None:
    """A sign that mirrors every blaze is no small error."""
    found = config(surface={"recipe": {"kind": "blazed", "size_um": 12, "pitch_um": 0.1}})
    table, _ = planned(found)
    evaluate = table_evaluator(table, found.radiometry)
    certificate.certify(evaluate, exact_of(found), found)
    with pytest.raises(AccuracyError, match="misses"):
        certificate.certify(lambda wi, wr: evaluate(wi * [-1, 1, 1], wr * [-1, 1, 1]), exact_of(found), found)


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


def test_a_laser_line_is_kept_too() -> None:
    found = config(spectrum={"illuminant": {"lambda_nm": 633.0}}, accuracy={"delta_e": 0.5})
    table, _ = planned(found)
    assert certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found).measured <= 0.5


@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_gold_is_integrated_with_its_own_reflectance(normalisation: str) -> None:
    material = {"fresnel": "conductor", "metal": "Au", "normalisation": normalisation}
    found = config(material=material, accuracy={"delta_e": 0.3})
    table, _ = planned(found)
    assert certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found).measured <= 0.3


def test_the_axis_of_a_grating_is_found_at_any_angle() -> None:
    y, x = np.mgrid[-60:60, -60:60] * 0.1
    for angle in (0.0, 35.0, 90.0):
        along = x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle))
        field = HeightField(0.05 * np.cos(2.0 * np.pi * along / 1.2), (0.1, 0.1))
        stretch, axis = scattering.anisotropy(power_spectrum.chebyshev_stack(field, SIGMA, 5.3, 16, 1e-5))
        apart = np.angle(np.exp(2j * (axis - np.radians(angle)))) / 2.0
        assert abs(np.degrees(apart)) < 2.0
        # seams of a turned grating scatter too
        assert stretch < 0.65


def test_an_isotropic_surface_is_not_stretched() -> None:
    rng = np.random.default_rng(4)
    field = HeightField(rng.normal(0.0, 0.03, (120, 120)), (0.1, 0.1))
    stretch, _ = scattering.anisotropy(power_spectrum.chebyshev_stack(field, SIGMA, 4.9, 16, 1e-5))
    assert stretch > 0.95
