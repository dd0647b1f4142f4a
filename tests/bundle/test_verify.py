"""Verification finds every difference, and reads nothing outside the folder."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.bundle import checksums
from pipeline.bundle.verify import open_bundle, renamed, verify
from pipeline.errors import DamagedError
from pipeline.report import images

from .conftest import LAYOUTS, forged

FIRST = {"taylor": "tables/I_00.exr", "polar": "tables/T_00.exr"}


def replacing(before: str, after: str) -> Callable[[Path], None]:
    """Returns a function that replaces a text in the manifest of a bundle."""

    def damage(folder: Path) -> None:
        path = folder / "manifest.json"
        text = path.read_text(encoding="utf-8")
        assert before in text
        path.write_text(text.replace(before, after, 1), encoding="utf-8")

    return damage


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_every_changed_byte_is_found(bundle: Path) -> None:
    for name in names(bundle):
        path = bundle / name
        content = path.read_bytes()
        for at in {0, len(content) // 2, len(content) - 1}:
            path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
            assert verify(bundle), (name, at)
        path.write_bytes(content)
    assert verify(bundle) == []


def test_every_missing_file_is_found(bundle: Path) -> None:
    for name in names(bundle):
        (bundle / name).rename(bundle.parent / "away")
        assert any(f"{name} is missing" in fault for fault in verify(bundle)), name
        (bundle.parent / "away").rename(bundle / name)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_tables_of_either_layout_are_checked(published: dict[str, Path], tmp_path: Path, layout: str) -> None:
    folder = Path(shutil.copytree(published[layout], tmp_path / published[layout].name))
    assert verify(folder) == []
    empty = forged(folder, lambda folder: images.write_rgba(folder / FIRST[layout], np.zeros((2, 2, 4), np.float32)))
    assert {fault.split(":")[0] for fault in verify(empty)} == {FIRST[layout]}


def test_an_extra_file_is_found(bundle: Path) -> None:
    (bundle / "tables" / "extra").touch()
    assert verify(bundle) == ["tables/extra was added"]


def test_another_name_is_found(bundle: Path) -> None:
    moved = bundle.rename(bundle.parent / "small-1.0.0+0123456789ab")
    assert any("its content's digest is" in fault for fault in verify(moved))


def test_a_link_to_a_bundle_is_a_bundle(bundle: Path) -> None:
    (bundle.parent / "latest").symlink_to(bundle)
    assert verify(bundle.parent / "latest") == []


def test_a_missing_folder_is_a_fault(tmp_path: Path) -> None:
    assert "no such folder" in verify(tmp_path / "none")[0]


def test_nothing_outside_is_read(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = bundle.parent / "secret"
    secret.write_text("secret", encoding="utf-8")
    digest = hashlib.sha256(b"secret").hexdigest()
    (bundle / "link").symlink_to(secret)
    sums = bundle / checksums.SUMS
    absolute = "".join(f"{digest}  {name}\n" for name in ("../secret", str(secret), "tables/../../secret", "link"))
    sums.write_text(sums.read_text(encoding="utf-8") + absolute + "no line\n", encoding="utf-8")
    hashed: list[Path] = []
    from pipeline.store import digest as digests

    original = digests.of_file

    def recorded(path: Path) -> str:
        hashed.append(path)
        return original(path)

    monkeypatch.setattr(digests, "of_file", recorded)
    faults = verify(bundle)
    assert all(path.resolve().is_relative_to(bundle) for path in hashed)
    assert sum("outside the bundle" in fault for fault in faults) == 3
    assert "link is not a plain file" in faults
    assert any("is not '<sha256>  <file>'" in fault for fault in faults)


def test_checksums_that_are_not_text(bundle: Path) -> None:
    (bundle / checksums.SUMS).write_bytes(b"\xff\xfe")
    assert verify(bundle) == ["SHA256SUMS is not UTF-8 text"]


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        ('"schema_version": 4', '"schema_version": 1', "schema_version"),
        ('"schema_version": 4', '"schema_version": 4, "more": 0', "more"),
        ('"file": "tables/I_00.exr"', '"file": "../I_00.exr"', "tables.0.taylor.file"),
        ('"file": "tables/I_00.exr"', '"file": "tables/none.exr"', "names tables/none.exr, which is missing"),
        ('"version": "1.0.0"', '"version": "1.0.1"', "describes small-1.0.1"),
        ('"index": 0', '"index": 7', "expected index = 0, 1"),
        ('"height": 41', '"height": 43', "not of the grid's size"),
        ('"precision": "float"', '"precision": "half"', "not RGBA of precision half"),
    ],
)
def test_a_manifest_that_contradicts_the_bundle(bundle: Path, before: str, after: str, fault: str) -> None:
    assert any(fault in line for line in verify(forged(bundle, replacing(before, after))))


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        ('"w_terms": 12', '"w_terms": 8', "do not hold the outputs that basis and w_terms need"),
        ('"layout": "polar",\n   "index": 0', '"layout": "taylor",\n   "index": 0', "tables.0.taylor"),
        ('"basis": null', '"basis": [[[1.0]]]', "do not hold the outputs that basis and w_terms need"),
    ],
)
def test_a_polar_manifest_that_contradicts_the_bundle(
    polar_bundle: Path, before: str, after: str, fault: str
) -> None:
    assert any(fault in line for line in verify(forged(polar_bundle, replacing(before, after))))


def test_tables_of_another_layout_than_the_grid_are_found(polar_bundle: Path) -> None:
    def damage(folder: Path) -> None:
        path = folder / "manifest.json"
        manifest = json.loads(path.read_text(encoding="utf-8"))
        manifest["tables"][1] |= {"layout": "taylor", "scale": 1.0}
        path.write_text(json.dumps(manifest), encoding="utf-8")

    assert verify(forged(polar_bundle, damage)) == ["manifest.json: tables/T_01.exr is not of the grid's layout"]


@pytest.mark.parametrize(
    ("size", "kind", "fault"),
    [((40, 41), np.float32, "height is 40"), ((41, 41), np.float16, "pixel_type is half")],
)
def test_an_image_that_differs_from_its_entry(bundle: Path, size: tuple[int, int], kind: type, fault: str) -> None:
    path = "tables/I_01.exr"
    folder = forged(bundle, lambda folder: images.write_rgba(folder / path, np.zeros((*size, 4), kind)))
    assert any(line.startswith(f"{path}: {fault}") for line in verify(folder))


def test_a_file_that_is_not_an_image(bundle: Path) -> None:
    def damage(folder: Path) -> None:
        (folder / "tables" / "I_01.exr").write_text("no image", encoding="utf-8")

    folder = forged(bundle, damage)
    assert verify(folder) == ["tables/I_01.exr cannot be read as EXR"]


def test_a_damaged_bundle_is_not_opened(bundle: Path) -> None:
    (bundle / "evaluate.py").unlink()
    with pytest.raises(DamagedError, match=r"evaluate\.py is missing"):
        open_bundle(bundle)


def test_a_renamed_folder_is_the_same_bundle(bundle: Path) -> None:
    digest = bundle.name.rpartition("+")[2]
    assert renamed(bundle) is None
    for name in ("elaphe", f"copy of {bundle.name}"):
        bundle = bundle.rename(bundle.parent / name)
        assert verify(bundle) == []
        assert renamed(bundle) == digest


def test_a_manifest_that_the_sums_do_not_name_is_a_fault(bundle: Path) -> None:
    found = verify(forged(bundle, lambda folder: (folder / "manifest.json").unlink()))
    assert "SHA256SUMS does not name manifest.json" in found


def test_a_pipe_and_a_sparse_giant_are_not_read(bundle: Path) -> None:
    with (bundle / FIRST["taylor"]).open("r+b") as stream:
        stream.truncate(30 * 2**30)
    os.mkfifo(bundle / "pipe")
    faults = verify(bundle)
    assert any(fault.startswith(f"{FIRST['taylor']} has {30 * 2**30} bytes") for fault in faults)
    assert "pipe is not a plain file" in faults


def test_pixels_are_not_decoded_where_the_header_has_another_size(
    bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A small file may hold gigabytes of zeros."""

    def bomb(folder: Path) -> None:
        pixels = np.zeros((2000, 2000, 4), np.float32)
        images.write_rgba(folder / FIRST["taylor"], pixels)

    decoded: list[Path] = []
    decode = images.decode
    monkeypatch.setattr(images, "decode", lambda path: decoded.append(path) or decode(path))
    faults = verify(forged(bundle, bomb))
    assert any("2000" in fault and FIRST["taylor"] in fault for fault in faults), faults
    assert not any(path.name == Path(FIRST["taylor"]).name for path in decoded)
