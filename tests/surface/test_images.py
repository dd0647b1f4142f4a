"""Samples of images and arrays as the file states them; channels of Gwyddion's containers."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from pipeline.errors import InputError
from pipeline.surface.load import load_scan
from pipeline.surface.readers import read_scan
from pipeline.surface.source import SurfaceSource
from tests.support import shared_file

RNG = np.random.default_rng(6)


def write_tiff(path: Path, stored: NDArray[Any], **keywords: Any) -> Path:
    tifffile = pytest.importorskip("tifffile")
    tifffile.imwrite(path, stored, **keywords)
    return path


@pytest.mark.parametrize(
    ("dtype", "most"),
    [
        ("int8", 127),
        ("uint8", 255),
        ("int16", 32767),
        ("uint16", 65535),
        ("int32", 2**31 - 1),
        ("uint32", 2**32 - 1),
        ("float16", None),
        ("float32", None),
        ("float64", None),
    ],
)
@pytest.mark.parametrize("byteorder", ["<", ">"])
@pytest.mark.parametrize("bigtiff", [False, True])
def test_samples_of_a_tiff(tmp_path: Path, dtype: str, most: float | None, byteorder: str, bigtiff: bool) -> None:
    low = 0 if dtype.startswith("u") else -100
    stored = RNG.integers(low, 120, (10, 12)).astype(dtype)
    scan = read_scan(write_tiff(tmp_path / "s.tif", stored, byteorder=byteorder, bigtiff=bigtiff), None)
    np.testing.assert_array_equal(scan.heights, stored[::-1])
    assert scan.full_code == most


@pytest.mark.parametrize(("bits", "most"), [(12, 4095), (10, 1023), (14, 16383)])
def test_a_camera_with_fewer_bits(tmp_path: Path, bits: int, most: int) -> None:
    stored = RNG.integers(0, most, (10, 12)).astype(np.uint16)
    tag = [(281, "H", 1, most, True)]
    path = write_tiff(tmp_path / f"{bits}.tif", stored, extratags=tag)
    assert read_scan(path, None).full_code == most
    field, _ = load_scan(SurfaceSource(path=str(path), pitch_um=0.1, height_range_um=1.0))
    np.testing.assert_allclose(field.heights_um, stored[::-1] / most)
    # the largest code of this image is no full scale
    path = write_tiff(tmp_path / "max.tif", stored, extratags=[(281, "H", 1, int(stored.max()), True)])
    assert read_scan(path, None).full_code == 65535


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32", "float64"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_tag(tmp_path: Path, dtype: str, orientation: int) -> None:
    shown = RNG.integers(0, 100, (10, 12)).astype(dtype)
    turned = {
        1: shown,
        2: shown[:, ::-1],
        3: shown[::-1, ::-1],
        4: shown[::-1],
        5: shown.T,
        6: shown.T[::-1],
        7: shown.T[::-1, ::-1],
        8: shown.T[:, ::-1],
    }[orientation]
    path = write_tiff(tmp_path / "s.tif", np.ascontiguousarray(turned), extratags=[(274, "H", 1, orientation, True)])
    np.testing.assert_array_equal(read_scan(path, None).heights, shown[::-1])


@pytest.mark.parametrize("dtype", ["int16", "float32", "float64"])
@pytest.mark.parametrize("no_data", [-9999.0, -32768.0])
def test_gdal_no_data_is_a_hole(tmp_path: Path, dtype: str, no_data: float) -> None:
    stored = RNG.integers(-100, 100, (10, 12)).astype(dtype)
    stored[2, 3:6] = no_data
    path = write_tiff(tmp_path / "s.tif", stored, extratags=[(42113, "s", 0, f"{no_data:g}", True)])
    heights = read_scan(path, None).heights
    assert np.count_nonzero(np.isnan(heights)) == 3
    assert np.isnan(heights[::-1][2, 3:6]).all()


def test_no_data_that_a_byte_cannot_hold(tmp_path: Path) -> None:
    stored = RNG.integers(0, 100, (10, 12)).astype(np.uint8)
    path = write_tiff(tmp_path / "s.tif", stored, extratags=[(42113, "s", 0, "-9999", True)])
    np.testing.assert_array_equal(read_scan(path, None).heights, stored[::-1])


def test_oblong_pixels_are_held_against_the_pitch(tmp_path: Path) -> None:
    stored = RNG.normal(size=(10, 12))
    path = write_tiff(tmp_path / "s.tif", stored, resolution=(2, 1))
    assert read_scan(path, None).steps == (0.5, 1.0)
    with pytest.raises(InputError, match=r"ratio of x to y.*pitch_um = \[0.1, 0.2\]"):
        load_scan(SurfaceSource(path=str(path), pitch_um=0.1, height_unit="um"))
    assert read_scan(write_tiff(tmp_path / "t.tif", stored, resolution=(72, 72)), None).steps is None


def test_no_sound_image_is_called_damaged(tmp_path: Path) -> None:
    path = write_tiff(tmp_path / "s.tif", np.zeros((10, 12), np.complex64))
    with pytest.raises(InputError) as caught:
        read_scan(path, None)
    assert "damaged" not in str(caught.value)
    objects = tmp_path / "objects.npy"
    np.save(objects, np.array([[None] * 9] * 9), allow_pickle=True)
    with pytest.raises(InputError, match="an array of Python objects") as caught:
        read_scan(objects, None)
    assert "damaged" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "chosen"),
    [
        ([("Texture (R)", "", "m"), ("Depth", "m", "m")], ("Depth",)),
        ([("Intensity", "", "m"), ("Data", "m", "m")], ("Data",)),
        ([("Height", "m", "1/m"), ("Topo", "m", "m")], ("Topo",)),
        ([("Test", "", "")], ("Test",)),
    ],
)
def test_fields_of_gwyddion(tmp_path: Path, fields: list[tuple[str, str, str]], chosen: tuple[str, ...]) -> None:
    pytest.importorskip("gwyfile")
    from gwyfile.objects import GwyContainer, GwyDataField

    container = GwyContainer()
    for number, (title, unit_z, unit_xy) in enumerate(fields):
        container[f"/{number}/data/title"] = title
        container[f"/{number}/data"] = GwyDataField(
            RNG.normal(size=(10, 12)), xreal=6e-6, yreal=10e-6, si_unit_xy=unit_xy, si_unit_z=unit_z
        )
    path = tmp_path / "s.gwy"
    container.tofile(str(path))
    scan = read_scan(path, None)
    assert scan.channels == chosen
    assert scan.steps == (None if fields[0][2] else pytest.approx((0.5e-6, 1e-6)))


@pytest.mark.parametrize("name", ["i_f64.tif", "i_i8.tif", "i_i16.tif", "i_f32_gdal_nodata.tif"])
def test_images_of_the_field(name: str) -> None:
    tifffile = pytest.importorskip("tifffile")
    path = shared_file(f"field/{name}")
    heights, stored = read_scan(path, None).heights[::-1], tifffile.imread(path)
    measured = ~np.isnan(heights)
    np.testing.assert_array_equal(heights[measured], stored[measured])
    assert set(stored[~measured]) <= {-9999.0}


def test_grey_png_is_as_before(tmp_path: Path) -> None:
    stored = RNG.integers(0, 255, (10, 12)).astype(np.uint8)
    Image.fromarray(stored).save(tmp_path / "s.png", dpi=(300, 300))
    scan = read_scan(tmp_path / "s.png", None)
    np.testing.assert_array_equal(scan.heights, stored[::-1])
    assert (scan.full_code, scan.steps) == (255, None)


def test_damaged_tags_raise_no_other_error(tmp_path: Path) -> None:
    path = write_tiff(tmp_path / "s.tif", RNG.normal(size=(10, 12)))
    sound = path.read_bytes()
    for _ in range(200):
        data = bytearray(sound)
        for place in RNG.integers(4, 300, 3):
            data[place] = RNG.integers(256)
        path.write_bytes(bytes(data))
        with suppress(InputError):
            read_scan(path, None)


# --- units in images ---------------------------------------------------------------------------------


def _codes() -> np.ndarray:
    return np.arange(120, dtype=np.uint16).reshape(10, 12) * 500


def _gwyddion_png(path: Path, **others: str) -> Path:
    """A 16-bit PNG by Gwyddion: ZMin is the height of code 0, ZMax that of the largest code."""
    texts = PngInfo()
    entries = {"XReal": "6e-6", "YReal": "2e-6", "ZMin": "-1e-7", "ZMax": "2e-7", "XYUnit": "m", "ZUnit": "m"}
    for key, text in (entries | others).items():
        texts.add_text(f"Gwy::{key}", text)
    Image.fromarray(_codes()).save(path, pnginfo=texts)
    return path


def test_units_of_a_gwyddion_png(tmp_path: Path) -> None:
    path = _gwyddion_png(tmp_path / "a.png")
    field, record = load_scan(SurfaceSource(path=str(path)))
    assert field.pitch_um == pytest.approx((0.5, 0.2))
    np.testing.assert_allclose(field.heights_um, _codes()[::-1] * 0.3 / 65535)
    assert (record.pitch_from, record.unit_from) == ("file", "file")
    for keys in ({"height_range_um": 1.0}, {"pitch_um": 0.5}):
        with pytest.raises(InputError, match=r"agree, found .* in the file, but surface"):
            load_scan(SurfaceSource(path=str(path), **keys))
        load_scan(SurfaceSource(path=str(path), override_file_units=True, **keys))


def test_a_gwyddion_png_of_volts_is_no_height_map(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found values in 'V'"):
        read_scan(_gwyddion_png(tmp_path / "a.png", ZUnit="V"), None)


@pytest.mark.parametrize(
    ("unit", "pitch"), [("um", 0.05), ("micron", 0.05), ("\\u00B5m", 0.05), ("nm", 5e-5), ("inch", None), ("", None)]
)
def test_units_of_an_imagej_tiff(tmp_path: Path, unit: str, pitch: float | None) -> None:
    tifffile = pytest.importorskip("tifffile")
    lines = {"unit": unit, "cf": 0, "c0": -3.0, "c1": 0.5, "vunit": "nm"}
    tifffile.imwrite(tmp_path / "a.tif", _codes(), imagej=True, resolution=(20, 20), metadata=lines)
    scan = read_scan(tmp_path / "a.tif", None)
    assert scan.pitch_um == (None if pitch is None else pytest.approx((pitch, pitch)))
    assert scan.um_per_unit == pytest.approx(0.5e-3)
