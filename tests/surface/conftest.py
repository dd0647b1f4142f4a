"""Reads scans in this process: a child for each costs half a second. test_limits.py reads them in children."""

import pytest

from tests.support import read_scans_in_this_process


@pytest.fixture(autouse=True)
def _read_in_this_process(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.path.name != "test_limits.py":
        read_scans_in_this_process(monkeypatch)


@pytest.fixture
def surface_topography() -> None:
    """Skips a test where the library that reads most formats is absent."""
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
