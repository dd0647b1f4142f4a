"""The evaluator that is shipped in a bundle agrees with the look-up of the tool."""

import ast
import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline import layouts
from pipeline.arrays import Array
from pipeline.bundle import material
from pipeline.bundle.polar import look_up, storage
from pipeline.bundle.polar.prepare import grid_entry
from pipeline.bundle.verify import open_bundle
from pipeline.config.models import Config
from pipeline.diffraction import tiles
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.optics import brdf, geometry
from pipeline.optics.light import trapezoid
from pipeline.scene.pairs import random_pairs
from pipeline.tables.evaluate import interpolator, table_evaluator
from pipeline.tables.polar.compression import whole
from pipeline.tables.polar.table import PolarTable

from .conftest import LAYOUTS, SCENE, Baker, publish, small

MODELS = list(
    itertools.product(("none", "schlick", "dielectric", "conductor"), ("relative", "absolute"), (True, False))
)
SEED = 3


def both(bake: Baker, config: Config, out: Path, wi: Array, wr: Array) -> tuple[Array, Array]:
    """Computes XYZ by the bundle's evaluator and by the tool, over Y of a mirror."""
    inputs = bake(config)
    expected = interpolator(layouts.of(config.table).load(inputs["table"]), config.radiometry)(wi, wr)
    found = open_bundle(publish(config, inputs, out)).signed(wi, wr)
    mirror = config.radiometry.mirror_luminance(wi, wr)[:, None]
    return found / mirror, expected / mirror


@pytest.mark.parametrize(("fresnel", "normalisation", "shadowing"), MODELS)
def test_it_is_the_tools_look_up(
    bake: Baker, tmp_path: Path, fresnel: str, normalisation: str, shadowing: bool
) -> None:
    config = small(material={"fresnel": fresnel, "normalisation": normalisation, "shadowing": shadowing})
    found, expected = both(bake, config, tmp_path, *random_pairs(None, 20000, SEED))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("fresnel", "normalisation"), [("schlick", "relative"), ("conductor", "absolute")])
def test_it_is_the_tools_polar_look_up(bake: Baker, tmp_path: Path, fresnel: str, normalisation: str) -> None:
    config = small("polar", material={"fresnel": fresnel, "normalisation": normalisation})
    wi, wr = random_pairs(None, 20000, SEED)
    # the mirror direction and directions next to it use ring 0 and its mirror images, the rim those beyond the last
    tilted, level = geometry.direction(1.2, np.linspace(0.0, 6.0, 50)), geometry.direction(1.57, np.array([0.7, 0.7]))
    wi = np.concatenate([wi, tilted, tilted, level])
    wr = np.concatenate(
        [wr, tilted * [-1, -1, 1], geometry.direction(1.21, np.linspace(0.0, 6.0, 50) + np.pi), level]
    )
    found, expected = both(bake, config, tmp_path, wi, wr)
    # the tool's kernel sums in float32
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)
    assert found.max() > 0.1


def test_a_table_without_symmetry_is_looked_up_equally() -> None:
    """Noise on a turned and stretched grid tests every rule of the grid, at its origin and its rim as well."""
    rng = np.random.default_rng(5)
    values = rng.normal(size=(24, 3, 4, 96)).astype(np.float32)
    table = PolarTable(values, tiles.whole(PolarGrid(Rings(24, 0.3), Azimuths(96, 0.7, 0.4))))
    rho, phi = 2.0 * np.sqrt(rng.random(5000)), 2.0 * np.pi * rng.random(5000)
    rho[:500], rho[500:1000] = 0.1 * rng.random(500), 2.0 - 0.1 * rng.random(500)
    w = -np.sqrt(4.0 - rho**2) * rng.random(5000)
    uvw = np.stack([rho * np.cos(phi), rho * np.sin(phi), w])
    textures = whole(table)
    stored = storage.store(textures, "float")
    planes = [np.moveaxis(stored.values[4 * q : 4 * q + 4], 0, -1) for q in range(textures.count)]
    page = look_up.PolarTextures(
        grid_entry(textures, stored.atlas).model_dump(), planes, [[1.0] * 4] * textures.count
    )
    np.testing.assert_allclose(page.value(*uvw), table.look_up(uvw.T), atol=2e-4)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_directions_outside_the_scene_are_nan(bake: Baker, tmp_path: Path, layout: str) -> None:
    config = small(layout, scene=SCENE, render={"lights": SCENE["lights"]})
    found, expected = both(bake, config, tmp_path, *random_pairs(None, 500, SEED))
    assert 0 < np.isnan(found).sum() < found.size
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_nothing_is_reflected_at_and_below_the_horizon(bake: Baker, tmp_path: Path, layout: str) -> None:
    config = small(layout)
    inputs = bake(config)
    xyz = open_bundle(publish(config, inputs, tmp_path)).xyz
    tool = table_evaluator(layouts.of(config.table).load(inputs["table"]), config.radiometry)
    up, level, below = (geometry.direction(t, 0.3)[None] for t in (0.0, 0.5 * np.pi, 2.0))
    level = level * [1.0, 1.0, 0.0]
    for pair in itertools.product((up, level, below), repeat=2):
        for evaluate in (xyz, tool):
            found = evaluate(*pair)
            lit = all(one is up for one in pair)
            assert found[0, 1] > 0.0 if lit else np.all(found == 0.0)
    assert np.all(xyz(below, -below) == 0.0)
    assert xyz(up[:0], up[:0]).shape == (0, 3)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_was_not_computed_is_nan_and_no_colour_negative(bake: Baker, tmp_path: Path, layout: str) -> None:
    config = small(layout, scene=SCENE, render={"lights": SCENE["lights"]})
    bundle = open_bundle(publish(config, bake(config), tmp_path))
    pairs = random_pairs(None, 3000, SEED)
    signed, shown = bundle.signed(*pairs), bundle.xyz(*pairs)
    assert 0 < np.isnan(signed).sum() < signed.size
    np.testing.assert_array_equal(shown, np.where(signed < 0.0, 0.0, signed))


def metal(**keys: object) -> Config:
    return small(material={"fresnel": "conductor", **keys})


@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_the_metals_table_for_shaders_is_as_exact_as_the_manifest_states(normalisation: str) -> None:
    config = metal(normalisation=normalisation, shadowing=False)
    entry, medium = material.entry(config), material.medium(config)
    assert entry.reflectance_table is not None
    assert medium is not None
    wi, wr = random_pairs(None, 2000, SEED)
    exact = brdf.direction_factor(config.material, trapezoid(config.light, 5.0), wi, wr)
    exact /= brdf.geometry_factor(config.material, wi, wr)
    shader = np.interp(geometry.cos_half(wi, wr), *material.reflectance_table(medium)) / entry.divisor
    error = np.abs(shader - exact).max() * entry.divisor
    assert 0.0 < error <= entry.reflectance_table.largest_error < 1e-4


def test_a_metals_bundle_holds_its_table(bake: Baker, tmp_path: Path) -> None:
    folder = publish(metal(), bake(metal()), tmp_path)
    rows = np.loadtxt(folder / "reflectance.csv", delimiter=",", skiprows=1)
    assert rows.shape == (257, 2)
    # every smooth interface reflects all light at grazing incidence
    assert rows[0] == pytest.approx([0.0, 1.0])
    assert "reflectance.csv" in (folder / "README.md").read_text(encoding="utf-8")


def test_a_polar_table_holds_the_metal_itself(bake: Baker, tmp_path: Path) -> None:
    config = small("polar", material={"fresnel": "conductor", "normalisation": "absolute"})
    folder = publish(config, bake(config), tmp_path)
    assert not (folder / "reflectance.csv").exists()
    assert "inside the table" in (folder / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module", params=LAYOUTS)
def bundle(bake: Baker, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    config = small(request.param)
    return publish(config, bake(config), tmp_path_factory.mktemp("out"))


def run(bundle: Path, argument: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-I", "-W", "error", "evaluate.py", str(argument)]
    return subprocess.run(command, cwd=bundle, capture_output=True, text=True, check=False)


def test_it_runs_as_a_script(bundle: Path, tmp_path: Path) -> None:
    csv = tmp_path / "directions.csv"
    csv.write_text("theta_i,phi_i,theta_r,phi_r\n# a comment\n0,0,0,0\n\n30, 10, 40, -170\n60,0,0,90\n")
    done = run(bundle, csv)
    assert done.returncode == 0
    header, *lines = done.stdout.splitlines()
    assert header == "X,Y,Z"
    wi = geometry.direction(np.radians([0, 30, 60]), np.radians([0, 10, 0]))
    wr = geometry.direction(np.radians([0, 40, 0]), np.radians([0, -170, 90]))
    found = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    np.testing.assert_allclose(found, open_bundle(bundle).xyz(wi, wr), rtol=1e-11)
    negative = int(np.sum(np.any(open_bundle(bundle).signed(wi, wr) < 0.0, axis=1)))
    assert done.stderr == (f"{negative} of 3 rows were negative, now 0\n" if negative else "")


@pytest.mark.parametrize("row", ["", "0,0,181,0", "1,2,3", "0,0,-1,0", "0,0,x,0", "0,nan,0,0"])
def test_it_refuses_rows_that_are_not_directions(bundle: Path, tmp_path: Path, row: str) -> None:
    csv = tmp_path / "directions.csv"
    csv.write_text(f"{row}\n", encoding="utf-8")
    done = run(bundle, csv)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"{csv}: ")
    assert "Traceback" not in done.stderr


def test_it_needs_only_numpy_and_openexr(bundle: Path) -> None:
    text = (bundle / "evaluate.py").read_text(encoding="utf-8")
    modules = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            modules.add(str(node.module))
    assert {name.split(".")[0] for name in modules} - sys.stdlib_module_names == {"numpy", "OpenEXR"}
    assert len(text.splitlines()) <= 195
