"""Certificates: planned tables keep their budget, and tables that miss it are refused."""

from typing import Any

import pytest

from pipeline.accuracy.checks import check_border, check_flank
from pipeline.errors import AccuracyError
from pipeline.stages.polar import certificate
from pipeline.tables.evaluate import table_evaluator
from tests.tables.planned import config, exact_of, planned

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("delta_e", [1.0, 0.1])
def test_a_planned_table_keeps_its_budget_on_random_directions(delta_e: float) -> None:
    found = config(accuracy={"delta_e": delta_e})
    table, _ = planned(found)
    certified = certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)
    assert certified.measured <= delta_e
    assert certified.random.directions == 2000
    assert certified.reference.maximum < 1e-6
    assert [e.exposure_ru for e in certified.random.colour] == [1.0, 1000.0, 7500.0]


def test_a_planned_table_keeps_the_flank_of_the_specular_lobe() -> None:
    """Few random directions lie there, so that a table of the same mean error may miss it."""
    found = config()
    reference, errors = exact_of(found), []
    for sections in ({}, {"table": {"rings": 60, "azimuths": 640}}):
        table, _ = planned(config(**sections))
        flank = check_flank(table_evaluator(table, found.radiometry), reference, found)
        assert flank is not None
        assert flank.kept == (flank.colour.maximum <= 5.0)
        assert flank.largest.delta_e == flank.colour.maximum
        assert flank.largest.lobe_widths <= flank.lobe_widths
        assert flank.largest.reason == "flank of the specular lobe"
        errors.append(flank.colour.maximum)
    assert errors[0] <= 5.0 < errors[1]


def test_lights_whose_mirror_direction_is_not_seen_have_no_flank() -> None:
    found = config(scene={"lights": [{"theta_deg": 60}], "views": {"theta_max_deg": 20}})
    assert check_flank(exact_of(found).xyz, exact_of(found), found) is None


@pytest.mark.parametrize(
    "scene",
    [
        {"lights": [{"kind": "sun", "theta_deg": 30}], "views": {"theta_max_deg": 40}},
        # half of its border is at the largest |(u, v)|
        {"lights": [{"theta_deg": 0}], "views": {"theta_max_deg": 15}},
        # few pairs lie on its border
        {"lights": [{"kind": "range", "theta_deg": [0, 60]}]},
    ],
)
def test_the_border_of_a_scene_is_measured_apart_and_within_the_budget(scene: dict[str, Any]) -> None:
    """The mean error is 0.24 and 0.19 on the first two if the spline is mirrored at the largest |(u, v)|."""
    found = config(scene=scene)
    table, _ = planned(found)
    border = check_border(table_evaluator(table, found.radiometry), exact_of(found), found)
    assert border is not None
    assert 250 <= border.directions <= 400
    assert next(error.mean for error in border.colour if error.exposure_ru == 7500.0) <= 0.1
    assert check_border(table_evaluator(table, found.radiometry), exact_of(found), config()) is None


def test_a_table_that_misses_its_budget_is_refused() -> None:
    found = config(table={"rings": 12, "azimuths": 32})
    table, _ = planned(found)
    with pytest.raises(AccuracyError, match=r"misses its budget.*accuracy\.delta_e allows 0\.1"):
        certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)


def test_the_refusal_names_a_coarse_pitch() -> None:
    """A pitch of 0.1 um has its Nyquist limit at 5 per um, below the 5.26 that views reach; one of 0.09 um above."""
    for pitch, named in ((0.1, True), (0.09, False)):
        recipe = {"kind": "sinusoid", "size_um": 9, "pitch_um": pitch, "period_um": 0.9}
        found = config(surface={"recipe": recipe}, table={"rings": 12, "azimuths": 32})
        table, _ = planned(found)
        with pytest.raises(AccuracyError) as missed:
            certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found)
        assert ("bright at 5 per um" in str(missed.value)) == named


def test_a_mirrored_table_is_refused() -> None:
    """The wrong sign of the transform mirrors every blazed grating."""
    found = config(surface={"recipe": {"kind": "blazed", "size_um": 12, "pitch_um": 0.1}})
    table, _ = planned(found)
    evaluate = table_evaluator(table, found.radiometry)
    certificate.certify(evaluate, exact_of(found), found)
    with pytest.raises(AccuracyError, match="misses"):
        certificate.certify(lambda wi, wr: evaluate(wi * [-1, 1, 1], wr * [-1, 1, 1]), exact_of(found), found)


def test_a_table_of_a_laser_line_keeps_its_budget() -> None:
    found = config(spectrum={"illuminant": {"lambda_nm": 633.0}}, accuracy={"delta_e": 0.5})
    table, _ = planned(found)
    assert certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found).measured <= 0.5


@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_a_table_of_gold_keeps_its_budget(normalisation: str) -> None:
    material = {"fresnel": "conductor", "metal": "Au", "normalisation": normalisation}
    found = config(material=material, accuracy={"delta_e": 0.3})
    table, _ = planned(found)
    assert certificate.certify(table_evaluator(table, found.radiometry), exact_of(found), found).measured <= 0.3
