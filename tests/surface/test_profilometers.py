"""Files of more instruments, written by the tests from the published layouts: orientation, units, voids, names."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.surface.readers import read_scan
from tests.surface.asymmetric import NX, NY, PITCH_UM, TOP_FIRST, VOID, check, check_cut, packed, padded, with_void

pytestmark = pytest.mark.usefixtures("surface_topography")


def mdt(adc: int = 0) -> bytes:
    """NT-MDT: one frame, the bottom line first."""
    scales = struct.pack("<ffh", 0, 0.1, -2) + struct.pack("<ffh", 0, 0.2, -2) + struct.pack("<ffh", 0, 1, -1)
    variables = scales + struct.pack("<BBHHH", adc, 0, NX, NY, 0)[:6] + b"\0" * 41
    data = struct.pack("<HHHH", 0, NX, NY, 0) + TOP_FIRST[::-1].astype("<i2").tobytes()
    size = 22 + len(variables) + len(data)
    frame = struct.pack("<IHBB7H", size, 0, 7, 2, 2014, 6, 20, 10, 0, 0, len(variables)) + variables + data
    return struct.pack("<4sI4sH18sB", b"\x01\xb0\x93\xff", len(frame), b"", 0, b"", 0) + frame


def frt() -> bytes:
    """FRT MicroProf: the bottom line first; 1 is a void."""
    stored = np.ascontiguousarray((with_void(0, "<i4") * 10)[::-1])
    stored[stored == 0] = 1
    blocks = {
        0x66: struct.pack("<III", NX, NY, 32),
        0x67: struct.pack("<5dI", 1.2e-6, 2e-6, 0, 0, 1, 0),
        0x6C: struct.pack("<Id", 0, 1e-10),
        0x0B: stored.tobytes(),
    }
    body = b"".join(struct.pack("<HI", tag, len(data)) + data for tag, data in blocks.items())
    return b"FRTM_GLIDERV1.00" + struct.pack("<H", len(blocks)) + body


def metropro() -> bytes:
    """Zygo MetroPro: square pixels, the top line first; 2147483640 and more are voids."""
    header = bytearray(834)
    struct.pack_into(">4sHI", header, 0, b"\x88\x1b\x03\x6f", 1, 834)
    struct.pack_into(">hhHHI", header, 64, 0, 0, NX, NY, 4 * NX * NY)
    # heights are counts * scale * obliquity * wavelength / 4096: 1 nm
    struct.pack_into(">fffff", header, 164, 1.0, 4096e-9, 0, 1.0, 0)
    struct.pack_into(">f", header, 184, 1e-7)
    return bytes(header) + with_void(2147483640, ">i4").tobytes()


def os3d() -> bytes:
    """OmniSurf3D, by its published layout."""
    words = b"".join(struct.pack("<I", len(text)) + text for text in (b"test", b"2020-01-01"))
    header = b"OmniSurf3D" + struct.pack("<ii", 1, 0) + words + struct.pack("<iidddd", NX, NY, *PITCH_UM, 0, 0)
    return header + with_void(-3.4e38, "<f4").tobytes()


def tmd() -> bytes:
    """TrueMap version 2: millimetres."""
    header = padded("Binary TrueMap Data File v2.0\r\n", 32) + padded("test", 24)
    header += struct.pack("<IIffff", NX, NY, 1.2e-3, 2e-3, 0, 0)
    return header + (TOP_FIRST * 1e-6).astype("<f4").tobytes()


def nms() -> bytes:
    """NanoFocus: codes over the range of the heights."""
    header = bytearray(3468)
    struct.pack_into("<dd", header, 16, 0.0, 65534e-3)
    struct.pack_into("<IIdd", header, 1368, NX, NY, 1e-4, 2e-4)
    return bytes(header) + with_void(65535, "<u2").tobytes()


def zmg() -> bytes:
    """KLA Zeta: codes times a step in micrometres."""
    header = padded("Zeta-Instruments", 85) + struct.pack("<II4sfff8sI10s", NX, NY, b"", *PITCH_UM, 1e-3, b"", 0, b"")
    return header + b"\0" * 74 + TOP_FIRST.astype("<u2").tobytes()


def vk4() -> bytes:
    """Keyence VK4: lengths in picometres."""
    offset = 12 + 17 * 4 + 4 + 76 * 4
    table = [84, 0, 0, 0, 0, 0, offset, *[0] * 10]
    conditions = [0] * 76
    conditions[:4] = 304, 2020, 1, 1
    conditions[42:45] = 100_000, 200_000, 1000
    image = struct.pack("<7I", NX, NY, 32, 0, 4 * NX * NY, 0, 0) + b"\0" * 768 + TOP_FIRST.astype("<u4").tobytes()
    return b"VK4_" + b"\0" * 8 + struct.pack("<17I", *table) + b"\0" * 4 + struct.pack("<76I", *conditions) + image


def vk6() -> bytes:
    """Keyence VK6: a VK4 file in a zip behind a thumbnail."""
    return b"VK6" + struct.pack("<I", 4) + b"BM\0\0" + packed({"Vk4File": vk4()})


def plux() -> bytes:
    """Sensofar: XML and one layer of floats, NaN for voids."""
    general = {"DATE": "2020-01-01 00:00:00", "IMAGE_SIZE_X": NX, "IMAGE_SIZE_Y": NY, "FOV_X": 0.1, "FOV_Y": 0.2}
    inside = "".join(f"<{key}>{value}</{key}>" for key, value in general.items())
    layer = "<LAYER_0><FILENAME_Z>LAYER_0.raw</FILENAME_Z></LAYER_0>"
    info = "<INFO><SIZE>1</SIZE><ITEM_0><NAME>Device</NAME><VALUE>S neox</VALUE></ITEM_0></INFO>"
    xml = f"<xml><GENERAL>{inside}</GENERAL>{layer}{info}</xml>"
    return packed({"index.xml": xml.encode(), "LAYER_0.raw": with_void(np.nan, "<f4").tobytes()})


def zon() -> bytes:
    """Keyence ZON: a zip behind a thumbnail, with a map of the samples that are valid."""
    heights = struct.pack("<iiii", NX, NY, 4, 4 * NX) + TOP_FIRST.astype("<i4").tobytes()
    valid = np.zeros((NY, NX), "u1")
    valid[VOID] = 1
    marks = struct.pack("<iiii", NX, NY, 1, NX) + valid.tobytes()
    units = "<C><XYCalibration><MeterPerPixel>1e-7</MeterPerPixel></XYCalibration>"
    units += "<ZCalibration><MeterPerUnit>1e-9</MeterPerUnit></ZCalibration></C>"
    members = {
        "cbc1d39b-215f-4d56-a20e-cf8e5f570755": b"<D><DeviceModelName>VR</DeviceModelName>"
        b"<DeviceSerialId>1</DeviceSerialId></D>",
        "1d35862b-3b48-4df2-9235-833ef590b043": b"<S><ScanDateTime>2020-01-01</ScanDateTime></S>",
        "686613b8-27b5-4a29-8ffc-438c2780873e": units.encode(),
        "4cdb0c75-5706-48cc-a9a1-adf395d609ae": heights,
        "9e7ca6dd-0e6a-4d7b-8986-f0a7b773c916": marks,
    }
    return b"KPK0" + struct.pack("<I", 4) + b"BM\0\0" + packed(members)


def opdx() -> bytes:
    """Dektak OPDx: a tree of named items; the extents reach from the first sample to the last."""

    def name(text: str) -> bytes:
        return struct.pack("<I", len(text.encode())) + text.encode()

    def sized(data: bytes) -> bytes:
        return struct.pack("<BI", 4, len(data)) + data

    def item(text: str, kind: int, data: bytes) -> bytes:
        return name(text) + bytes([kind]) + data

    def box(text: str, *items: bytes) -> bytes:
        return item(text, 0x7D, sized(b"".join(items) + name("") + b"\x7f" + b"\0\0"))

    def quantity(text: str, value: float, unit: str) -> bytes:
        return item(text, 0x13, sized(struct.pack("<d", value) + name(unit) + name(unit)))

    stored = with_void(np.nan, "<f4").tobytes()
    matrix = name("Matrix<float>") + struct.pack("<I", 0) + name("") + sized(struct.pack("<II", NY, NX) + stored)
    names = name("List") + sized(name("Raw"))
    meta = box(
        "MetaData",
        item("DataKind", 0x12, sized(b"Surface Height")),
        box("2D_Channels", item("Height", 0x42, names)),
    )
    raw = box(
        "Raw",
        item("DataKind", 0x12, sized(b"Height")),
        item("Dimension1Points", 0x07, struct.pack("<I", NY)),
        item("Dimension2Points", 0x07, struct.pack("<I", NX)),
        quantity("Dimension1Extent", 0.2 * (NY - 1), "µm"),
        quantity("Dimension2Extent", 0.1 * (NX - 1), "µm"),
        quantity("DataScale", 1.0, "nm"),
        item("Matrix", 0x00, matrix),
    )
    return b"VCA DATA\x01\x00\x00\x55" + meta + box("2D_Data", raw) + name("") + b"\x7f"


def wyko_ascii() -> bytes:
    """Wyko's text: a line is a column of the image, from the bottom; Bad is a void."""
    lines = [
        "Wyko ASCII Data File Format 0\t1\t1",
        f"X Size\t{NX}",
        f"Y Size\t{NY}",
        "Block Name\tType\tLength\tValue",
    ]
    lines += ["Wavelength\t7\t4\t1000", "Aspect\t7\t4\t2", "Pixel_size\t7\t4\t0.0001", "RAW_DATA\t3\t480\t"]
    lines += ["\t".join("Bad" if np.isnan(v) else f"{v}" for v in row) for row in with_void(np.nan, "f8")[::-1].T]
    return ("\r\n".join(lines) + "\r\n").encode()


def bsdf(kind: int, dtype: str, void: float) -> bytes:
    """Binary ISO 25178-71."""
    header = b"bISO-1.0" + padded("T", 10) + b"010120200000" * 2 + struct.pack("<HH", NX, NY)
    header += struct.pack("<ddddBBB", 1e-7, 2e-7, 1e-9, 1e-12, 0, kind, 0)
    return header + with_void(void, dtype).tobytes()


SQUARE = (0.1, 0.1)
# name -> (content, void, micrometres per unit of TOP_FIRST, pitch)
FILES: dict[str, tuple[Callable[[], bytes], bool, float, tuple[float, float]]] = {
    "a.mdt": (mdt, False, 1e-3, PITCH_UM),
    "a.frt": (frt, True, 1e-3, PITCH_UM),
    "a.dat": (metropro, True, 1e-3, SQUARE),
    "a.os3d": (os3d, True, 1.0, PITCH_UM),
    "a.tmd": (tmd, False, 1e-3, PITCH_UM),
    "a.nms": (nms, True, 1e-3, PITCH_UM),
    "a.zmg": (zmg, False, 1e-3, PITCH_UM),
    "a.vk4": (vk4, False, 1e-3, PITCH_UM),
    "a.vk6": (vk6, False, 1e-3, PITCH_UM),
    "a.plux": (plux, True, 1.0, PITCH_UM),
    "a.zon": (zon, True, 1e-3, SQUARE),
    "a.OPDx": (opdx, True, 1e-3, PITCH_UM),
    "a.asc": (wyko_ascii, True, 1e-3, PITCH_UM),
    "u2.sdf": (lambda: bsdf(1, "<u2", 65535), True, 1e-3, PITCH_UM),
    "i4.sdf": (lambda: bsdf(6, "<i4", -(2**31)), True, 1e-3, PITCH_UM),
    "f8.sdf": (lambda: bsdf(7, "<f8", np.nan), True, 1e-3, PITCH_UM),
}


@pytest.mark.parametrize("name", FILES)
def test_file(tmp_path: Path, name: str) -> None:
    make, void, um, pitch = FILES[name]
    (tmp_path / name).write_bytes(make())
    check(read_scan(tmp_path / name, None), void, um, pitch)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kept", [0.97, 0.5])
def test_a_cut_file_is_one_line(tmp_path: Path, name: str, kept: float) -> None:
    check_cut(tmp_path / name, FILES[name][0](), kept)


# --- HDF5 --------------------------------------------------------------------------------------------


def _h5jpk(path: Path, frames: int = 1, reflect: str = "false", unit: str | None = "m") -> None:
    """JPK's HDF5, by the layout that AFMReader documents: pixels by frames, the bottom line first."""
    import h5py

    with h5py.File(path, "w") as file:
        measurement = file.create_group("Measurement_000")
        grid = {"ilength": NX, "jlength": NY, "ulength": 1.2e-6, "vlength": 2e-6, "reflect": reflect.encode()}
        for key, value in grid.items():
            measurement.attrs[f"position-pattern.grid.{key}"] = value
        lines = with_void(np.nan, "f8") if reflect == "true" else with_void(np.nan, "f8")[::-1]
        for number, (name, retrace) in enumerate((("error", "false"), ("height", "true"), ("height", "false"))):
            group = measurement.create_group(f"Channel_{number:03}")
            group.attrs["channel.name"] = name.encode()
            group.attrs["retrace"] = retrace.encode()
            group.attrs["net-encoder.scaling.multiplier"] = 1e-9
            group.attrs["net-encoder.scaling.offset"] = 5e-7
            if unit is not None:
                group.attrs["net-encoder.scaling.unit.unit"] = "V" if name == "error" else unit
            stack = [lines.ravel() + 1000 * frame + 7 * (retrace == "true") for frame in range(frames)]
            group[name.capitalize()] = np.stack(stack, axis=1)


@pytest.mark.parametrize("reflect", ["false", "true"])
def test_h5_jpk(tmp_path: Path, reflect: str) -> None:
    _h5jpk(tmp_path / "a.h5-jpk", reflect=reflect)
    scan = read_scan(tmp_path / "a.h5-jpk", None)
    check(scan, True, 1e-3, PITCH_UM)
    assert (scan.channel, scan.channels) == ("height", ("height (retrace)", "height"))


def test_h5_jpk_without_a_unit_asks_for_it(tmp_path: Path) -> None:
    _h5jpk(tmp_path / "a.h5-jpk", unit=None)
    scan = read_scan(tmp_path / "a.h5-jpk", None)
    assert (scan.um_per_unit, scan.pitch_um) == (None, pytest.approx(PITCH_UM))


def test_a_frame_of_a_movie_is_named(tmp_path: Path) -> None:
    _h5jpk(tmp_path / "a.h5-jpk", frames=3)
    with pytest.raises(InputError, match=r"a movie of 3 frames; set surface\.channel, such as 'height"):
        read_scan(tmp_path / "a.h5-jpk", None)
    second, third = (read_scan(tmp_path / "a.h5-jpk", f"height frame {n}") for n in (2, 3))
    check(third, True, 1e-3, PITCH_UM)
    assert np.nanmax(third.heights - second.heights) == pytest.approx(1e-6)


def _nhf(path: Path, version: int, kind: str = "int32", image: str = "image_line_based") -> None:
    """Nanosurf's HDF5, by the layout of the vendor's reader: codes, the bottom line first."""
    import h5py

    limits = np.iinfo(kind)
    low, high = (limits.min, limits.max) if version == 1 else (limits.min + 1, limits.max)
    # 1 nm in 2^n codes, exactly
    step = 2 ** (7 if kind == "int16" else 16)
    codes = (low + TOP_FIRST[::-1].astype("i8") * step).astype(kind)
    span = (float(high) - low) / step * 1e-9
    with h5py.File(path, "w") as file:
        file.attrs["nsf_file_version_major"], file.attrs["nsf_file_version_minor"] = version, 1 if version == 1 else 0
        measurement = file.create_group("group_0000")
        measurement.attrs["name" if version == 1 else "measurement_name"] = "Image"
        measurement.attrs["measurement_type" if version == 1 else "group_type"] = image
        for number, direction in enumerate(("Backward", "Forward")):
            segment = measurement.create_group(f"subgroup_{number:04}")
            segment.attrs["name" if version == 1 else "segment_name"] = direction
            if version == 1:
                sizes = {"image_points_per_line": NX, "image_number_of_lines": NY}
                sizes |= {"image_size_x": 1.2e-6, "image_size_y": 2e-6}
            else:
                sizes = {"rect_axis_size": [NY, NX], "rect_axis_range": [2e-6, 1.2e-6]}
            segment.attrs.update(sizes)
            for place, (name, unit) in enumerate((("Deflection", "V"), ("Position Z", "m"))):
                stored = codes.copy()
                if version == 2:
                    stored[NY - 1 - VOID[0], VOID[1]] = limits.min
                data = segment.create_dataset(f"dataset_{place:04}", data=stored.ravel())
                base = "base" if version == 1 else "signal"
                data.attrs["name" if version == 1 else "signal_name"] = name
                data.attrs["dataset_element_type"] = {"int32": 0, "int16": 5}[kind] if version == 1 else kind
                data.attrs[f"{base}_calibration_min"], data.attrs[f"{base}_calibration_max"] = 0.0, span
                data.attrs[f"{base}_calibration_unit"] = unit


@pytest.mark.parametrize("kind", ["int32", "int16"])
@pytest.mark.parametrize("version", [1, 2])
def test_nhf(tmp_path: Path, version: int, kind: str) -> None:
    _nhf(tmp_path / "a.nhf", version, kind)
    scan = read_scan(tmp_path / "a.nhf", None)
    check(scan, version == 2, 1e-3, PITCH_UM)
    assert scan.channels == ("Position Z (Backward)", "Position Z (Forward)")
    assert scan.channel == "Position Z (Forward)"


def test_nhf_of_force_curves_has_no_channel(tmp_path: Path) -> None:
    _nhf(tmp_path / "a.nhf", 2, image="spectroscopy")
    with pytest.raises(InputError, match="found none in a unit of length"):
        read_scan(tmp_path / "a.nhf", None)


def test_datx(tmp_path: Path) -> None:
    import h5py

    converter = np.dtype([("category", "S16"), ("unit", "S16"), ("parameters", "f8", (4,))])
    with h5py.File(tmp_path / "a.datx", "w") as file:
        rows = [("Root", "Measurement", "{1}"), ("{1}", "Surface", "{2}"), ("{2}", "Path", "/Data/Surface/1")]
        file["MetaData"] = np.array(rows, dtype="S16")
        data = file.create_dataset("Data/Surface/1", data=with_void(1.7e308, "f8"))
        data.attrs["No Data"] = np.array([1.7e308])
        data.attrs["Unit"] = np.array(["NanoMeters"], dtype=h5py.string_dtype())
        for axis, step in (("X", 1e-7), ("Y", 2e-7)):
            entry = np.array([(b"LateralCat", b"Pixels", (0, step, 0, 0))], dtype=converter)
            data.attrs[f"{axis} Converter"] = entry
        data.attrs["Z Converter"] = np.array([(b"HeightCat", b"NanoMeters", (0, 1, 0, 0))], dtype=converter)
    check(read_scan(tmp_path / "a.datx", None), True, 1e-3, PITCH_UM)
