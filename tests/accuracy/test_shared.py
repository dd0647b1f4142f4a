"""The exact reference that several lights and materials share."""

import numpy as np
import pytest

from pipeline.accuracy.shared import SharedReference
from pipeline.diffraction.reference import Reference
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.scene.pairs import random_pairs
from pipeline.surface.heightfield import HeightField

RANGE = (540.0, 560.0)
SEEN = [
    (Light(range_nm=RANGE), Material()),
    (Light(illuminant="A", range_nm=RANGE), Material(fresnel="conductor")),
    (Light(illuminant="E", range_nm=RANGE), Material(fresnel="none", normalisation="relative")),
]
LINE = (Light(illuminant=LaserLine(lambda_nm=550.0)), Material())


@pytest.fixture(scope="module")
def field() -> HeightField:
    return HeightField(0.05 * np.random.default_rng(1).random((60, 70)), (0.1, 0.1))


def test_every_light_and_material_gets_the_answer_of_a_reference_of_its_own(field: HeightField) -> None:
    """To the last bit, whether it was computed with another's or for its own, and however often it is asked for."""
    wi, wr = random_pairs(None, 300, 5)
    shared = SharedReference(field, 1.0, 540.0)
    shared.following = [*SEEN[1:], LINE]
    for seen in (*SEEN, SEEN[0], SEEN[1], LINE):
        assert np.array_equal(shared.xyz(*seen, wi, wr), Reference(field, 1.0, 540.0).xyz(*seen, wi, wr))


def test_the_sums_of_one_set_of_directions_are_made_once(field: HeightField, monkeypatch: pytest.MonkeyPatch) -> None:
    """For all lights that follow; those of other directions, and of a light that was not announced, are made."""
    made = []
    power = Reference.power

    def counted(self: Reference, uvw: np.ndarray, lambda_nm: np.ndarray) -> np.ndarray:
        made.append(len(uvw))
        return power(self, uvw, lambda_nm)

    monkeypatch.setattr(Reference, "power", counted)
    wi, wr = random_pairs(None, 20, 5)
    shared = SharedReference(field, 1.0, 540.0)
    shared.following = SEEN[1:2]
    for seen in SEEN[:2]:
        shared.xyz(*seen, wi, wr)
    assert made == [20]
    shared.xyz(*SEEN[1], wi[:10], wr[:10])
    shared.xyz(*SEEN[2], wi, wr)
    assert made == [20, 10, 20]


def test_answers_are_kept_while_they_are_expected(field: HeightField) -> None:
    wi, wr = random_pairs(None, 20, 5)
    shared = SharedReference(field, 1.0, 540.0)
    alone = shared.nbytes
    shared.following = SEEN[1:]
    shared.xyz(*SEEN[0], wi, wr)
    assert shared.nbytes == alone + 2 * 20 * 3 * 8
    shared.following = SEEN[2:]
    shared.xyz(*SEEN[1], wi, wr)
    assert shared.nbytes == alone + 20 * 3 * 8
