"""A short sweep of mutated scans; `make fuzz` runs the long one."""

import subprocess
import sys
from pathlib import Path

import pytest


def test_mutated_scans_are_read_or_refused_in_one_line() -> None:
    """In a process of its own: copies of this one would have the memory of all tests before."""
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.fuzz.scans", "100", "1"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "100 mutations" in run.stdout
    assert " 0 faults" in run.stdout
