"""Memory is predicted, measured peaks agree with the prediction, and what exceeds the limit is refused."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import resources
from pipeline.config import read
from pipeline.errors import ResourceError
from pipeline.evaluation.speed import stage_costs
from pipeline.stages import forecast
from tests.cli.test_plan import STAGES
from tests.cli.tool import Tool, recipe
from tests.support import shared_file

# measured over predicted: a process that need not compile kernels holds 145 MiB less than one that does
MOST, LEAST = 1.3, 0.4


def config(kind: str, size_um: float, **sections: Any) -> dict[str, Any]:
    """Returns a config of a recipe under few wavelengths, which make validation short."""
    height = sections.pop("recipe", {})
    return {
        "name": "measured",
        "surface": {"recipe": {"kind": kind, "size_um": size_um, "pitch_um": 0.1, **height}},
        "coherence": {"sigma_um": size_um / 4.0},
        "spectrum": {"range_nm": [540, 560]},
        "accuracy": {"delta_e": 5.0},
        "render": {"size": 64},
        **sections,
    }


SMALL_TAYLOR = {"layout": "taylor", "resolution": 41}
CASES: dict[str, tuple[dict[str, Any], str]] = {
    "small": (config("sinusoid", 10.0), "bundle"),
    "paper, small": (config("sinusoid", 10.0, table=SMALL_TAYLOR), "render"),
    "snake": (config("elaphe", 65.0), "table"),
    "half, few textures": (config("xenopeltis", 40.0, publish={"precision": "half", "textures": 1}), "bundle"),
    "scene": (
        config("elaphe", 40.0, scene={"lights": [{"theta_deg": 20}], "views": {"theta_max_deg": 30}}),
        "render",
    ),
    "spectral form": (config("elaphe", 30.0, table={"form": "spectral"}), "table"),
    "gold": (config("elaphe", 40.0, material={"fresnel": "conductor"}, spectrum={}), "table"),
    "grid of 240 MiB": (
        config("sinusoid", 20.0, table={"rings": 600, "azimuths": 4096, "w_terms": 8}),
        "render",
    ),
    "paper, 801 nodes": (
        config("sinusoid", 20.0, recipe={"amplitude_um": 0.1}, table={**SMALL_TAYLOR, "resolution": 801}),
        "render",
    ),
    "large map": (config("mirror", 20.0, render={"size": 2048}), "render"),
    "nine windows": (config("gaussian", 80.0, coherence={"sigma_um": 10.0}), "table"),
    "large patch": (config("elaphe", 110.0, coherence={"sigma_um": 5.0, "windows": "centre"}), "surface"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_measured_peaks_agree_with_the_prediction(name: str) -> None:
    document, until = CASES[name]
    found = stage_costs.measure(read.parse(document, "measured", Path()), until).stages
    assert found[-1].stage == until
    assert all(LEAST <= cost.peak_bytes / cost.predicted_bytes <= MOST for cost in found), found


def test_a_stage_beyond_the_limit_is_refused_before_it_begins(tool: Tool) -> None:
    """The message has the stage, its peak, the largest array, the limit and the keys that would fit."""
    for name in ("rings4096x32768", "huge_recipe"):
        result = tool("run", shared_file(f"attack/{name}.toml"), "--memory", "4GiB")
        assert result.code == 4
        assert len(result.errors) == 1
        assert "more than the 4.0 GiB of --memory" in result.errors[0]
        expected = "table.azimuths = " if name.startswith("rings") else "surface.recipe.size_um = "
        assert expected in result.errors[0]
        assert result.errors[0].endswith(" would fit")
    assert tool.artifacts() == {}


def test_the_proposed_value_fits() -> None:
    found = config("sinusoid", 20.0, table={"rings": 2000, "azimuths": 16384})
    limit = 2**30
    with pytest.raises(ResourceError) as refused, resources.allowing(limit):
        forecast.require_memory(read.parse(found, "x", Path()), {}, ["power_spectrum", "table"], 2**40)
    proposed = int(re.search(r"table\.azimuths = (\d+)", str(refused.value))[1])
    needs = []
    for azimuths in (proposed, proposed + 64):
        found["table"]["azimuths"] = azimuths
        needed = forecast.needs(read.parse(found, "x", Path()), {})
        needs.append(max(needed[stage].bytes for stage in ("power_spectrum", "table")))
    assert needs[0] <= limit < needs[1]


def test_an_array_beyond_the_device_is_refused() -> None:
    found = read.parse(config("sinusoid", 20.0, table={"rings": 4096, "azimuths": 32768}), "x", Path())
    with (
        resources.allowing(2**50),
        pytest.raises(ResourceError, match=r"the device holds no more than 4\.0 GiB in one"),
    ):
        forecast.require_memory(found, {}, ["power_spectrum", "table"], 2**32)


def test_plan_refuses_what_run_refuses(tool: Tool) -> None:
    path = tool.config(surface=recipe("mirror", size_um=1000))
    result = tool("plan", path, "--memory", "1 GiB")
    assert result.code == 4
    assert "GiB" in result.stdout
    assert result.errors[0].startswith("error: small: stage surface needs ")
    assert tool("plan", path, "--memory", "1 TiB").code == 0


def test_plan_reads_a_scan_that_no_stage_has_read(tool: Tool) -> None:
    heights = np.random.default_rng(3).normal(0.0, 0.01, (200, 300))
    np.save(tool.folder / "scan.npy", heights)
    scan = {"path": "scan.npy", "pitch_um": 0.1, "height_unit": "um"}
    steps = tool("plan", tool.config(surface=scan), "--json").json["small"]
    assert all(2**27 < step["peak_bytes"] < 2**30 for step in steps)
    (tool.folder / "scan.npy").write_bytes(b"no scan")
    result = tool("plan", "small.toml", "--json")
    assert (result.code, result.json["small"][0]["peak_bytes"]) == (0, None)


def test_what_is_cached_needs_nothing(baked: Tool) -> None:
    result = baked("run", "small.toml", "--memory", "1MiB")
    assert result.code == 0, result.stderr
    refused = baked("run", "small.toml", "--memory", "1MiB", "--store", baked.folder / "other")
    assert refused.code == 4
    assert refused.errors[0].startswith("error: small: stage surface needs ")


def test_plan_prints_the_peak_of_each_stage(tool: Tool) -> None:
    result = tool("plan", tool.config(), "--json")
    steps = result.json["small"]
    assert [step["stage"] for step in steps] == STAGES
    assert all(2**27 < step["peak_bytes"] < 2**30 and 0 <= step["seconds"] < 60 for step in steps)
    assert "MiB" in tool("plan", "small.toml").stdout


@pytest.mark.parametrize("size", ["", "-1GiB", "0", "1e9", "GiB", "4 XB", "1.5.2G", "nan", "9" * 40 + "G"])
def test_sizes_that_are_none(tool: Tool, size: str) -> None:
    result = tool("plan", tool.config(), "--memory", size)
    assert result.code == 2, result.stderr


@pytest.mark.parametrize(
    ("text", "bytes_"),
    [("4GiB", 2**32), ("4g", 2**32), ("500 MB", 5 * 10**8), ("0.5K", 512), ("100", 100), ("1TiB", 2**40)],
)
def test_sizes(text: str, bytes_: int) -> None:
    assert resources.bytes_of(text) == bytes_


def test_what_the_machine_has_left_is_the_least_of_all_limits(tmp_path: Path) -> None:
    """Control groups of version 2 and 1, each with those above it; cached files count as free."""
    for group, most, used in (("a", 2**31, 2**30), ("a/b", 2**33, 2**29)):
        folder = tmp_path / group
        folder.mkdir()
        (folder / "memory.max").write_text(f"{most}\n", encoding="ascii")
        (folder / "memory.current").write_text(f"{used}\n", encoding="ascii")
        (folder / "memory.stat").write_text("anon 1\ninactive_file 4096\n", encoding="ascii")
    (tmp_path / "memory.max").write_text("max\n", encoding="ascii")
    (tmp_path / "memory" / "c").mkdir(parents=True)
    for name, value in (("limit_in_bytes", 2**30), ("usage_in_bytes", 2**28)):
        (tmp_path / "memory" / "c" / f"memory.{name}").write_text(str(value), encoding="ascii")
    (tmp_path / "memory" / "c" / "memory.stat").write_text("total_inactive_file 0\n", encoding="ascii")
    own = tmp_path / "cgroup"
    own.write_text("0::/a/b\n", encoding="ascii")
    assert sorted(resources.left_in_groups(tmp_path, own)) == [2**30 + 4096, 2**33 - 2**29 + 4096]
    own.write_text("4:cpu,memory:/c\n1:name=systemd:/c\n", encoding="ascii")
    assert resources.left_in_groups(tmp_path, own) == [2**30 - 2**28]


def test_the_address_space_is_a_limit(tool: Tool) -> None:
    limit = "import resource; resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30))"
    result = tool.process("run", tool.config(surface=recipe("mirror", size_um=2000)), wrapper=limit)
    assert result.code == 4, result.stderr
    assert "ulimit -v" in result.errors[0]
    assert "Traceback" not in result.stderr


def test_memory_that_runs_out_is_one_line(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    def exhausted(*_arguments: Any) -> None:
        raise MemoryError("Unable to allocate 9 GiB")

    monkeypatch.setattr("pipeline.stages.run.plan", exhausted)
    result = tool("plan", tool.config())
    assert result.code == 4
    assert result.stderr.startswith("error: out of memory: Unable to allocate 9 GiB; ")
    assert len(result.stderr.splitlines()) == 1
