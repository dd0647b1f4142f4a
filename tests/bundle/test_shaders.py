"""The look-ups in GLSL compile for desktops and GLES, as files and with the constants of a bundle."""

import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import layouts
from pipeline.bundle import evaluator, readme
from pipeline.bundle.polar import look_up
from pipeline.bundle.verify import open_bundle
from pipeline.optics import geometry

from .conftest import LAYOUTS, Baker, publish, small

COMPILER = "glslangValidator"
needs_compiler = pytest.mark.skipif(
    shutil.which(COMPILER) is None, reason=f"{COMPILER} is not installed; Debian's package is glslang-tools"
)
VERSIONS = ("330", "460", "300 es", "320 es")
MAIN = """
float R(float cos_half) { return 0.04 + 0.96 * pow(1.0 - cos_half, 5.0); }
in vec3 light;
in vec3 view;
out vec4 colour;
void main() {
    bool computed;
    colour.rgb = diffraction(normalize(light), normalize(view), computed);
    colour.a = computed ? 1.0 : 0.0;
}
"""


def source(name: str) -> str:
    return files("kernels").joinpath("shaders", f"{name}.glsl").read_text(encoding="utf-8")


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
    assert compiled(source(layout) + source("brdf"), version, tmp_path) == ""


@needs_compiler
def test_a_fault_is_found(tmp_path: Path) -> None:
    text = (source("polar") + source("brdf")).replace("vec4 spline", "vec3 spline")
    assert "ERROR" in compiled(text, "330", tmp_path)


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
    text = readme.shader(layouts.bundled("taylor").shader, {"POWERS": 7, "N": 41.0, "A": 1e-5})
    for line in ("const int POWERS = 7;", "const float N = 41.0;", "const float A = 1e-05;"):
        assert line in text
    after = source("taylor").partition("uniform")[2]
    assert text.partition("uniform")[2] == after


@pytest.mark.parametrize("constants", [{"POWERS": 7, "N": 41.0}, {"POWERS": 7, "N": 41.0, "A": 1.0, "B": 2.0}])
def test_other_constants_than_the_files_are_refused(constants: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"taylor\.glsl declares \['A', 'N', 'POWERS'\]"):
        readme.shader(layouts.bundled("taylor").shader, constants)


def in_float32(bundle: evaluator.BundleTables, wi: np.ndarray, wr: np.ndarray) -> np.ndarray:
    """Transcribes polar.glsl and brdf.glsl, line by line and in float32, for Schlick's reflectance."""
    f, grid, material = np.float32, bundle.manifest["grid"], bundle.manifest["material"]
    texels, table = bundle.table.texels.astype(f), bundle.table
    rings, azimuths = grid["rings"], grid["azimuths"]
    terms, outputs = grid["w_terms"], texels.shape[1]
    uvw = -wi - wr
    rho = np.sqrt(uvw[:, 0] ** 2 + uvw[:, 1] ** 2)
    cos, sin = f(np.cos(grid["axis_rad"])), f(np.sin(grid["axis_rad"]))
    turned = cos * uvw[:, 0] + sin * uvw[:, 1], cos * uvw[:, 1] - sin * uvw[:, 0]
    ring = np.minimum(np.arcsinh(rho / f(grid["r0"])) / f(grid["step"]), f(rings - 1))
    turn = np.where(rho > 0, np.arctan2(turned[1], f(grid["stretch"]) * turned[0]) / f(6.28318531), f(0))
    azimuth = (turn - np.floor(turn)) * f(azimuths)
    found = np.zeros((len(wi), outputs), f)
    for a, across in enumerate(look_up.spline(ring - np.floor(ring))):
        row = ring.astype(int) - 1 + a
        knot = azimuth / table.every[table.mirrored(row) // 16].astype(f)
        for b, along in enumerate(look_up.spline(knot - np.floor(knot))):
            at = table.place(row, knot.astype(int) - 1 + b)
            found += (across * along)[:, None].astype(f) * texels[at]
    w_max = np.sqrt(np.maximum(f(4) - rho * rho, f(1e-6)))
    x = np.clip(f(2) * np.abs(uvw[:, 2]) / w_max - f(1), f(-1), f(1))
    chebyshev = [np.ones_like(x), x]
    for _ in range(2, terms):
        chebyshev.append(f(2) * x * chebyshev[-1] - chebyshev[-2])
    value = np.zeros((len(wi), 3), f)
    for o in range(outputs):
        value[:, o // terms] += found[:, o] * chebyshev[o % terms]
    value[rho > f(grid["rho_max"]) * f(1.000001)] = 0
    s = wi + wr
    one_plus_dot = f(0.5) * (s[:, 0] ** 2 + s[:, 1] ** 2 + s[:, 2] ** 2)
    over_w, f0 = one_plus_dot / s[:, 2], f(material["schlick_f0"])
    reflected = (f0 + (f(1) - f0) * (f(1) - np.sqrt(f(0.5) * one_plus_dot)) ** 5) / f(material["divisor"])
    c = reflected ** material["exponent"] * over_w * over_w / wr[:, 2]
    c = c * np.minimum(f(1), f(2) * s[:, 2] * np.minimum(wi[:, 2], wr[:, 2]) / one_plus_dot)
    xyz = np.maximum(c[:, None] * value, f(0))
    xyz[np.minimum(wi[:, 2], wr[:, 2]) <= 0] = 0
    assert xyz.dtype == f
    return xyz


def test_float32_keeps_five_digits_in_grazing_mirror_directions(bake: Baker, tmp_path: Path) -> None:
    """1 + wi.wr would lose 7 % there. The directions are rounded to float32 for both."""
    config = small("polar")
    bundle = open_bundle(publish(config, bake(config), tmp_path))
    theta = np.radians(np.concatenate([np.linspace(0.0, 89.0, 90), 90.0 - np.geomspace(1.0, 1e-3, 200)]))
    wi = geometry.direction(theta, np.linspace(0.0, 6.0, len(theta))).astype(np.float32)
    wr = wi * np.array([-1, -1, 1], np.float32)
    exact = bundle.xyz(wi.astype(float), wr.astype(float))
    assert np.all(exact > 0.0)
    # of the colour's largest channel, because a channel may vanish
    error = np.abs(in_float32(bundle, wi, wr) - exact) / exact.max(axis=1, keepdims=True)
    assert error.max() < 1e-5


def test_float32_is_dark_at_and_below_the_horizon(bake: Baker, tmp_path: Path) -> None:
    bundle = open_bundle(publish(small("polar"), bake(small("polar")), tmp_path))
    up, level, below = (np.array([v], np.float32) for v in ([0, 0, 1], [1, 0, 0], [0.6, 0, -0.8]))
    with np.errstate(all="ignore"):
        for wi, wr in ((up, level), (level, up), (level, -level), (up, below), (below, up), (below, -below)):
            assert np.all(in_float32(bundle, wi, wr) == 0.0)
