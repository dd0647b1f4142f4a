"""A third layout is one entry of the registry and modules of its own: all commands work with it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cli.tool import REPOSITORY, SMALL, Result, toml

# the mirror direction, the first order of the grating and others
DIRECTIONS = "0,0,0,0\n30,0,30,180\n10,0,20,180\n40,20,15,100\n30,0,91,0\n"
BUNDLE = "out/third/third-*"
COMMANDS = {
    "plan": ["plan", "third.toml", "--json"],
    "run": ["run", "third.toml"],
    "verify": ["verify", BUNDLE],
    "bundle": ["eval", BUNDLE, "--directions", "directions.csv"],
    "config": ["eval", "third.toml", "--directions", "directions.csv"],
    "exact": ["eval", "third.toml", "--exact", "--directions", "directions.csv"],
    "wavelengths": ["eval", "third.toml", "--wavelengths", "550", "--directions", "directions.csv"],
    "unknown": ["plan", "unknown.toml"],
    "config schema": ["inspect", "--schema", "config"],
    "manifest schema": ["inspect", "--schema", "manifest"],
}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Result]]:
    """The folder in which the commands ran, and the result of each."""
    folder = tmp_path_factory.mktemp("third")
    for name in ("nearest", "unknown"):
        light = {"illuminant": {"lambda_nm": 550.0}}
        document = toml({**SMALL, "name": "third", "spectrum": light, "accuracy": {}, "table": {"layout": name}})
        (folder / f"{name.replace('nearest', 'third')}.toml").write_text(document, encoding="utf-8")
    (folder / "directions.csv").write_text(DIRECTIONS, encoding="utf-8")
    command = [sys.executable, "-m", "tests.layouts.program", str(folder)]
    ran = subprocess.run(
        command, input=json.dumps([*COMMANDS.values()]), cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    return folder, {name: Result(*result) for name, result in zip(COMMANDS, json.loads(ran.stdout), strict=True)}


def values(result: Result) -> np.ndarray:
    """Reads the rows that a command printed."""
    assert result.code == 0, result.stderr
    return np.array([[float(cell) for cell in line.split(",")] for line in result.stdout.splitlines()[1:]])


def test_it_is_planned(done: tuple[Path, dict[str, Result]]) -> None:
    stages = done[1]["plan"].json["third"]
    assert [s["stage"] for s in stages] == ["surface", "powers", "table", "textures", "render", "validate", "bundle"]
    assert "21² nodes" in stages[1]["work"]


def test_it_is_baked_and_published(done: tuple[Path, dict[str, Result]]) -> None:
    folder, results = done
    assert results["run"].code == 0, results["run"].stderr
    assert (results["verify"].code, results["verify"].stderr) == (0, "")
    (bundle,) = folder.glob(BUNDLE)
    manifest = json.loads((bundle / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["grid"] == {"layout": "nearest", "width": 21, "height": 21}
    readme = (bundle / "README.md").read_text(encoding="utf-8")
    assert "21 x 21 texels" in readme
    assert "const float N = 21.0;" in readme
    assert "nodes along an axis" in (bundle / "report.html").read_text(encoding="utf-8")


def test_it_is_evaluated(done: tuple[Path, dict[str, Result]]) -> None:
    """By the bundle, by the config, and by the bundle's own program, which holds this look-up alone."""
    folder, results = done
    found = values(results["bundle"])
    np.testing.assert_allclose(found, values(results["config"]), rtol=1e-6)
    # the mirror direction is a node
    np.testing.assert_allclose(found[0], values(results["exact"])[0], rtol=1e-3)
    assert found[0, 1] > 1.0
    assert np.all(found[4] == 0.0)
    (bundle,) = folder.glob(BUNDLE)
    program = [sys.executable, "-I", "-W", "error", "evaluate.py", str(folder / "directions.csv")]
    own = subprocess.run(program, cwd=bundle, capture_output=True, text=True, check=False)
    np.testing.assert_allclose(values(Result(own.returncode, own.stdout, own.stderr)), found, rtol=1e-9)
    text = (bundle / "evaluate.py").read_text(encoding="utf-8")
    assert "NearestTextures" in text
    assert not any(other in text for other in ("PolarTextures", "TaylorTextures", "pipeline"))


def test_documents_and_refusals_name_it(done: tuple[Path, dict[str, Result]]) -> None:
    results = done[1]
    assert '"NearestLayout"' in results["config schema"].stdout
    for entry in ("NearestGridEntry", "NearestImage", "NearestLoss"):
        assert f'"{entry}"' in results["manifest schema"].stdout
    (fault,) = results["unknown"].errors
    assert "expected a layout, one of polar, taylor, nearest, got {'layout': 'unknown'}" in fault
    assert results["wavelengths"].code == 2
