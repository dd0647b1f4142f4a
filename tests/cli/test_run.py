"""`run`: what it makes, and that a second run makes nothing."""

import re
import time

import numpy as np
import pytest
from PIL import Image

from pipeline.report import images
from tests.architecture.source import HEAVY
from tests.cli.tool import Result, Tool, files, temporary_files, too_wide

STAGES = ["surface", "stack", "table", "textures", "render", "validate", "bundle"]


def test_makes_maps_report_and_bundle(baked: Tool) -> None:
    folder = baked.out / "small"
    shown = sorted(path.name for path in folder.iterdir())
    assert shown == ["map_theta0_phi0.exr", "map_theta0_phi0.png", "report.html", baked.bundle().name]
    assert re.fullmatch(r"small-1\.0\.0\+[0-9a-f]{12}", baked.bundle().name)
    inside = {path.name for path in baked.bundle().iterdir()}
    assert {"tables", "maps", "manifest.json", "evaluate.py", "README.md", "report.html", "SHA256SUMS"} <= inside
    assert temporary_files(baked) == []


def test_maps_have_the_size_asked_for_and_show_the_same_light(baked: Tool) -> None:
    folder = baked.out / "small"
    xyz = images.read_xyz(folder / "map_theta0_phi0.exr")
    assert xyz.shape == (32, 32, 3)
    assert xyz.dtype == np.float32
    assert np.isfinite(xyz).all()
    with Image.open(folder / "map_theta0_phi0.png") as png:
        assert (png.size, png.mode) == ((32, 32), "RGB")
        pixels = np.asarray(png)
    # light from above meets a grating along x: the mirror's and the first orders' rows are lit, corners are no views
    assert pixels[15:17].max() > 200
    assert pixels[0, 0].max() == 0
    assert xyz[0, 0].max() == 0


def test_tells_errors_and_files_on_stdout_and_work_on_stderr(first_run: tuple[Tool, Result]) -> None:
    tool, result = first_run
    table, paths = result.stdout.split("out/small/", 1)
    assert table.splitlines()[0].startswith("small: CIELAB error")
    assert table.splitlines()[1].split() == ["where", "RU", "mean", "99th", "%", "max", "place", "of", "max"]
    assert too_wide(table) == []
    for name in ("map_theta0_phi0.exr", "map_theta0_phi0.png", "report.html", tool.bundle().name):
        assert name in paths
    assert len(result.stdout.splitlines()) == 2 + 7 + 4
    lines = result.stderr.splitlines()
    assert lines[0] == "small:"
    for stage in STAGES:
        assert sum(bool(re.fullmatch(rf"  {stage} +[0-9.]+ s", line)) for line in lines) == 1, stage


def test_report_is_one_file_with_pictures_and_numbers(baked: Tool) -> None:
    page = (baked.out / "small" / "report.html").read_text(encoding="utf-8")
    sources = re.findall(r"""(?:src|href|data|action)\s*=\s*["']?([^"' >]+)""", page)
    assert len(sources) >= 4
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"url\(|@import|<script|<link|https?://", page)
    measured = baked("run", "small.toml", "--json").json[0]["stages"]
    for place in (*measured["validate"]["summary"]["maps"], measured["validate"]["summary"]["random"]):
        for error in place["colour"]:
            for key in ("mean", "percentile_99", "maximum"):
                assert f"<td>{error[key]:.3f}</td>" in page
    assert f"{measured['stack']['summary']['predicted_error']:.1e}" in page
    assert f"<td>{measured['stack']['summary']['order']}</td>" in page
    assert f"{measured['surface']['summary']['statistics']['sigma_h_um']:.4f}" in page


@pytest.mark.alone
def test_a_second_run_finds_all_cached_and_changes_nothing(baked: Tool) -> None:
    before = files(baked.out), baked.artifacts()
    seconds = []
    # the fastest counts: other work may keep this machine busy
    for _ in range(3):
        started = time.perf_counter()
        result = baked.process("run", "small.toml")
        seconds.append(time.perf_counter() - started)
        assert result.code == 0
    assert [line.split() for line in result.stderr.splitlines()[1:]] == [[s, "cached"] for s in STAGES]
    after = files(baked.out)
    assert {name: content for name, (_, content) in after.items()} == {n: c for n, (_, c) in before[0].items()}
    bundle = [name for name in after if baked.bundle().name in name]
    assert all(after[name] == before[0][name] for name in bundle)
    assert baked.artifacts() == before[1]
    assert temporary_files(baked) == []
    assert min(seconds) < 2.0


def test_a_cached_run_imports_no_heavy_library(baked: Tool) -> None:
    environment = {"PYTHONPROFILEIMPORTTIME": "1", "DIFFRACT_BAKE_DEBUG": "1"}
    result = baked.process("run", "small.toml", environment=environment)
    names = {line.rpartition("|")[2].strip().partition(".")[0] for line in result.stderr.splitlines()}
    assert "numpy" in names
    assert sorted(names & HEAVY) == []


def test_json_is_one_document_and_alone_on_stdout(baked: Tool) -> None:
    result = baked("run", "small.toml", "--json")
    (printed,) = result.json
    assert printed["name"] == "small"
    assert list(printed["stages"]) == STAGES
    assert {name: [stage["key"]] for name, stage in printed["stages"].items()} == baked.artifacts()
    assert [baked.folder / file for file in printed["files"]] == [
        baked.out / "small" / name for name in ("map_theta0_phi0.exr", "map_theta0_phi0.png", "report.html")
    ]
    assert baked.folder / printed["bundle"] == baked.bundle()
    assert "cached" in result.stderr


def test_validate_leaves_out_the_bundle(copy: Tool) -> None:
    result = copy("validate", "small.toml", "--out", "elsewhere", "--json")
    assert result.code == 0
    assert result.json[0]["bundle"] is None
    shown = sorted(path.name for path in (copy.folder / "elsewhere" / "small").iterdir())
    assert shown == ["map_theta0_phi0.exr", "map_theta0_phi0.png", "report.html"]


def test_publish_gives_the_bundle_that_run_gave(copy: Tool) -> None:
    result = copy("publish", "small.toml", "--out", "elsewhere")
    assert result.code == 0
    assert result.stdout.splitlines() == [f"elsewhere/small/{copy.bundle().name}"]
    assert files(copy.bundle()).keys() == files(copy.folder / "elsewhere" / "small" / copy.bundle().name).keys()
    again = copy("publish", "small.toml", "--out", "elsewhere", "--json")
    assert again.json == {"bundle": f"elsewhere/small/{copy.bundle().name}"}
    assert "cached" in again.stderr


def test_a_missing_file_comes_back_from_the_store(copy: Tool) -> None:
    (copy.out / "small" / "report.html").unlink()
    assert copy("run", "small.toml").code == 0
    assert (copy.out / "small" / "report.html").read_bytes() == (copy.bundle() / "report.html").read_bytes()
