"""Mutated bundles end in exit 0 or 6, quickly and in little memory: a short part of `make fuzz-bundles`."""

import os
import subprocess
import sys
from pathlib import Path

from pipeline.store.store import Store
from tests.bundle.conftest import LAYOUTS, SCENE, Baker, publish, small

ROOT = Path(__file__).resolve().parents[2]


def test_mutated_bundles_are_refused_or_used(tmp_path: Path) -> None:
    baker = Baker(Store(tmp_path / "store"))
    configs = [small(layout) for layout in LAYOUTS]
    configs.append(small("polar", scene=SCENE, render={"lights": SCENE["lights"]}))
    bundles = [publish(config, baker(config), tmp_path / str(i)) for i, config in enumerate(configs)]
    # its processes fork, which one with OpenCL's threads must not
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.bundles", "--count", "40", "--seed", "7", *map(str, bundles)],
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 wrong" in done.stdout
