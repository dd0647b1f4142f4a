"""Scans that cannot be read or trusted: one line, code 3, and nothing left."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib import format as npy_format
from numpy.typing import NDArray
from PIL import Image

from tests.cli.tool import Result, Tool, temporary_files
from tests.support import read_scans_in_this_process, shared_file

RNG = np.random.default_rng(1)
HILLS = 0.05 * np.sin(np.arange(100) * 2 * np.pi / 20)[None, :] + 0.01 * RNG.random((100, 100))
UNITS = {"pitch_um": 0.1, "height_unit": "um"}


@pytest.fixture(autouse=True)
def _read_in_this_process(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "real_bad_files" not in request.node.name:
        read_scans_in_this_process(monkeypatch)


def bake(tool: Tool, scan: Path, **keys: Any) -> Result:
    return tool("run", tool.config(surface={"path": str(scan), **keys}))


def refused(tool: Tool, result: Result, *message: str) -> None:
    """One line, the documented code, nothing behind."""
    assert result.code == 3, result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert [line for line in result.stderr.splitlines() if line != "small:"] == result.errors
    (line,) = result.errors
    for text in message:
        assert text in line
    assert tool.artifacts() == {}
    assert not tool.out.exists()
    assert temporary_files(tool) == []


def with_one(value: float) -> NDArray[np.float64]:
    heights = HILLS.copy()
    heights[30, 40] = value
    return heights


def npy(tool: Tool, heights: NDArray[Any]) -> Path:
    path = tool.folder / "scan.npy"
    np.save(path, heights)
    return path


def text(tool: Tool, content: str) -> Path:
    path = tool.folder / "scan.txt"
    path.write_text(content, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "name", ["di_corrupted.di", "nonsense_txt_file.txt", "single_column.txt", "wrongnpyfile.npy"]
)
@pytest.mark.parametrize("keys", [{}, UNITS], ids=["bare", "with units"])
def test_real_bad_files(tool: Tool, name: str, keys: dict[str, Any]) -> None:
    refused(tool, bake(tool, shared_file(f"bad/{name}"), **keys), name, "expected", "found")


@pytest.mark.parametrize("name", ["scan.npy", "scan.txt", "scan.png", "scan.gwy", "scan.spm", "scan"])
def test_empty_file(tool: Tool, name: str) -> None:
    (tool.folder / name).touch()
    refused(tool, bake(tool, tool.folder / name, **UNITS), "an empty file")


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (np.full((64, 64), 0.3), "heights that vary"),
        (HILLS[:1], "at least 8 samples along each axis"),
        (HILLS[:, :1], "at least 8 samples along each axis"),
        (HILLS[0], "a 2-D height map"),
        (np.full((64, 64), np.nan), "NaN everywhere"),
        (np.where(RNG.random(HILLS.shape) < 0.6, np.nan, HILLS), "no more than 30 %"),
        (with_one(np.inf), "1 infinite values"),
        (with_one(-np.inf), "1 infinite values"),
        (HILLS.astype(complex), "real numbers"),
        (np.full((9, 9), "high"), "real numbers"),
    ],
    ids=["constant", "row", "column", "1-D", "NaN", "mostly NaN", "inf", "-inf", "complex", "words"],
)
def test_values_that_no_height_map_has(tool: Tool, heights: NDArray[Any], message: str) -> None:
    refused(tool, bake(tool, npy(tool, heights), **UNITS), "scan.npy", message)


def test_huge(tool: Tool) -> None:
    # a hole on disk: the header claims 8193 x 512 doubles, no block is written
    path = tool.folder / "scan.npy"
    with path.open("wb") as file:
        npy_format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (8193, 512)})
        file.truncate(file.tell() + 8 * 8193 * 512)
    refused(tool, bake(tool, path, **UNITS), "at most 8192 samples", "8193 x 512")


def test_pickled_objects_are_not_loaded(tool: Tool) -> None:
    path = tool.folder / "scan.npy"
    np.save(path, np.array([[{"a": 1}] * 9] * 9, dtype=object), allow_pickle=True)
    refused(tool, bake(tool, path, **UNITS), "scan.npy")


@pytest.mark.parametrize(
    ("heights", "keys", "message"),
    [
        (1e-6 * HILLS, UNITS, "surface.height_unit"),  # metres taken for micrometres
        (1e3 * HILLS, {**UNITS, "height_unit": "mm"}, "surface.height_unit"),
        (HILLS, {**UNITS, "pitch_um": 1e5}, "surface.pitch_um"),
        (HILLS, {**UNITS, "pitch_um": 1e-7}, "surface.pitch_um"),
    ],
    ids=["metres as um", "nanometres as mm", "pitch in pm", "pitch in m"],
)
def test_mislabelled_units(tool: Tool, heights: NDArray[Any], keys: dict[str, Any], message: str) -> None:
    refused(tool, bake(tool, npy(tool, heights), **keys), "mislabelled units?", message)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "set surface.pitch_um (sample distance in um) and surface.height_unit ('nm', 'um', ...)"),
        ({"pitch_um": 0.1}, "set surface.height_unit"),
        ({"height_unit": "nm"}, "set surface.pitch_um"),
    ],
)
@pytest.mark.parametrize("form", ["text", "npy"])
def test_units_are_asked_for_and_not_guessed(tool: Tool, form: str, keys: dict[str, Any], message: str) -> None:
    rows = "\n".join(" ".join(f"{h:.4f}" for h in row) for row in HILLS)
    path = text(tool, rows) if form == "text" else npy(tool, HILLS)
    refused(tool, bake(tool, path, **keys), "does not state them", message)


def test_an_image_needs_its_height_range(tool: Tool) -> None:
    path = tool.folder / "scan.png"
    Image.fromarray(np.uint8(127 + 1000 * HILLS)).save(path)
    refused(tool, bake(tool, path, pitch_um=0.1), "set surface.height_range_um (height in um of code 255 above 0)")
    refused(tool, bake(tool, path, pitch_um=0.1, height_unit="nm"), "set surface.height_range_um instead")


def test_a_cut_image(tool: Tool) -> None:
    path = tool.folder / "scan.png"
    Image.fromarray(np.uint8(255 * RNG.random((64, 64)))).save(path)
    path.write_bytes(path.read_bytes()[:-2000])
    refused(tool, bake(tool, path, pitch_um=0.1, height_range_um=0.3), "scan.png")


def test_a_coloured_image(tool: Tool) -> None:
    path = tool.folder / "scan.png"
    Image.fromarray(np.uint8(255 * RNG.random((64, 64, 3)))).save(path)
    refused(tool, bake(tool, path, pitch_um=0.1, height_range_um=0.3), "not a colour map")


def test_the_file_and_the_config_disagree(tool: Tool) -> None:
    header = "# Width: 10 um\n# Height: 10 um\n# Value units: um\n"
    path = text(tool, header + "\n".join(" ".join(f"{h:.4f}" for h in row) for row in HILLS))
    refused(tool, bake(tool, path, pitch_um=0.2), "pitches that agree", "override_file_units")
    refused(tool, bake(tool, path, height_unit="nm"), "units that agree", "override_file_units")


@pytest.mark.slow
def test_a_pitch_too_coarse_is_said_with_the_share(tool: Tool) -> None:
    scan = npy(tool, HILLS)
    # `run` warns, and so does its report
    warned = tool("run", tool.config(surface={"path": str(scan), **UNITS, "pitch_um": 0.2}, accuracy={}))
    assert warned.code == 0
    (line,) = (line for line in warned.stderr.splitlines() if line.startswith("warning:"))
    share = re.search(r"([0-9.]+) % of the visible frequencies", line)
    assert share is not None
    assert 10.0 < float(share[1]) < 60.0
    assert "too coarse for 540 nm" in line
    assert "0.135 um would cover all" in line
    assert line.removeprefix("warning: small: ") in (tool.out / "small" / "report.html").read_text(encoding="utf-8")


def test_a_hopeless_pitch_is_refused(tool: Tool) -> None:
    result = bake(tool, npy(tool, HILLS), height_unit="um", pitch_um=2.0)
    refused(tool, result, "too coarse: 9", "0.135 um or finer")


@pytest.mark.slow
def test_what_was_not_measured_is_told_everywhere(tool: Tool) -> None:
    heights = HILLS.copy()
    heights[90:] = 0.0
    heights[40:50, 40:52] = np.nan
    result = bake(tool, npy(tool, heights), **UNITS)
    assert result.code == 0, result.stderr
    (line,) = (line for line in result.stderr.splitlines() if "not measured" in line)
    assert line.startswith("warning: small: 11 % of the scan was not measured")
    assert "10 rows at the top cropped, 1.3 % of the rest filled" in line
    warning = line.removeprefix("warning: small: ")
    report = (tool.out / "small" / "report.html").read_text(encoding="utf-8")
    assert warning in report
    assert "10 at the top" in report
    assert "not that these heights are those of the surface" in report
    (bundle,) = tool.out.glob("small/small-*")
    manifest = json.loads((bundle / "manifest.json").read_text(encoding="utf-8"))
    assert warning in manifest["surface"]["warnings"]
    assert manifest["surface"]["scan"]["cropped"] == [0, 10, 0, 0]
    assert manifest["surface"]["scan"]["unmeasured_share"] == 0.112
    assert "not that these heights" in manifest["certificate"]["certifies"]
    readme = (bundle / "README.md").read_text(encoding="utf-8")
    assert f"Warning: {warning}" in readme
    assert "This certifies the table of the heights that were baked" in readme


def test_a_steep_slope_and_two_groups_of_heights_are_told(tool: Tool) -> None:
    steep = HILLS + 0.03 * np.arange(100)
    cliff = HILLS - 4.0 * (np.arange(100) > 79)[:, None] * (1 + 1e-3 * np.arange(100))
    for heights, message in ((steep, "a slope of 16.6 x"), (cliff, "heights lie in two groups 3.9")):
        config = tool.config(surface={"path": str(npy(tool, heights)), **UNITS})
        result = tool("run", config, "--until", "surface")
        assert result.code == 0, result.stderr
        assert any(message in line for line in result.stderr.splitlines() if line.startswith("warning: "))


def test_holes_and_dust_are_corrected_and_counted(tool: Tool) -> None:
    heights = HILLS.copy()
    heights[40:44, 50:53] = np.nan
    heights[10, 10] = 5.0
    config = tool.config(surface={"path": str(npy(tool, heights)), **UNITS, "clip_percentile": [0.05, 99.9]})
    result = tool("render", config, "--exact", "--size", "16")
    assert result.code == 0, result.stderr
    record = next(tool.store.glob("surface/*/artifact.json"))
    summary = json.loads(record.read_text(encoding="utf-8"))["summary"]
    assert summary["conditioning"]["holes"] == 12
    assert summary["conditioning"]["clipped_high"] >= 1
    assert summary["statistics"]["range_um"] < 0.2
