"""The page in the bundle is the tool's own look-up."""

import ast
import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.bundle import material
from pipeline.bundle.open import bundle_evaluator
from pipeline.bundle.publish import publish
from pipeline.config import Config
from pipeline.evaluate import table_evaluator
from pipeline.optics import brdf, geometry
from pipeline.optics.spectra import trapezoid
from pipeline.stages import table as table_stage
from pipeline.validation import random_pairs

from .conftest import SCENE, Baker, small

MODELS = list(
    itertools.product(("none", "schlick", "dielectric", "conductor"), ("relative", "absolute"), (True, False))
)


@pytest.mark.parametrize(("fresnel", "normalisation", "shadowing"), MODELS)
def test_it_is_the_tools_look_up(
    bake: Baker, tmp_path: Path, fresnel: str, normalisation: str, shadowing: bool
) -> None:
    config = small(material={"fresnel": fresnel, "normalisation": normalisation, "shadowing": shadowing})
    inputs = bake(config)
    wi, wr = random_pairs(config, 20000)
    expected = table_evaluator(table_stage.load(inputs["table"]), config)(wi, wr)
    found = bundle_evaluator(publish(config, inputs, tmp_path))(wi, wr)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0.0)


def test_what_the_scene_leaves_out_is_nan(bake: Baker, tmp_path: Path) -> None:
    config = small(scene=SCENE, render={"lights": SCENE["lights"]})
    inputs = bake(config)
    wi, wr = random_pairs(small(), 500)
    expected = table_evaluator(table_stage.load(inputs["table"]), config)(wi, wr)
    found = bundle_evaluator(publish(config, inputs, tmp_path))(wi, wr)
    assert 0 < np.isnan(found).sum() < found.size
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0.0)


def test_the_horizon_is_refused(bake: Baker, tmp_path: Path) -> None:
    evaluate = bundle_evaluator(publish(small(), bake(small()), tmp_path))
    up, level = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    for pair in ((up, level), (level, up)):
        with pytest.raises(ValueError, match="horizon"):
            evaluate(*pair)
    assert evaluate(up[:0], up[:0]).shape == (0, 3)


def metal(**keys: object) -> Config:
    return small(material={"fresnel": "conductor", **keys})


@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_a_shaders_table_of_the_metal_is_as_exact_as_told(normalisation: str) -> None:
    config = metal(normalisation=normalisation, shadowing=False)
    entry, medium = material.entry(config), material.medium(config)
    assert entry.reflectance_table is not None
    assert medium is not None
    wi, wr = random_pairs(config, 2000)
    exact = brdf.direction_factor(config.material, trapezoid(config.spectrum, 5.0), wi, wr)
    exact /= brdf.geometry_factor(config.material, wi, wr)
    shader = np.interp(geometry.cos_half(wi, wr), *material.reflectance_table(medium)) / entry.divisor
    error = np.abs(shader - exact).max() * entry.divisor
    assert 0.0 < error <= entry.reflectance_table.largest_error < 1e-4


def test_a_metals_bundle_holds_its_table(bake: Baker, tmp_path: Path) -> None:
    folder = publish(metal(), bake(metal()), tmp_path)
    rows = np.loadtxt(folder / "reflectance.csv", delimiter=",", skiprows=1)
    assert rows.shape == (257, 2)
    # every smooth interface reflects all at grazing incidence
    assert rows[0] == pytest.approx([0.0, 1.0])
    assert "reflectance.csv" in (folder / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def bundle(bake: Baker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return publish(small(), bake(small()), tmp_path_factory.mktemp("out"))


def run(bundle: Path, argument: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-I", "-W", "error", "evaluate.py", str(argument)]
    return subprocess.run(command, cwd=bundle, capture_output=True, text=True, check=False)


def test_it_runs_as_a_script(bundle: Path, tmp_path: Path) -> None:
    csv = tmp_path / "directions.csv"
    csv.write_text("theta_i,phi_i,theta_r,phi_r\n# a comment\n0,0,0,0\n\n30, 10, 40, -170\n60,0,0,90\n")
    done = run(bundle, csv)
    assert (done.returncode, done.stderr) == (0, "")
    header, *lines = done.stdout.splitlines()
    assert header == "X,Y,Z"
    wi = geometry.direction(np.radians([0, 30, 60]), np.radians([0, 10, 0]))
    wr = geometry.direction(np.radians([0, 40, 0]), np.radians([0, -170, 90]))
    found = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    np.testing.assert_allclose(found, bundle_evaluator(bundle)(wi, wr), rtol=1e-11)


@pytest.mark.parametrize("row", ["0,0,90,0", "1,2,3", "0,0,-1,0", "0,0,x,0", "0,nan,0,0"])
def test_it_refuses_rows_that_are_no_directions(bundle: Path, tmp_path: Path, row: str) -> None:
    csv = tmp_path / "directions.csv"
    csv.write_text(f"{row}\n", encoding="utf-8")
    done = run(bundle, csv)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"{csv}: ")
    assert "Traceback" not in done.stderr


def test_it_needs_numpy_and_openexr_alone(bundle: Path) -> None:
    text = (bundle / "evaluate.py").read_text(encoding="utf-8")
    tree = ast.walk(ast.parse(text))
    modules = set()
    for node in tree:
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            modules.add(str(node.module))
    assert {name.split(".")[0] for name in modules} - sys.stdlib_module_names == {"numpy", "OpenEXR"}
    assert len(text.splitlines()) <= 130
