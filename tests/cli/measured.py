"""Bakes a config in a process of its own and prints what every stage was predicted to need, and what it took.

As a script: its arguments are the config as JSON, and the last stage.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from pipeline.config import read
from pipeline.stages import forecast, run
from pipeline.store.store import Store


def peaks(config: dict[str, Any], until: str) -> dict[str, tuple[float, float]]:
    """Bakes a config in another process; returns (predicted, measured) MiB by stage."""
    command = [sys.executable, "-m", "tests.cli.measured", json.dumps(config), until]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
    return {name: (pair[0], pair[1]) for name, pair in json.loads(finished.stdout).items()}


def _peak_bytes() -> int:
    """Returns the most memory that this process held since the last call."""
    found = re.search(r"^VmHWM:\s+(\d+) kB$", Path("/proc/self/status").read_text(encoding="ascii"), re.MULTILINE)
    assert found is not None
    # 5 resets the high-water mark
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    return 1024 * int(found[1])


def _bake(document: dict[str, Any], until: str, store: Store) -> dict[str, tuple[float, float]]:
    config = read.parse(document, "measured", Path.cwd())
    steps = run.plan(config, store, until)
    predicted, measured = forecast.needs(config, {}), {}

    def on_step(step: run.Step, _seconds: float | None) -> None:
        measured[step.stage.name] = _peak_bytes()
        # what follows the search for a grid is predicted from the grid that was found, and so is the search itself
        if step.stage.name == "power_spectrum":
            predicted.update(forecast.needs(config, run.summaries(steps, store)))

    _peak_bytes()
    run.execute(config, steps, store, on_step=on_step)
    return {name: (predicted[name].bytes / 2**20, bytes_ / 2**20) for name, bytes_ in measured.items()}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(_bake(json.loads(sys.argv[1]), sys.argv[2], Store(Path(folder)))))
