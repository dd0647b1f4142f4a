"""The examples run as they stand, and the API gives what the command gives."""

import csv
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline import Bundle, bake, load_scan
from pipeline.bundle.evaluator import BundleTables
from pipeline.config.models import Config
from pipeline.errors import AccuracyError, BakeError, ConfigError, DamagedError, InputError, StorageError
from pipeline.optics.geometry import direction
from tests.cli.tool import REPOSITORY, Tool, flip_a_byte
from tests.schemas import faults, schema_of

SCAN = REPOSITORY / "configs" / "example_scan.txt"


def run_example(name: str, folder: Path, *arguments: str | Path) -> str:
    """What an example prints; it stands in a folder of its own and keeps its store there."""
    done = subprocess.run(
        [sys.executable, str(REPOSITORY / "examples" / name), *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "DIFFRACT_BAKE_STORE": str(folder / "store")},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder where bake_a_scan.py ran, and what it printed."""
    folder = tmp_path_factory.mktemp("example")
    return folder, run_example("bake_a_scan.py", folder, folder / "out")


@pytest.fixture(scope="module")
def bundle(example: tuple[Path, str]) -> Path:
    (found,) = (example[0] / "out" / "example").glob("example-1.0.0+*")
    return found


# --- the examples --------------------------------------------------------------------------------------


def test_bake_a_scan(example: tuple[Path, str], bundle: Path) -> None:
    first, error, *files = example[1].splitlines()
    assert first.startswith("example_scan.txt: 160 x 160 samples, ")
    assert 0.0 < float(error.split()[2]) <= 1.0
    assert [Path(file).name for file in files] == [
        "map_theta0_phi0.exr",
        "map_theta0_phi0.png",
        "report.html",
        bundle.name,
    ]
    assert all(Path(file).exists() for file in files)


def test_look_up(example: tuple[Path, str], bundle: Path) -> None:
    title, *table = run_example("look_up.py", example[0], bundle).splitlines()
    assert title.startswith("# example 1.0.0")
    rows = {float(row["theta_r"]): [float(row[c]) for c in "XYZ"] for row in csv.DictReader(table)}
    assert len(rows) == 6
    # the mirror direction is the brightest, and darker than a mirror
    assert max(rows, key=lambda theta: rows[theta][1]) == -30.0
    assert 0.0 < rows[-30.0][1] < Bundle(bundle).manifest["colour"]["mirror_y"]


@pytest.mark.parametrize("name", ["bake_a_scan.py", "look_up.py"])
def test_an_example_tells_how_it_is_called(name: str) -> None:
    done = subprocess.run(
        [sys.executable, str(REPOSITORY / "examples" / name)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.startswith(f"usage: python {name}")


# --- Bundle --------------------------------------------------------------------------------------------


def test_a_bundle_answers_as_its_own_evaluator(bundle: Path) -> None:
    opened = Bundle(str(bundle))
    assert opened.verify() == []
    assert opened.manifest["name"] == "example"
    assert faults(schema_of("manifest"), opened.manifest, schema_of("manifest")) == []
    wi, wr = direction([0.2, 0.3, 0.0], [0.0, 1.0, 2.0]), direction([0.4, 0.1, 0.9], [3.0, 0.0, 1.0])
    found = opened.xyz(wi, wr)
    assert found.shape == (3, 3)
    assert_allclose(found, BundleTables(bundle).xyz(wi, wr), rtol=0, atol=0)
    # one direction for all of the other's, and lists as well as arrays
    one = opened.xyz([0.0, 0.0, 1.0], wr.tolist())
    assert_allclose(one, opened.xyz(np.tile([0.0, 0.0, 1.0], (3, 1)), wr), rtol=0, atol=0)
    assert opened.xyz(np.empty((0, 3)), np.empty((0, 3))).shape == (0, 3)


@pytest.mark.parametrize("wrong", [[0.0, 1.0], [[[0.0, 0.0, 1.0]]], [0.0, 0.0, 2.0], [np.nan, 0.0, 1.0]])
def test_what_is_no_direction_is_refused(bundle: Path, wrong: list[float]) -> None:
    up = [0.0, 0.0, 1.0]
    opened = Bundle(bundle)
    for pair in ((wrong, up), (up, wrong)):
        with pytest.raises(ValueError, match=r"unit vectors|\(n, 3\)"):
            opened.xyz(*pair)


def test_a_damaged_bundle_is_not_opened(bundle: Path, tmp_path: Path) -> None:
    copy = tmp_path / bundle.name
    shutil.copytree(bundle, copy)
    opened = Bundle(copy)
    flip_a_byte(copy / "README.md")
    assert opened.verify() == ["README.md was changed"]
    with pytest.raises(DamagedError, match=r"README\.md was changed"):
        Bundle(copy)
    with pytest.raises(DamagedError, match="no such folder"):
        Bundle(tmp_path / "none")


# --- bake ----------------------------------------------------------------------------------------------


def test_bake_gives_what_run_gives(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A path, a Config and the command: one bundle, made once."""
    path, heard = tool.config(), []
    baked = bake(path, out=tool.out, store=tool.store, progress=lambda step, done: heard.append((step, done)))
    assert ("bundle", 1.0) in heard
    assert (baked.name, baked.bundle) == ("small", tool.bundle())
    (told,) = tool("run", path, "--json").json
    assert told["bundle"] == f"out/small/{baked.bundle.name}"
    assert [Path(file).name for file in told["files"]] == [file.name for file in (*baked.maps, baked.report)]
    assert all(file.is_file() for file in (*baked.maps, baked.report))
    assert told["stages"]["validate"]["summary"] == baked.measured_error
    assert baked.certificate == told["stages"]["table"]["summary"]["certificate"]
    monkeypatch.setenv("DIFFRACT_BAKE_STORE", str(tool.store))
    config = Config.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    made = bake(config, out=str(tool.folder / "again"))
    assert made.bundle.name == baked.bundle.name
    assert all(len(keys) == 1 for keys in tool.artifacts().values())


def test_a_missed_budget_is_raised_after_all_is_written(tool: Tool) -> None:
    path = tool.config(accuracy={"delta_e": 1e-3})
    with pytest.raises(AccuracyError, match=r"^small: accuracy\.delta_e asks for 0\.001"):
        bake(path, out=tool.out, store=tool.store)
    assert Bundle(tool.bundle()).verify() == []


def test_faults_of_a_config_are_those_of_the_command(tool: Tool) -> None:
    with pytest.raises(ConfigError, match="no such config file"):
        bake(tool.folder / "none.toml", store=tool.store)
    document = tomllib.loads(tool.config().read_text(encoding="utf-8"))
    # what only a reader of documents looks at: names of files, and what ties sections together
    lights = [{"theta_deg": 0.0}, {"theta_deg": 0.0}]
    twice = Config.model_validate({**document, "render": {"lights": lights}})
    with pytest.raises(ConfigError, match="the same light"):
        bake(twice, out=tool.out, store=tool.store)
    lost = Config.model_validate({**document, "surface": {"path": "none.npy"}})
    with pytest.raises(ConfigError, match="no such file"):
        bake(lost, out=tool.out, store=tool.store)
    (tool.folder / "file").write_text("")
    with pytest.raises(StorageError):
        bake(tool.config(), out=tool.folder / "file", store=tool.store)
    assert not tool.store.exists()


# --- load_scan -----------------------------------------------------------------------------------------


def test_a_scan_is_levelled_and_centred() -> None:
    field = load_scan(SCAN)
    assert (field.shape, field.pitch_um) == ((160, 160), (0.1, 0.1))
    h = field.heights_um
    assert h.min() == pytest.approx(-h.max())
    x, y = field.coordinates_um()
    tilts = [np.polyfit(x, h.mean(axis=0), 1)[0], np.polyfit(y, h.mean(axis=1), 1)[0]]
    raw = load_scan(str(SCAN), level="none").heights_um
    assert_allclose(tilts, 0.0, atol=1e-6)
    assert np.abs(raw - h).max() > 1e-3
    assert np.ptp(load_scan(SCAN, clip_percentile=(1, 99)).heights_um) < np.ptp(h)


def test_load_scan_takes_the_keys_of_a_config(tmp_path: Path) -> None:
    path = tmp_path / "scan.npy"
    np.save(path, 100.0 * np.random.default_rng(1).random((20, 30)))
    field = load_scan(path, pitch_um=(0.1, 0.2), height_unit="nm", level="none")
    assert (field.shape, field.pitch_um) == ((20, 30), (0.1, 0.2))
    assert 0.09 < np.ptp(field.heights_um) < 0.1


@pytest.mark.parametrize(
    ("load", "fault", "text"),
    [
        (lambda: load_scan(SCAN, colour=1), ConfigError, "surface.colour: unknown key"),
        (lambda: load_scan(SCAN, level="cubic"), ConfigError, "surface.level"),
        (lambda: load_scan(SCAN, recipe={"kind": "mirror"}), ConfigError, "got both"),
        (lambda: load_scan(SCAN, pitch_um=0.3), InputError, "override_file_units"),
        (lambda: load_scan("none.npy"), InputError, "no such scan file"),
    ],
)
def test_faults_of_a_scan(load: Callable[[], object], fault: type[BakeError], text: str) -> None:
    with pytest.raises(fault, match=text):
        load()


# --- the package ---------------------------------------------------------------------------------------


def test_importing_pipeline_is_cheap() -> None:
    script = "import sys, pipeline; print('numpy' in sys.modules, 'pipeline.api' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
    import pipeline

    assert {"Bundle", "bake", "load_scan"} <= set(dir(pipeline))
    with pytest.raises(AttributeError, match="no attribute 'bakery'"):
        _ = pipeline.bakery


def test_annotations_are_published() -> None:
    packaged = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    for room in ("pipeline", "kernels"):
        assert (REPOSITORY / room / "py.typed").is_file()
        assert "py.typed" in packaged["package-data"][room]


def test_files_that_code_reads_are_published() -> None:
    """Kernels, shaders, templates and tables of numbers are installed with the modules that read them."""
    settings = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    packaged = {
        path
        for package, patterns in settings["package-data"].items()
        for pattern in patterns
        for path in (REPOSITORY / package.replace(".", "/")).glob(pattern)
    }
    present = {
        path
        for room in ("pipeline", "kernels", "cli")
        for path in (REPOSITORY / room).rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc")
    }
    assert packaged == present
    assert {".cl", ".glsl", ".in", ".csv"} <= {path.suffix for path in packaged}


def test_load_scan_warns_of_what_was_not_measured(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).standard_normal((40, 40))
    heights[30:] = 0.0
    np.save(tmp_path / "stopped.npy", heights)
    with pytest.warns(UserWarning, match=r"stopped\.npy: 25 % of the scan was not measured"):
        field = load_scan(tmp_path / "stopped.npy", pitch_um=0.1, height_unit="nm")
    assert field.shape == (30, 40)
