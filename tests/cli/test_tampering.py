"""Changed files are named and never used, and the remedy in the message works."""

import json
import os
from pathlib import Path

import pytest

from pipeline.store import digest
from tests.cli.tool import Tool, flip_a_byte


def largest(folder: Path) -> Path:
    return max((path for path in folder.rglob("*") if path.is_file()), key=lambda path: path.stat().st_size)


def artifact(tool: Tool, stage: str) -> Path:
    (key,) = tool.artifacts()[stage]
    return tool.store / stage / key


def test_a_changed_artifact_is_named_collected_and_made_again(copy: Tool) -> None:
    table = artifact(copy, "table")
    harmed = largest(table / "table.zarr")
    flip_a_byte(harmed)
    # another size of maps needs the table again
    config = copy.config(render={"size": 16})
    result = copy("run", config)
    assert result.code == 6
    (line,) = result.errors
    assert str(table) in line
    assert f"{harmed.relative_to(table)} was changed" in line
    assert "`diffract-bake store collect` removes damaged artifacts" in line
    assert len(copy.artifacts()["render"]) == 1

    checked = copy("store", "check")
    assert checked.code == 6
    assert checked.errors == result.errors
    assert copy("store", "check", "--json").json["faults"] == [line.removeprefix("error: ")]

    collected = copy("store", "collect")
    assert collected.code == 0
    assert collected.stdout.startswith("removed 1 folders, ")
    assert not table.exists()
    assert copy("store", "check").code == 0
    assert copy("run", config).code == 0
    assert table.is_dir()


@pytest.mark.parametrize("how", ["changed", "cut", "gone", "added", "other"])
def test_harm_to_a_record_or_to_the_list_of_files(copy: Tool, how: str) -> None:
    render = artifact(copy, "render")
    record = render / "artifact.json"
    if how == "changed":
        record.write_text(record.read_text(encoding="utf-8").replace('"size": 32', '"size": 64'), encoding="utf-8")
    elif how == "cut":
        record.write_bytes(record.read_bytes()[:100])
    elif how == "gone":
        record.unlink()
    elif how == "added":
        (render / "more.txt").write_text("more", encoding="utf-8")
    else:
        render.rename(render.with_name("0" * 64))
        assert copy("store", "check").code == 6
        return
    result = copy("run", "small.toml")
    assert result.code == 6
    assert len(result.errors) == 1
    assert str(render) in result.errors[0]
    assert copy("store", "collect").code == 0
    assert copy("run", "small.toml").code == 0


def test_a_file_in_the_place_of_an_artifact(copy: Tool) -> None:
    surface = artifact(copy, "surface")
    surface.rename(copy.folder / "moved")
    surface.touch()
    for command in (("run", "small.toml"), ("store", "check")):
        result = copy(*command)
        assert result.code == 6
        assert [line for line in result.errors if str(surface) in line] == result.errors
    assert copy("store", "collect").code == 0
    assert copy("run", "small.toml", "--until", "surface").code == 0
    assert copy("store", "check").code == 0


@pytest.mark.parametrize(
    ("stage", "summary"),
    [
        ("surface", {"warnings": 5}),
        ("validate", {}),
        ("bundle", {"name": 5}),
        ("bundle", {"name": "../../elsewhere"}),
    ],
)
def test_a_record_that_its_owner_sealed_with_wrong_values(copy: Tool, stage: str, summary: dict[str, object]) -> None:
    path = artifact(copy, stage) / "artifact.json"
    record = json.loads(path.read_text(encoding="utf-8"))
    del record["seal"]
    record["summary"] = {**record["summary"], **summary} if summary else {}
    record["seal"] = digest.of_json(record)
    path.write_text(json.dumps(record), encoding="utf-8")
    result = copy("run", "small.toml", "--out", "again")
    assert result.code == 6
    assert len(result.errors) == 1
    assert str(path.parent) in result.errors[0]
    assert not (copy.folder / "elsewhere").exists()


@pytest.mark.parametrize("stage", ["render", "validate"])
def test_changed_results_are_not_laid_out(copy: Tool, stage: str) -> None:
    flip_a_byte(largest(artifact(copy, stage)))
    result = copy("run", "small.toml", "--out", "again")
    assert result.code == 6
    assert len(result.errors) == 1
    assert list((copy.folder / "again").rglob("small-*")) == []


@pytest.mark.parametrize(
    "pattern", ["tables/I_00.exr", "tables/I_05.exr", "manifest.json", "maps/*.png", "SHA256SUMS"]
)
def test_a_changed_bundle(copy: Tool, pattern: str) -> None:
    (harmed,) = copy.bundle().glob(pattern)
    flip_a_byte(harmed)
    name = harmed.relative_to(copy.bundle()).as_posix()
    verified = copy("verify", copy.bundle())
    assert verified.code == 6
    assert verified.stdout == ""
    assert any(name in line for line in verified.errors)
    assert len(copy("verify", copy.bundle(), "--json").json["faults"]) == len(verified.errors)
    (copy.folder / "d.csv").write_text("0,0,10,0\n", encoding="utf-8")
    evaluated = copy("eval", copy.bundle(), "--directions", "d.csv")
    assert evaluated.code == 6
    assert evaluated.stdout == ""
    assert any(name in line for line in evaluated.errors)


def test_an_unchanged_bundle(baked: Tool) -> None:
    result = baked("verify", baked.bundle())
    assert (result.code, result.stderr) == (0, "")
    assert result.stdout == f"{baked.bundle()}: unchanged\n"
    assert baked("verify", baked.bundle(), "--json").json == {"bundle": str(baked.bundle()), "faults": []}


def test_a_renamed_bundle(copy: Tool) -> None:
    digest = copy.bundle().name.rpartition("+")[2]
    moved = copy.bundle().rename(copy.folder / "elaphe")
    result = copy("verify", moved)
    assert (result.code, result.stderr) == (0, "")
    assert result.stdout == (
        f"{moved}: all files match SHA256SUMS; the folder was renamed, so that its name no longer carries the digest "
        f"{digest}\n"
    )
    expected = {"bundle": str(moved), "faults": [], "renamed": True, "digest": digest}
    assert copy("verify", moved, "--json").json == expected
    (copy.folder / "d.csv").write_text("0,0,10,0\n", encoding="utf-8")
    assert copy("eval", moved, "--directions", "d.csv").code == 0


@pytest.mark.parametrize("how", ["pipe", "deep", "surrogate"])
def test_a_manifest_from_elsewhere(copy: Tool, how: str) -> None:
    manifest = copy.bundle() / "manifest.json"
    manifest.unlink()
    if how == "pipe":
        os.mkfifo(manifest)
    else:
        manifest.write_text("[" * 100_000 if how == "deep" else '{"name": "\\ud800"}', encoding="utf-8")
    for command in (("inspect", copy.bundle()), ("verify", copy.bundle()), ("run", "small.toml")):
        result = copy(*command)
        assert result.code == 6, command
        assert "manifest.json" in result.stderr


def test_a_folder_that_is_no_bundle(tool: Tool) -> None:
    result = tool("verify", tool.folder)
    assert result.code == 6
    assert "SHA256SUMS is missing" in result.errors[0]
