"""load_scan: whose units count, which are asked for, and what is refused before any work."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pipeline.errors import InputError
from pipeline.surface.heightfield import HeightField
from pipeline.surface.load import ScanRecord, load_scan
from pipeline.surface.source import SurfaceSource

DATA = Path(__file__).parents[2].parent / "shared" / "data"
RAMP = np.arange(120.0).reshape(10, 12)


def load(path: Path, **keys: Any) -> tuple[HeightField, ScanRecord]:
    return load_scan(SurfaceSource(path=str(path), **keys))


def message_of(path: Path, **keys: Any) -> str:
    with pytest.raises(InputError) as caught:
        load(path, **keys)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path.name}: expected ")
    return message


@pytest.fixture
def npy(tmp_path: Path) -> Path:
    """A ramp without units."""
    path = tmp_path / "ramp.npy"
    np.save(path, RAMP)
    return path


@pytest.fixture
def png(tmp_path: Path) -> Path:
    path = tmp_path / "ramp.png"
    Image.fromarray(RAMP.astype(np.uint16)[::-1]).save(path)
    return path


@pytest.fixture
def text(tmp_path: Path) -> Path:
    """A ramp with units: pitch 0.5 x 1 um, heights in nm."""
    path = tmp_path / "ramp.txt"
    np.savetxt(path, RAMP[::-1], header="Width: 6 um\nHeight: 10 um\nValue units: nm")
    return path


def save(tmp_path: Path, heights: NDArray[Any]) -> Path:
    path = tmp_path / "some.npy"
    np.save(path, heights)
    return path


# --- units -------------------------------------------------------------------------------------------


def test_array_with_units_of_the_config(npy: Path) -> None:
    field, record = load(npy, pitch_um=(0.1, 0.2), height_unit="nm")
    np.testing.assert_allclose(field.heights_um, RAMP * 1e-3)
    assert field.pitch_um == (0.1, 0.2)
    assert (record.pitch_from, record.unit_from, record.um_per_unit) == ("config", "config", 1e-3)
    assert load(npy, pitch_um=0.1, height_unit="pm")[0].pitch_um == (0.1, 0.1)


def test_image_with_its_range(png: Path) -> None:
    field, record = load(png, pitch_um=0.1, height_range_um=65.535)
    np.testing.assert_allclose(field.heights_um, RAMP * 1e-3)
    assert record.um_per_unit == pytest.approx(1e-3)


def test_text_with_units_of_its_own(text: Path) -> None:
    field, record = load(text)
    np.testing.assert_allclose(field.heights_um, RAMP * 1e-3)
    assert field.pitch_um == pytest.approx((0.5, 1.0))
    assert (record.pitch_from, record.unit_from) == ("file", "file")


def test_record_is_json_without_folders(text: Path) -> None:
    record = load(text)[1]
    stored = json.dumps(dataclasses.asdict(record))
    assert record.file == "ramp.txt"
    assert str(text.parent) not in stored
    assert json.loads(stored)["shape"] == [10, 12]
    assert record.holes == 0


def test_every_missing_key_is_named_at_once(npy: Path, png: Path) -> None:
    assert "set surface.pitch_um" in message_of(npy)
    assert "surface.height_unit" in message_of(npy)
    assert "surface.pitch_um" not in message_of(npy, pitch_um=0.1)
    assert "surface.height_unit" not in message_of(npy, height_unit="nm")
    assert "surface.height_range_um" in message_of(png)
    assert "surface.pitch_um" in message_of(png)


def test_a_repeated_unit_may_agree_to_a_thousandth(text: Path) -> None:
    field, record = load(text, pitch_um=(0.5004, 1.0), height_unit="nm")
    assert field.pitch_um == pytest.approx((0.5, 1.0))
    assert record.pitch_from == "file"


def test_contradictions_name_both_values_and_the_remedy(text: Path) -> None:
    pitch, unit = message_of(text, pitch_um=(0.501, 1.0)), message_of(text, height_unit="um")
    assert "0.5 x 1 um in the file" in pitch
    assert "surface.pitch_um = 0.501 x 1" in pitch
    assert "stored in 0.001 um" in unit
    assert "surface.height_unit = 'um'" in unit
    for message in (pitch, unit):
        assert message.endswith("remove the key, or set surface.override_file_units = true")


def test_override(tmp_path: Path) -> None:
    text = tmp_path / "mislabelled.txt"
    np.savetxt(text, RAMP[::-1] / 2, header="Width: 6 um\nHeight: 10 um\nValue units: nm")
    field, record = load(text, pitch_um=0.3, height_unit="um", override_file_units=True)
    assert field.pitch_um == (0.3, 0.3)
    assert np.ptp(field.heights_um) == 59.5
    assert (record.pitch_from, record.unit_from) == ("config", "config")


def test_keys_of_the_wrong_kind_of_file(npy: Path, png: Path) -> None:
    assert "use surface.height_unit instead" in message_of(npy, pitch_um=0.1, height_range_um=1.0)
    assert "set surface.height_range_um instead" in message_of(png, pitch_um=0.1, height_unit="nm")


# --- values ------------------------------------------------------------------------------------------


def test_holes_are_kept_and_counted(tmp_path: Path) -> None:
    heights = RAMP.copy()
    heights[2:8, 3:9] = np.nan
    field, record = load(save(tmp_path, heights), pitch_um=0.1, height_unit="nm")
    assert record.holes == np.isnan(field.heights_um).sum() == 36
    heights[9, 0] = np.nan
    path = save(tmp_path, heights)
    assert "37 holes" in message_of(path, pitch_um=0.1, height_unit="nm")
    assert "raise surface.max_hole_share" in message_of(path, pitch_um=0.1, height_unit="nm")
    assert load(path, pitch_um=0.1, height_unit="nm", max_hole_share=0.31)[1].holes == 37
    assert "no more than 10 %" in message_of(path, pitch_um=0.1, height_unit="nm", max_hole_share=0.1)


def test_rows_that_were_not_scanned_are_cropped(tmp_path: Path) -> None:
    heights = np.vstack([RAMP, RAMP + 120])
    heights[:9] = np.nan
    field, record = load(save(tmp_path, heights), pitch_um=0.1, height_unit="nm")
    np.testing.assert_array_equal(field.heights_um, heights[9:] * 1e-3)
    assert (record.shape, record.cropped, record.holes) == ((11, 12), (9, 0, 0, 0), 0)
    assert record.unmeasured_share == 0.45
    heights[:13] = np.nan
    assert "7 x 12 (rows x columns)" in message_of(save(tmp_path, heights), pitch_um=0.1, height_unit="nm")


def test_infinite_is_no_hole(tmp_path: Path) -> None:
    heights = RAMP.copy()
    heights[0, :2] = np.inf, -np.inf
    assert "2 infinite values" in message_of(save(tmp_path, heights), pitch_um=0.1, height_unit="nm")


@pytest.mark.parametrize(
    ("heights", "says"),
    [
        (np.full((9, 9), np.nan), "NaN everywhere"),
        (np.full((9, 9), 4.0), "kind = 'mirror'"),
        (np.zeros((1, 100)), "found 1 x 100"),
        (np.zeros((9, 7)), "found 9 x 7"),
        (np.zeros((8, 8193), np.int8), "crop or resample"),
        (np.zeros((9, 9, 1)), "3-D"),
        (np.zeros((0, 0)), "0 x 0"),
    ],
)
def test_refused_values(tmp_path: Path, heights: NDArray[Any], says: str) -> None:
    assert says in message_of(save(tmp_path, heights), pitch_um=0.1, height_unit="nm")


def test_refusals_of_values_come_before_questions_of_units(tmp_path: Path) -> None:
    assert "NaN everywhere" in message_of(save(tmp_path, np.full((9, 9), np.nan)))


@pytest.mark.parametrize(("unit", "found"), [("m", "1.19e+08 um"), ("mm", "119000 um")])
def test_mislabelled_heights(npy: Path, unit: str, found: str) -> None:
    message = message_of(npy, pitch_um=0.1, height_unit=unit)
    assert f"found {found}" in message
    assert "(from the config)" in message
    assert message.endswith("mislabelled units? set surface.height_unit")


def test_heights_mislabelled_by_the_file(tmp_path: Path) -> None:
    path = tmp_path / "mislabelled.txt"
    np.savetxt(path, RAMP, header="Width: 6 um\nHeight: 10 um\nValue units: mm")
    message = message_of(path)
    assert "(from the file)" in message
    assert message.endswith("set surface.height_unit and surface.override_file_units = true")


def test_heights_too_small_and_ranges_too_large(tmp_path: Path, png: Path) -> None:
    assert "found 1.19e-07 um" in message_of(save(tmp_path, RAMP * 1e-3), pitch_um=0.1, height_unit="pm")
    assert "set surface.height_range_um" in message_of(png, pitch_um=0.1, height_range_um=1e6)


@pytest.mark.parametrize("pitch", [(0.1, 9e-5), (101.0, 0.1)])
def test_pitch_out_of_reach(npy: Path, pitch: tuple[float, float]) -> None:
    assert "mislabelled units? set surface.pitch_um" in message_of(npy, pitch_um=pitch, height_unit="nm")


def test_a_recipe_is_no_file() -> None:
    with pytest.raises(ValueError, match="recipe"):
        load_scan(SurfaceSource.model_validate({"recipe": {"kind": "mirror"}}))


# --- real scans --------------------------------------------------------------------------------------


def test_elaphe() -> None:
    path = DATA / "snakes" / "elaphe_65um.png"
    if not path.exists():
        pytest.skip(f"no real scans here: {path} is absent")
    field, record = load(path, pitch_um=65 / 1332, height_range_um=0.518)
    assert field.size_um == pytest.approx((65.0, 65.0))
    assert np.ptp(field.heights_um) == pytest.approx(0.518)
    assert record.format == "PNG image, RGBA"


def test_gwyddion_file_asks_for_both_units() -> None:
    pytest.importorskip("gwyfile")
    path = DATA / "scans" / "test.gwy"
    if not path.exists():
        pytest.skip(f"no real scans here: {path} is absent")
    message = message_of(path)
    assert "surface.pitch_um" in message
    assert "surface.height_unit" in message
    assert load(path, pitch_um=0.1, height_unit="um")[0].shape == (128, 128)


def test_microscope_file_needs_no_keys() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    path = DATA / "scans" / "nanoscope.000"
    if not path.exists():
        pytest.skip(f"no real scans here: {path} is absent")
    field, record = load(path)
    assert field.size_um == pytest.approx((2.0, 2.0))
    assert (record.pitch_from, record.unit_from, record.um_per_unit) == ("file", "file", 1e-3)
    assert "0.00390625 x 0.00390625 um in the file" in message_of(path, pitch_um=0.0039)
