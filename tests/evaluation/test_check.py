"""A check's verdict follows from its numbers."""

import json

import numpy as np
import pytest

from pipeline.evaluation.check import Check


@pytest.mark.parametrize(
    ("relation", "value", "verdict"),
    [
        ("<=", 1.0, "holds"),
        ("<", 1.0, "misses"),
        (">=", 1.0, "holds"),
        (">", 1.0, "misses"),
        ("<=", 1.1, "misses"),
        (">", 1.1, "holds"),
        ("<=", float("nan"), "misses"),
    ],
)
def test_a_bound_is_compared(relation, value, verdict):
    assert Check("a", "a", value, relation, 1.0).verdict == verdict


def test_a_value_is_compared_within_its_tolerance():
    assert Check("a", "a", 2.51, "=", 2.5, tolerance=0.02).verdict == "holds"
    assert Check("a", "a", 2.53, "=", 2.5, tolerance=0.02).verdict == "misses"


def test_what_has_nothing_to_be_judged_by_is_reported():
    assert Check("a", "a", 2.5).verdict == "reported"
    assert Check("a", "a", 2.5, "=", 2.4).verdict == "reported"
    assert Check("a", "a", None, "<=", 1.0).verdict == "not measured"


def test_text_and_json_come_from_the_numbers():
    check = Check("speed.first", "compiling", np.float32(2.5), "<=", 3.0, unit="s")
    assert (check.expected, check.measured) == ("≤ 3 s", "2.5 s")
    assert json.loads(json.dumps(check.document()))["verdict"] == "holds"
    assert Check("a", "a", 2.5, "=", 2.5, tolerance=0.25, unit="um").expected == "2.5 ± 0.25 um"


def test_texts_show_the_digits_that_tell_value_and_bound_apart():
    check = Check("a", "a", 2500.01, "=", 2500.0, tolerance=0.05, unit="nm")
    assert (check.expected, check.measured) == ("2500 ± 0.05 nm", "2500.01 nm")
    assert Check("a", "a", 2500.0, "=", 2500.0).measured == "2500"
