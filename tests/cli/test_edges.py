"""Edges at which the tool once broke: odd numbers, full disks, other people's folders, runs in each other's way."""

import os
import shutil
import subprocess
from typing import Any
from unittest import mock

import pytest

from tests.cli.tool import COMMAND, Tool, flip_a_byte, mounted, recipe, temporary_files, too_wide


def test_collect_keeps_files_that_are_no_artifacts(tool: Tool) -> None:
    mine = tool.store / "photos" / "2024" / "a.jpg"
    mine.parent.mkdir(parents=True)
    mine.write_text("precious", encoding="utf-8")
    assert tool("store", "check").code == 0
    assert tool("store", "collect").code == 0
    assert mine.read_text(encoding="utf-8") == "precious"


@pytest.mark.slow
def test_a_budget_at_any_exposure(copy: Tool) -> None:
    result = copy("run", copy.config(accuracy={"delta_e": 50.0, "exposure_ru": 1500}))
    assert result.code == 0, result.stderr


def test_a_file_where_the_folder_should_be(copy: Tool) -> None:
    (copy.folder / "taken").mkdir()
    (copy.folder / "taken" / "small").touch()
    result = copy("run", "small.toml", "--out", "taken")
    assert result.code == 7, result.stderr


def test_a_folder_where_a_file_should_be(copy: Tool) -> None:
    (copy.folder / "taken" / "small" / "report.html").mkdir(parents=True)
    result = copy("run", "small.toml", "--out", "taken")
    assert result.code == 7, result.stderr
    assert temporary_files(copy) == []


@pytest.mark.parametrize("option", ["--theta=nan", "--phi=inf", "--phi=nan", "--exposure=nan", "--exposure=inf"])
def test_numbers_that_are_none(baked: Tool, tool: Tool, option: str) -> None:
    more = [] if "theta" in option else ["--theta", "0"]
    result = baked("render", "small.toml", option, *more, "--out", tool.out)
    assert result.code == 2, result.stderr
    assert not tool.out.exists()


def test_an_azimuth_without_a_polar_angle(baked: Tool, tool: Tool) -> None:
    assert baked("render", "small.toml", "--phi", "90", "--out", tool.out).code == 2


def test_head_closes_the_pipe(baked: Tool) -> None:
    environment = {**os.environ, "DIFFRACT_BAKE_STORE": str(baked.store)}
    command = f"{COMMAND} store list | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_cache_folder_that_cannot_be_written_is_done_without(tool: Tool) -> None:
    result = tool.process("doctor", environment={"XDG_CACHE_HOME": "/proc/none"})
    assert result.code == 0, result.stderr


def test_plan_of_two_configs_of_one_name(tool: Tool) -> None:
    assert tool("plan", tool.config("a.toml"), tool.config("b.toml")).code == 2


def test_a_csv_with_a_byte_order_mark(baked: Tool, tool: Tool) -> None:
    path = tool.folder / "d.csv"
    path.write_text("theta_i,phi_i,theta_r,phi_r\n0,0,13,0\n", encoding="utf-8-sig")
    assert baked("eval", "small.toml", "--directions", path).code == 0


def test_a_manifest_that_is_no_table(tool: Tool) -> None:
    (tool.folder / "odd").mkdir()
    (tool.folder / "odd" / "manifest.json").write_text("[]", encoding="utf-8")
    assert tool("inspect", "odd").code == 6


def test_another_run_lays_out_between_copy_and_rename(copy: Tool) -> None:
    """Each writes in a scratch folder of its own: neither takes the other's file away."""
    real, nested = shutil.copyfile, []

    def copyfile(source: Any, target: Any, **keys: Any) -> Any:
        done = real(source, target, **keys)
        if ".writing-" in str(target) and not nested:
            nested.append(copy.process("run", "small.toml").code)
        return done

    with mock.patch("shutil.copyfile", copyfile):
        result = copy("run", "small.toml")
    assert nested == [0]
    assert result.code == 0, result.stderr


def test_a_full_disk_leaves_no_part_of_a_file(baked: Tool, tool: Tool) -> None:
    with mounted(tool.folder / "disk", "size=100k") as done:
        if not done:
            pytest.skip("cannot mount")
        assert baked("run", "small.toml", "--out", tool.folder / "disk").code == 7
        assert list((tool.folder / "disk").rglob(".writing-*")) == []


@pytest.mark.parametrize("size", ["8k", "16k", "40k"])
def test_a_full_disk_leaves_no_part_of_a_map(baked: Tool, tool: Tool, size: str) -> None:
    with mounted(tool.folder / "disk", f"size={size}") as done:
        if not done:
            pytest.skip("cannot mount")
        out = tool.folder / "disk"
        result = baked("render", "small.toml", "--size", "256", "--out", out)
        assert result.code == 7, result.stderr
        assert [path for path in out.rglob("*") if path.is_file()] == []


def test_run_reports_that_the_existing_bundle_was_changed(copy: Tool) -> None:
    flip_a_byte(copy.bundle() / "tables" / "I_00.exr")
    result = copy("run", "small.toml")
    assert result.code == 6, result.stderr


def test_a_recipe_is_checked_before_the_first_config_is_baked(tool: Tool) -> None:
    late = tool.config("late.toml", name="late", surface=recipe("sinusoid", period_um=0.15))
    result = tool("run", tool.config(), late)
    assert result.code == 2
    assert str(late) in result.stderr
    assert tool.artifacts() == {}


@pytest.mark.slow
def test_publish_warns_as_run_does(tool: Tool) -> None:
    surface = {"recipe": {"kind": "sinusoid", "amplitude_um": 0.02, "size_um": 10, "pitch_um": 0.2}}
    result = tool("publish", tool.config(surface=surface))
    assert "warning: " in result.stderr


@pytest.mark.slow
def test_bench_of_a_grating(copy: Tool) -> None:
    result = copy("bench", "speed", "small.toml", "--quick", "--json")
    assert result.code == 0, result.stderr
    assert result.json["surfaces"][0]["agreement"]["numpy"]["median"] < 1e-3


def test_plan_fits_a_terminal(baked: Tool) -> None:
    assert too_wide(baked("plan", "small.toml").stdout) == []


def test_nan_days(tool: Tool) -> None:
    assert tool("store", "collect", "--unused-days", "nan").code == 2
