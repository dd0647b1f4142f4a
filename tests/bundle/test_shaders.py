"""The look-ups in GLSL compile for desktops and GLES, as files and with the constants of a bundle."""

import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from pipeline.bundle import readme

from .conftest import LAYOUTS, Baker, publish, small

COMPILER = "glslangValidator"
needs_compiler = pytest.mark.skipif(
    shutil.which(COMPILER) is None, reason=f"{COMPILER} is not installed; Debian's package is glslang-tools"
)
VERSIONS = ("330", "460", "300 es", "320 es")
MAIN = """
float C(vec3 wi, vec3 wr) { return pow(1.0 + dot(wi, wr), 2.0) / (wi.z * wr.z * pow(wi.z + wr.z, 2.0)); }
in vec3 light;
in vec3 view;
out vec4 colour;
void main() { colour = vec4(diffraction(normalize(light), normalize(view)), 1.0); }
"""


def source(layout: str) -> str:
    return files("kernels").joinpath("shaders", f"{layout}.glsl").read_text(encoding="utf-8")


def compiled(text: str, version: str, folder: Path) -> str:
    """Compiles and links a fragment shader that calls the look-up; returns the printed faults, '' if it has none."""
    shader = folder / "look_up.frag"
    shader.write_text(f"#version {version}\n{text}{MAIN}", encoding="utf-8")
    done = subprocess.run([COMPILER, "-l", str(shader)], capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == ("ERROR" not in done.stdout + done.stderr)
    return done.stdout.replace(str(shader), "").strip()


@needs_compiler
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_files_compile(layout: str, version: str, tmp_path: Path) -> None:
    assert compiled(source(layout), version, tmp_path) == ""


@needs_compiler
def test_a_fault_is_found(tmp_path: Path) -> None:
    assert "ERROR" in compiled(source("polar").replace("vec4 spline", "vec3 spline"), "330", tmp_path)


@needs_compiler
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("layout", "keys"),
    [("taylor", {}), ("polar", {}), ("polar", {"textures": 2, "precision": "half"})],
    ids=["taylor", "polar", "low rank"],
)
def test_the_look_up_in_a_readme_compiles(
    bake: Baker, layout: str, keys: dict[str, Any], version: str, tmp_path: Path
) -> None:
    config = small(layout, publish=keys)
    folder = publish(config, bake(config), tmp_path)
    text = (folder / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"^```glsl\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert shown is not None
    assert compiled(shown[1], version, tmp_path) == ""
    assert ("const bool LOW_RANK = true;" in shown[1]) == ("textures" in keys)


def test_a_tables_constants_replace_those_of_the_file() -> None:
    text = readme.shader("taylor", {"POWERS": 7, "N": 41.0, "A": 1e-5})
    for line in ("const int POWERS = 7;", "const float N = 41.0;", "const float A = 1e-05;"):
        assert line in text
    after = source("taylor").partition("uniform")[2]
    assert text.partition("uniform")[2] == after


@pytest.mark.parametrize("constants", [{"POWERS": 7, "N": 41.0}, {"POWERS": 7, "N": 41.0, "A": 1.0, "B": 2.0}])
def test_other_constants_than_the_files_are_refused(constants: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"taylor\.glsl declares \['A', 'N', 'POWERS'\]"):
        readme.shader("taylor", constants)
