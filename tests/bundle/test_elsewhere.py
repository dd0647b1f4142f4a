"""Bundles from elsewhere whose checksums hold: impossible numbers, images of other structures, bombs, odd files."""

import json
import os
import shutil
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from pipeline.bundle import document
from pipeline.bundle.verify import open_bundle, verify
from pipeline.errors import DamagedError
from pipeline.report import images
from tests.fuzz.bundles import zeros

from .conftest import LAYOUTS, SCENE, Baker, forged, publish, small, with_values

IMPOSSIBLE: dict[str, list[dict[str, Any]]] = {
    "taylor": [
        {"grid__power": 0},
        {"grid__power": float("nan")},
        {"grid__u_max": 1e300},
        {"material__divisor": 0},
        {"material__divisor": float("nan")},
        {"material__schlick_f0": float("nan")},
        {"material__schlick_f0": None},
        {"tables__0__scale": 1e300},
        {"tables__0__scale": float("inf")},
        {"report": "../../../etc/passwd"},
        {"maps__0__png": "../../../etc/passwd"},
        {"maps__0__png": "maps/none.png"},
        {"name": "../../elsewhere"},
        {"grid__power": 10**400},
        {"coverage__skipped_share": -1},
        {"provenance__config": {"scene": {"lights": 5}}},
        {"grid__width": 0},
        {"grid__u_max": 1e-320},
        {"tables__0__file": "/etc/passwd"},
    ],
    "polar": [
        {"grid__r0": 1e-320},
        {"grid__step": 1e-320},
        {"grid__step": 0.1},
        {"grid__axis_rad": float("nan")},
        {"grid__axis_rad": float("inf")},
        {"grid__axis_rad": 1e300},
        {"grid__stretch": 0},
        {"grid__envelope_radius": 0},
        {"grid__envelope_exponent": float("nan")},
        {"grid__envelope_exponent": 1e6},
        {"grid__rho_max": 1.0},
        {"grid__height": 0},
        {"grid__rings": 1},
        {"grid__covered_share": 1.5},
    ],
}


@pytest.mark.parametrize(("layout", "changes"), [(layout, c) for layout in LAYOUTS for c in IMPOSSIBLE[layout]])
def test_impossible_values_are_found(
    published: dict[str, Path], tmp_path: Path, layout: str, changes: dict[str, Any]
) -> None:
    copy = Path(shutil.copytree(published[layout], tmp_path / published[layout].name))
    folder = forged(copy, with_values(**changes))
    faults = verify(folder)
    (key,) = (path.rpartition("__")[2] for path in changes)
    assert any(key in fault or "expected numbers, got" in fault for fault in faults), faults
    assert all("\n" not in fault for fault in faults)
    with pytest.raises(DamagedError):
        open_bundle(folder)


def test_an_image_that_is_named_twice_is_found(bundle: Path) -> None:
    folder = forged(bundle, with_values(maps__0__file="tables/I_00.exr"))
    assert "manifest.json: an image is named twice" in verify(folder)
    with pytest.raises(DamagedError):
        open_bundle(folder)


def test_samples_of_different_lengths_are_found(bake: Baker, tmp_path: Path) -> None:
    config = small(material={"fresnel": "conductor", "metal": "Au"})
    folder = publish(config, bake(config), tmp_path)
    forged_folder = forged(folder, with_values(material__samples__k=[1.0]))
    assert any("differ in length" in fault for fault in verify(forged_folder))


def test_a_scene_that_does_not_reach_as_far_as_the_table_is_found(bake: Baker, tmp_path: Path) -> None:
    config = small(scene=SCENE, render={"lights": SCENE["lights"]})
    folder = publish(config, bake(config), tmp_path)
    assert verify(folder) == []
    wider = forged(folder, with_values(provenance__config__scene=None))
    assert any("the scene reaches it" in fault for fault in verify(wider))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_texels_that_are_no_numbers_are_found(bundle: Path, value: float) -> None:
    def damage(folder: Path) -> None:
        pixels = np.ones((41, 41, 4), np.float32)
        pixels[20, 20, 1] = value
        images.write_rgba(folder / "tables" / "I_01.exr", pixels)

    assert verify(forged(bundle, damage)) == ["tables/I_01.exr: a texel is not a finite number"]


def test_many_tables_are_refused_at_once(bundle: Path) -> None:
    def damage(folder: Path) -> None:
        path = folder / "manifest.json"
        manifest = json.loads(path.read_text(encoding="utf-8"))
        manifest["tables"] *= 2000
        path.write_text(json.dumps(manifest, separators=(",", ":")), encoding="utf-8")

    started = time.process_time()
    assert any("manifest.json" in fault for fault in verify(forged(bundle, damage)))
    assert time.process_time() - started < 5.0


@pytest.mark.parametrize("size", [(12000, 12000), (4001, 4001)])
def test_zeros_a_thousand_times_as_large_are_not_decoded(
    bundle: Path, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    def damage(folder: Path) -> None:
        for path in (folder / "tables").iterdir():
            path.write_bytes(zeros(list("ABGR"), *size, "float"))
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        for entry in (manifest["grid"], *manifest["tables"]):
            entry["width"], entry["height"] = size
        (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")

    monkeypatch.setattr(images, "decode", lambda path: pytest.fail(f"{path} was decoded"))
    assert verify(forged(bundle, damage))


@pytest.mark.parametrize(
    "text", ["{", "[" * 100_000, '{"a":' * 100_000, '{"name": "\\ud800"}', '{"a": NaN}', '{"a": 1e999}', "[]"]
)
def test_a_manifest_that_is_no_manifest(bundle: Path, text: str) -> None:
    folder = forged(bundle, lambda folder: (folder / "manifest.json").write_text(text, encoding="utf-8") and None)
    with pytest.raises(DamagedError, match=r"manifest\.json"):
        document.read(folder)
    assert any("manifest.json" in fault for fault in verify(folder))


@pytest.mark.parametrize("name", ["manifest.json", "SHA256SUMS", "tables/I_00.exr", "README.md"])
@pytest.mark.parametrize("how", ["pipe", "device", "giant"])
def test_what_is_no_file_of_a_bundle_is_not_read(bundle: Path, name: str, how: str) -> None:
    path = bundle / name
    if how == "giant":
        os.truncate(path, 30 * 2**30)
    else:
        path.unlink()
        if how == "pipe":
            os.mkfifo(path)
        else:
            path.symlink_to("/dev/zero")
    started = time.process_time()
    assert any(name in fault for fault in verify(bundle))
    assert time.process_time() - started < 5.0


def test_an_empty_folder_is_found(bundle: Path) -> None:
    (bundle / "tables" / "more").mkdir()
    assert verify(bundle) == ["tables/more/ was added"]


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "PIZ"])
def test_lossless_images_of_another_compression_are_accepted(bundle: Path, compression: str) -> None:
    def damage(folder: Path) -> None:
        for path in (folder / "tables").iterdir():
            header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
            OpenEXR.File(header, images.decode(path)).write(str(path))

    folder = forged(bundle, damage)
    assert verify(folder) == []


@pytest.mark.parametrize("how", ["tiles", "parts", "PXR24", "cut", "window", "attribute"])
def test_other_structures_of_an_image_are_refused(bundle: Path, how: str) -> None:
    def damage(folder: Path) -> None:
        path = folder / "tables" / "I_01.exr"
        planes, data = images.decode(path), path.read_bytes()
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        if how == "tiles":
            tiled = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
            OpenEXR.File({**header, **tiled}, planes).write(str(path))
        elif how == "parts":
            OpenEXR.File([OpenEXR.Part({**header}, {**planes}, name) for name in "ab"]).write(str(path))
        elif how == "PXR24":
            OpenEXR.File({**header, "compression": OpenEXR.PXR24_COMPRESSION}, planes).write(str(path))
        elif how == "cut":
            path.write_bytes(data[: len(data) // 2])
        elif how == "window":
            at = data.index(b"box2i\0") + 10 + 8
            path.write_bytes(data[:at] + struct.pack("<2i", 2**31 - 1, 2**31 - 1) + data[at + 8 :])
        else:
            path.write_bytes(data.replace(b"colorInteropID\0string\0", b"colorInteropID\0opaque\0"))

    folder = forged(bundle, damage)
    (fault,) = verify(folder)
    assert fault.startswith("tables/I_01.exr cannot be read as EXR: ")


def test_an_image_that_openexr_cannot_decode_prints_nothing(bundle: Path, capfd: pytest.CaptureFixture[str]) -> None:
    def damage(folder: Path) -> None:
        path = folder / "tables" / "I_01.exr"
        data = bytearray(path.read_bytes())
        data[-20:-10] = bytes(10)
        path.write_bytes(data)

    (fault,) = verify(forged(bundle, damage))
    assert fault.startswith("tables/I_01.exr cannot be read as EXR: ")
    assert capfd.readouterr() == ("", "")
