"""Files of microscopes that the tests write: fields, directions, names, dates, and channels beside the heights."""

import struct
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.surface.load import load_scan
from pipeline.surface.readers import read_scan
from pipeline.surface.readers.common import pick_channel
from pipeline.surface.source import SurfaceSource
from tests.support import shared_file
from tests.surface.test_profilometers import mdt

RNG = np.random.default_rng(5)
HEADER_BYTES = 8192


@pytest.fixture(autouse=True)
def _library() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)


# --- Nanoscope ---------------------------------------------------------------------------------------

IMAGE: dict[str, Any] = {
    "Bytes/pixel": 2,
    "Start context": "OL",
    "Data type": "AFM",
    "Frame direction": "Up",
    "Aspect Ratio": "1:1",
    "Scan Size": "10 10 ~m",
    "Scan Line": "Main",
    "Line Direction": "Trace",
}
Z_SCALE = "V [Sens. Zscan] (0.006713867 V/LSB) 440.0000 V"


def write_nanoscope(
    path: Path,
    images: list[tuple[str, NDArray[Any], dict[str, Any]]],
    scan: dict[str, Any] | None = None,
    date: str = "10:18:12 AM Fri Jun 20 2014",
) -> Path:
    """Writes images, bottom line first: (name, codes, entries of the header)."""
    lines = ["\\*File list", "\\Version: 0x05310001", f"\\Date: {date}", "\\Start context: OL2", "\\*Scanner list"]
    lines += ["\\@Sens. Zsens: V 15.068 nm/V", "\\*Ciao scan list"]
    rows, columns = images[0][1].shape
    listed = {"Scan Size": "10000 nm", "Samps/line": columns, "Lines": rows, "Aspect Ratio": "1:1", **(scan or {})}
    lines += [f"\\{key}: {value}" for key, value in listed.items()] + ["\\@Sens. Zscan: V 15.068 nm/V"]
    offset, data = HEADER_BYTES, b""
    for name, codes, entries in images:
        samples = codes.astype("<i2").tobytes()
        own = {"Data offset": offset, "Data length": len(samples), **IMAGE}
        own |= {"Samps/line": codes.shape[1], "Number of lines": codes.shape[0], "@2:Z scale": Z_SCALE, **entries}
        own |= {"@2:Image Data": f'S [{name}] "{name}"'}
        lines += ["\\*Ciao image list", *(f"\\{key}: {value}" for key, value in own.items())]
        offset += len(samples)
        data += samples
    header = "\r\n".join([*lines, "\\*File list end", "\x1a"]).encode("latin-1")
    path.write_bytes(header.ljust(HEADER_BYTES, b"\0") + data)
    return path


def codes(rows: int, columns: int) -> NDArray[Any]:
    return RNG.integers(-1000, 1000, (rows, columns))


@pytest.mark.parametrize(
    ("shape", "image", "scan", "field"),
    [
        # "Capture Now": part of the lines of a square scan
        ((45, 64), {"Aspect Ratio": "0.516184"}, {"Lines": 64}, (10, 10 * 45 / 64)),
        ((20, 64), {"Aspect Ratio": "0.3"}, {"Lines": 64}, (10, 10 * 20 / 64)),
        # 2:1
        ((32, 64), {"Aspect Ratio": "2:1"}, {"Aspect Ratio": "2:1"}, (10, 5)),
        ((16, 64), {"Aspect Ratio": "4:1"}, {"Aspect Ratio": "4:1", "Lines": 16}, (10, 2.5)),
        # the field is given as it is
        ((32, 64), {"Aspect Ratio": "2:1", "Scan Size": "10 5 ~m"}, {"Aspect Ratio": "2:1"}, (10, 5)),
        ((32, 64), {}, {}, (10, 10)),
        ((64, 64), {"Aspect Ratio": "1:1"}, {}, (10, 10)),
        # newer files state the slow axis
        ((32, 64), {"Aspect Ratio": "2:1"}, {"Slow Axis Size": "5000 nm"}, (10, 5)),
    ],
)
def test_field_of_a_nanoscope_scan(
    tmp_path: Path, shape: tuple[int, int], image: dict[str, Any], scan: dict[str, Any], field: tuple[float, float]
) -> None:
    stored = codes(*shape)
    path = write_nanoscope(tmp_path / "scan.001", [("Height", stored, image)], scan)
    found = read_scan(path, None)
    assert found.pitch_um == pytest.approx((field[0] / shape[1], field[1] / shape[0]))
    assert np.corrcoef(found.heights.ravel(), stored.ravel())[0, 1] == pytest.approx(1)


@pytest.mark.parametrize(
    "date", ["10:18:12 AM Fr Jun 20 2014", "10:18:12 vendredi 20 juin 2014", "", "2014-13-45", "ven. 20/06", "??"]
)
def test_foreign_dates_stop_nothing(tmp_path: Path, date: str) -> None:
    path = write_nanoscope(tmp_path / "scan.001", [("Height", codes(16, 16), {})], date=date)
    assert read_scan(path, None).heights.shape == (16, 16)


def test_an_odd_unit_in_another_channel_stops_nothing(tmp_path: Path) -> None:
    stored = codes(16, 16)
    odd = {"@2:Z scale": "V [Sens. Zscan] (0.1 V/LSB) 440.0 Arb"}
    path = write_nanoscope(tmp_path / "scan.001", [("Phase", codes(16, 16), odd), ("Height", stored, {})])
    found = read_scan(path, None)
    assert found.channel == "Height"
    assert np.corrcoef(found.heights.ravel(), stored.ravel())[0, 1] == pytest.approx(1)


def test_names_of_a_nanoscope_scan_say_the_direction(tmp_path: Path) -> None:
    a, b, c = codes(16, 16), codes(16, 16), codes(16, 16)
    images = [
        ("Height", a, {"Line Direction": "Retrace"}),
        ("Height", b, {}),
        ("Height", c, {"Scan Line": "Interleave"}),
    ]
    path = write_nanoscope(tmp_path / "scan.001", images)
    found = read_scan(path, None)
    assert found.channels == ("Height retrace", "Height", "Height interleave")
    assert (found.channel, found.format) == ("Height", "Bruker/Veeco Nanoscope, trace")
    assert np.corrcoef(found.heights.ravel(), b.ravel())[0, 1] == pytest.approx(1)
    retrace = read_scan(path, "Height retrace")
    assert np.corrcoef(retrace.heights.ravel(), a.ravel())[0, 1] == pytest.approx(1)


@pytest.mark.parametrize("order", [1, -1])
def test_a_sensor_comes_before_the_piezo(tmp_path: Path, order: int) -> None:
    images: list[tuple[str, NDArray[Any], dict[str, Any]]] = [
        ("Height", codes(16, 16), {}),
        ("Height Sensor", codes(16, 16), {}),
    ]
    assert read_scan(write_nanoscope(tmp_path / "scan.001", images[::order]), None).channel == "Height Sensor"


@pytest.mark.parametrize("name", ["Deflection", "Amplitude", "AmplitudeError", "Phase", "Deflection Error"])
def test_a_channel_that_is_no_height_is_not_taken_unasked(tmp_path: Path, name: str) -> None:
    path = write_nanoscope(tmp_path / "scan.001", [(name, codes(16, 16), {})])
    with pytest.raises(InputError, match=f"only '{name}'; choose by surface.channel"):
        read_scan(path, None)
    assert read_scan(path, name).channel == name


def test_text_form_is_not_damaged(tmp_path: Path) -> None:
    path = tmp_path / "text.001"
    path.write_bytes(b"?*File list\r\n?Version: 0x05310001\r\n?*File list end\r\n1\t2\r\n")
    with pytest.raises(InputError, match="stored as text") as caught:
        read_scan(path, None)
    assert "damaged" not in str(caught.value)


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["Height", "ZSensor"], "ZSensor"),
        (["Height (measured)", "Height"], "Height (measured)"),
        (["HeightRetrace", "HeightTrace", "ZSensorRetrace", "ZSensorTrace"], "ZSensorTrace"),
        (["Amplitude", "Z backward", "Z"], "Z"),
        (["Phase", "Topography"], "Topography"),
    ],
)
def test_the_rule_of_the_choice(names: list[str], chosen: str) -> None:
    assert names[pick_channel("file", names, None)] == chosen
    assert names[pick_channel("file", names[::-1], None) * -1 - 1] == chosen


# --- Nanosurf ----------------------------------------------------------------------------------------


def write_nid(path: Path, sets: list[tuple[NDArray[Any], dict[str, Any]]], info: str = "Date=01-03-2016\r\n") -> Path:
    """Writes data sets, bottom line first."""
    lines = ["[DataSet]", "Version=2", f"GroupCount={len(sets)}"]
    for i in range(len(sets)):
        lines += [f"Gr{i}-Count=1", f"Gr{i}-Ch0=DataSet-{i}:0"]
    lines += ["[DataSet-Info]", "-- Scan --=--------", info.strip()]
    for i, (stored, entries) in enumerate(sets):
        own = {"Points": stored.shape[1], "Lines": stored.shape[0], "Frame": "Scan forward"}
        own |= {"Dim0Unit": "m", "Dim0Range": 1e-5, "Dim1Unit": "m", "Dim1Range": 2e-5}
        own |= {"Dim2Name": "Z-Axis", "Dim2Unit": "m", "Dim2Range": 2e-6, "Dim2Min": -1e-6}
        own |= {"SaveMode": "Binary", "SaveBits": 16, "SaveSign": "Signed", "SaveOrder": "Intel", **entries}
        lines += [f"[DataSet-{i}:0]", *(f"{key}={value}" for key, value in own.items())]
    samples = b"".join(stored.astype("<i2").tobytes() for stored, _ in sets)
    path.write_bytes("\r\n".join([*lines, "", ""]).encode("latin-1") + b"#!" + samples)
    return path


@pytest.mark.parametrize("info", ["", "Date=2016-03-01\r\nTime=6 PM\r\n", "Date=1. März 2016\r\n"])
def test_nanosurf_needs_no_date(tmp_path: Path, info: str) -> None:
    stored = codes(12, 16)
    found = read_scan(write_nid(tmp_path / "scan.nid", [(stored, {})], info), None)
    np.testing.assert_allclose(found.heights, stored * 2e-6 / 65536, atol=1e-20)
    assert found.pitch_um == pytest.approx((10 / 16, 20 / 12))
    assert (found.um_per_unit, found.channel) == (1e6, "Scan forward (Z-Axis)")


@pytest.mark.parametrize("entry", [b"GroupCount=1", b"Gr0-Count=1"])
def test_counts_of_nanosurf_are_not_trusted(tmp_path: Path, entry: bytes) -> None:
    path = write_nid(tmp_path / "scan.nid", [(codes(12, 16), {})])
    path.write_bytes(path.read_bytes().replace(entry, entry[:-1] + b"9" * 12))
    begun = time.process_time()
    with suppress(InputError):
        read_scan(path, None)
    assert time.process_time() - begun < 1


@pytest.mark.parametrize("unit", ["Unit0", "", "1/s", "V"])
def test_curves_beside_an_image_stop_nothing(tmp_path: Path, unit: str) -> None:
    stored = codes(12, 16)
    curve = (codes(4, 100), {"Dim0Unit": unit, "Frame": "Spec forward"})
    for sets in ([curve, (stored, {})], [(stored, {}), curve]):
        found = read_scan(write_nid(tmp_path / "scan.nid", sets), None)
        np.testing.assert_allclose(found.heights, stored * 2e-6 / 65536, atol=1e-20)
        assert found.channels == ("Scan forward (Z-Axis)",)


@pytest.mark.parametrize("top", [True, False])
def test_lines_beyond_the_current_one_are_holes(tmp_path: Path, top: bool) -> None:
    stored = codes(16, 16)
    unscanned = slice(10, None) if top else slice(0, 6)
    stored[unscanned] = 0
    found = read_scan(write_nid(tmp_path / "scan.nid", [(stored, {"CurLine": 9})]), None)
    holes = np.isnan(found.heights).all(axis=1)
    assert holes[unscanned].all()
    assert np.count_nonzero(np.isnan(found.heights)) == 6 * 16


def test_a_cut_nanosurf_file_is_damaged(tmp_path: Path) -> None:
    path = write_nid(tmp_path / "scan.nid", [(codes(12, 16), {})])
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match="damaged or cut short"):
        read_scan(path, None)


# --- Igor --------------------------------------------------------------------------------------------


def write_ibw(path: Path, layers: dict[bytes, NDArray[Any]]) -> Path:
    """Writes an Igor wave of version 5 with its layers' labels, as Asylum does."""
    rows, columns = next(iter(layers.values())).shape
    samples = b"".join(layer.T.astype("<f4").tobytes(order="F") for layer in layers.values())
    wave = struct.pack("<4iHH6sh", 0, 0, 0, rows * columns * len(layers), 2, 0, b"", 1) + b"scan".ljust(32, b"\0")
    wave += struct.pack("<ii4i", 0, 0, columns, rows, len(layers), 0)
    wave += struct.pack("<4d4d", 1e-7, 2e-7, 1, 1, 0, 0, 0, 0)
    wave += b"m\0\0\0" + b"m\0\0\0" * 2 + b"\0" * 8
    wave = wave.ljust(320, b"\0") + samples
    labels = b"".join(label.ljust(32, b"\0")[:32] for label in (b"", *layers))
    header = struct.pack("<hhiiii4i4iiii", 5, 0, len(wave), 0, 0, 0, 0, 0, 0, 0, 0, 0, len(labels), 0, 0, 0, 0)
    words = struct.unpack("<32h", header)
    header = header[:2] + struct.pack("<H", -sum(words[:1] + words[2:]) & 0xFFFF) + header[4:]
    path.write_bytes(header + wave + labels)
    return path


def test_names_of_igor_layers_end_at_their_nul(tmp_path: Path) -> None:
    a, b = RNG.normal(0, 1e-8, (10, 12)), RNG.normal(0, 1e-8, (10, 12))
    layers = {b"HeightTrace\0e": a, b"HeightRetrace\0ce\0x": b}
    path = write_ibw(tmp_path / "scan.ibw", layers)
    found = read_scan(path, "HeightTrace")
    assert found.channels == ("HeightTrace", "HeightRetrace")
    assert found.pitch_um == pytest.approx((0.1, 0.2))
    assert abs(np.corrcoef(found.heights.ravel(), a.ravel())[0, 1]) == pytest.approx(1)


# --- files of the field ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "shape", "pitch"),
    [
        ("di_capture_now.001", (90, 128), 10 / 128),
        ("nanoscope_date_german.001", (128, 128), 10 / 128),
        ("nanosurf_no_date.nid", (64, 64), 10 / 64),
        ("nanosurf_image_and_spectroscopy.nid", (64, 64), 10 / 64),
        ("asylum_stale_label.ibw", (32, 32), 10 / 32),
    ],
)
def test_files_of_the_field(name: str, shape: tuple[int, int], pitch: float) -> None:
    found = read_scan(shared_file(f"field/{name}"), None)
    assert found.heights.shape == shape
    assert found.pitch_um == pytest.approx((pitch, pitch))


def test_stale_labels_and_deflection_of_the_field() -> None:
    assert read_scan(shared_file("field/asylum_stale_label.ibw"), "HeightTrace").channels[1] == "HeightRetrace"
    with pytest.raises(InputError, match="only 'Deflection'"):
        read_scan(shared_file("field/d_only_deflection.001"), None)


# --- Asylum, NT-MDT and Park -------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "cropped"), [("zeros", (100, 0)), ("nan", (0, 106)), ("repeats", (0, 106))])
def test_unscanned_rows_of_an_igor_wave(tmp_path: Path, kind: str, cropped: tuple[int, int]) -> None:
    data = bytearray(shared_file("scans/spot_1-1000nm.ibw").read_bytes())
    # layers of 256 x 256 floats behind the headers
    lines = np.frombuffer(data, "<f4", 8 * 256 * 256, 64 + 320).reshape(8, 256, 256)
    if kind == "zeros":
        lines[:, :100] = 0
    else:
        lines[:, 150:] = np.nan if kind == "nan" else lines[:, 149:150]
    (tmp_path / "a.ibw").write_bytes(data)
    field, record = load_scan(SurfaceSource(path=str(tmp_path / "a.ibw")))
    assert record.cropped == (*cropped, 0, 0)
    assert field.shape == (256 - sum(cropped), 256)
    assert "was not measured" in record.warnings[0]


@pytest.mark.parametrize(
    ("code", "um"), [(-3, 1e3), (-2, 1.0), (-1, 1e-3), (0, 1e-4), (-10, None), (1, None), (3, None), (8, None)]
)
def test_units_of_an_mdt_frame(tmp_path: Path, code: int, um: float | None) -> None:
    """Codes of lengths from mm to angstrom; others are charges, voltages, angles and counts."""
    heights = struct.pack("<ffh", 0, 1, -1)
    (tmp_path / "a.mdt").write_bytes(mdt().replace(heights, struct.pack("<ffh", 0, 1, code)))
    if um is None:
        with pytest.raises(InputError, match="none in a unit of length"):
            read_scan(tmp_path / "a.mdt", None)
        return
    scan = read_scan(tmp_path / "a.mdt", None)
    assert scan.um_per_unit is not None
    assert np.ptp(scan.heights) * scan.um_per_unit == pytest.approx(119 * um)
    assert scan.pitch_um == pytest.approx((0.1, 0.2))


def test_an_error_signal_of_park_is_not_taken_unasked(tmp_path: Path) -> None:
    data = shared_file("scans/example_ps.tiff").read_bytes()
    name, other = "Z Height".encode("utf-16-le"), "Z Error\0".encode("utf-16-le")
    (tmp_path / "a.tiff").write_bytes(data.replace(name, other))
    with pytest.raises(InputError, match=r"only 'Z Error'; choose by surface\.channel"):
        read_scan(tmp_path / "a.tiff", None)
