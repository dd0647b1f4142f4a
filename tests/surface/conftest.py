"""Reads scans in this process: a child for each costs half a second. test_limits.py reads them in children."""

from pathlib import Path

import pytest

from pipeline.surface.readers import limited, reading
from pipeline.surface.scan import Scan


@pytest.fixture(autouse=True)
def _read_in_this_process(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(path: Path, channel: str | None, _limits: limited.Limits) -> Scan:
        return reading.read(path, channel)

    if request.path.name != "test_limits.py":
        monkeypatch.setattr(limited, "_by_child", read)


@pytest.fixture
def surface_topography() -> None:
    """Skips a test where the library that reads most formats is absent."""
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
