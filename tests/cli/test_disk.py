"""Disks that are full or cannot be written: code 7, one line, nothing half done to be seen."""

import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.cli.tool import Result, Tool, mounted, temporary_files


def refused(result: Result) -> None:
    assert result.code == 7, result.stderr
    assert len(result.errors) == 1
    assert "Traceback" not in result.stderr


@pytest.fixture
def small_disk(tool: Tool, request: pytest.FixtureRequest) -> Iterator[Path]:
    with mounted(tool.folder / "disk", request.param) as done:
        if not done:
            pytest.skip("mounting a small file system needs root and the right to mount")
        yield tool.folder / "disk"


@pytest.mark.parametrize("small_disk", ["size=64k", "size=256k", "size=1m"], indirect=True)
def test_the_store_is_full(tool: Tool, small_disk: Path) -> None:
    cramped = replace(tool, store=small_disk / "store")
    result = cramped("run", cramped.config(surface={"recipe": {"kind": "sinusoid", "size_um": 40, "pitch_um": 0.1}}))
    refused(result)
    assert "no space left to write; free some, or choose another folder" in result.errors[0]
    assert temporary_files(cramped) == []
    assert cramped("store", "check").code == 0
    assert not cramped.out.exists()


@pytest.mark.parametrize("small_disk", ["size=16k", "size=100k", "size=300k", "size=512k"], indirect=True)
def test_the_folder_for_results_is_full(baked: Tool, small_disk: Path) -> None:
    result = baked("run", "small.toml", "--out", small_disk / "out")
    refused(result)
    assert [path for path in small_disk.rglob("small-*") if path.is_dir()] == []
    # what is to be seen is whole
    for path in (small_disk / "out" / "small").glob("[!.]*"):
        assert path.read_bytes() == (baked.out / "small" / path.name).read_bytes()


@pytest.mark.parametrize("small_disk", ["size=8m"], indirect=True)
def test_where_the_bundle_just_does_not_fit_it_is_not_there(baked: Tool, small_disk: Path) -> None:
    """Every 24 KiB less of free space ends in another file of the bundle."""
    out, filler, codes = small_disk / "out", small_disk / "filler", set()
    for free in range(240, 720, 24):
        filler.write_bytes(bytes(8 * 2**20 - free * 2**10))
        result = baked("run", "small.toml", "--out", out)
        codes.add(result.code)
        bundles = [path for path in out.glob("small/small-*") if path.is_dir()]
        if result.code == 0:
            assert baked("verify", *bundles).code == 0
        else:
            refused(result)
            assert bundles == []
        filler.unlink()
        shutil.rmtree(out)
    assert codes == {0, 7}


@pytest.mark.parametrize("small_disk", ["ro"], indirect=True)
def test_read_only(baked: Tool, small_disk: Path) -> None:
    result = baked("run", "small.toml", "--out", small_disk / "out")
    refused(result)
    assert "is not a writable directory" in result.errors[0]
    result = replace(baked, store=small_disk / "store")("run", "small.toml")
    refused(result)


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_no_permission(copy: Tool) -> None:
    shutil.rmtree(copy.out)
    copy.out.mkdir(mode=0o500)
    refused(copy("run", "small.toml"))
    assert list(copy.out.iterdir()) == []
    copy.out.chmod(0o700)
    assert copy("run", "small.toml").code == 0


def test_a_place_that_is_no_folder(copy: Tool) -> None:
    result = copy("run", "small.toml", "--out", "/dev/null/out")
    refused(result)
    assert copy("run", "small.toml", "--out", "small.toml").code == 2
