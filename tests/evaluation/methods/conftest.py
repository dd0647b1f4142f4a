"""Fixtures of the tests of methods."""

import pytest

from pipeline.surface.heightfield import HeightField
from tests.evaluation.methods.surfaces import ELAPHE, made


@pytest.fixture(scope="module")
def elaphe() -> HeightField:
    return made(ELAPHE)
