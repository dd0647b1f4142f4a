"""Formats of profilometers and the exchange formats: files that the tests write, their units, voids and names."""

import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.surface.readers import read_scan
from pipeline.surface.readers.formats import BY_LIBRARY, READ
from pipeline.surface.scan import Scan
from tests.support import shared_file
from tests.surface.asymmetric import NX, NY, PITCH_UM, TOP_FIRST, VOID, padded, with_void

pytestmark = pytest.mark.usefixtures("surface_topography")


def sur() -> bytes:
    header = padded("DIGITAL SURF", 12) + struct.pack("<HHHH", 0, 1, 0, 2) + padded("o", 30) + padded("i", 30)
    header += struct.pack("<HHHHH", 0, 0, 0, 1, 1) + b"\0" * 8
    header += struct.pack("<HiiiiI", 32, -10, 1000, NX, NY, NX * NY) + struct.pack("<fff", *PITCH_UM, 1e-3)
    header += padded("X", 16) + padded("Y", 16) + padded("Z", 16) + padded("um", 16) * 6
    header += struct.pack("<fff", 1, 1, 1) + b"\0" * 6 + b"\0" * 12 + b"\0" * 14 + b"\0" * 14 + b"\0" * 4
    header += b"\0" * 128 + b"\0" * 12 + b"\0" * 34
    return header + with_void(-12, "<i4").tobytes()


def bcr(form: str) -> bytes:
    header = f"fileformat = {form}\nxpixels = {NX}\nypixels = {NY}\nxlength = 1200\nylength = 2000\n"
    header += "xunit = nm\nyunit = nm\nzunit = nm\nintelmode = 1\nbit2nm = 1\nvoidpixels = 1\n"
    stored = with_void(3.4028234663852886e38, "<f4") if form == "bcrf" else with_void(32767, "<i2")
    return header.encode().ljust(2048, b"\0") + stored.tobytes()


def sdf(name: str) -> bytes:
    entries = {"ManufacID": "T", "CreateDate": "010120200000", "ModDate": "010120200000"}
    entries |= {"NumPoints": str(NX), "NumProfiles": str(NY), "Xscale": "1E-7", "Yscale": "2E-7", "Zscale": "1E-9"}
    entries |= {"Zresolution": "1E-12", "Compression": "0", "DataType": "7", "CheckType": "0"}
    lines = [name, *(f"{key} = {value}" for key, value in entries.items()), "*"]
    lines += [" ".join("BAD" if np.isnan(v) else f"{v}" for v in row) for row in with_void(np.nan, "f8")]
    return "\n".join([*lines, "*", ""]).encode()


def opd() -> bytes:
    def entry(name: str, kind: int, length: int) -> bytes:
        return padded(name, 16) + struct.pack("<hlH", kind, length, 0)

    # x is the slow axis, and y grows upwards
    raster = struct.pack("<HHH", NX, NY, 4) + np.ascontiguousarray(with_void(1e38, "<f4")[::-1].T).tobytes()
    blocks = {"RAW_DATA": (3, raster), "Wavelength": (7, struct.pack("<f", 1.0)), "Mult": (6, struct.pack("<h", 1))}
    blocks |= {"Aspect": (7, struct.pack("<f", 2.0)), "Pixel_size": (7, struct.pack("<f", 1e-4))}
    directory = b"".join(entry(name, kind, len(data)) for name, (kind, data) in blocks.items())
    start = b"\x01\x00" + entry("Directory", 1, 24 * (len(blocks) + 1))
    return start + directory + b"".join(data for _, data in blocks.values())


def al3d() -> bytes:
    def tag(key: str, value: object) -> bytes:
        return padded(key, 20) + padded(str(value), 30) + b"\r\n"

    tags: dict[str, Any] = {"Rows": NY, "Cols": NX, "PixelSizeXMeter": "1e-7", "PixelSizeYMeter": "2e-7"}
    tags |= {"InvalidPixelValue": "1e10", "DepthImageOffset": 2000, "TextureImageOffset": 0, "IconOffset": 0}
    header = b"AliconaImaging\x00\r\n" + tag("Version", 1) + tag("TagCount", len(tags))
    header += b"".join(tag(key, value) for key, value in tags.items()) + padded("c", 254) + b"\r\n"
    stored = (TOP_FIRST * 1e-9).astype("<f4")
    stored[VOID] = 1e10
    return header.ljust(2000, b"\0") + stored.tobytes()


def plu(date: str = "2014-06-20 10:00:00") -> bytes:
    header = padded(date, 128) + struct.pack("<I", 0) + b"\0" * 256
    header += struct.pack("<III7f", NY, NX, 0, 1, *PITCH_UM, 0, 0, 1, 0) + struct.pack("<5I", 3, 0, 0, 0, 0)
    header += struct.pack("<5IdfII", NY, NX, NY, NX, 0, 0, 0, 0, 0) + struct.pack("<5B3xI", 0, 1, 0xFB, 0, 0, 0)
    stored = with_void(1000001, "<f4") * np.float32(1)
    return header + struct.pack("<II", NY, NX) + stored.tobytes() + struct.pack("<ff", 0, 1)


def gsf() -> bytes:
    header = f"Gwyddion Simple Field 1.0\nXRes = {NX}\nYRes = {NY}\nXReal = 1.2e-6\nYReal = 2e-6\n"
    header += "XYUnits = m\nZUnits = nm\nTitle = Höhe\n"
    data = header.encode()
    return data + b"\0" * (4 - len(data) % 4) + with_void(np.nan, "<f4").tobytes()


FILES = {
    "a.sur": (sur(), 1e-3),
    "a.bcrf": (bcr("bcrf"), 1e-3),
    "a.bcr": (bcr("bcrstm"), 1e-3),
    "iso.sdf": (sdf("aISO-1.0"), 1e-3),
    "bcr.sdf": (sdf("aBCR-1.0"), 1e-3),
    "a.opd": (opd(), 1e-3),
    "a.al3d": (al3d(), 1e-3),
    "a.plu": (plu(), 1.0),
    "date.plu": (plu("Fr 20. Juni 2014"), 1.0),
    "a.gsf": (gsf(), 1e-3),
}


def check(scan: Scan, um: float) -> None:
    """The heights of TOP_FIRST in units of `um` micrometres, with the void as a hole."""
    assert scan.um_per_unit is not None
    expected = with_void(np.nan, "f8")[::-1] * um
    np.testing.assert_allclose(scan.heights * scan.um_per_unit, expected, rtol=1e-6)
    assert scan.pitch_um == pytest.approx(PITCH_UM, rel=1e-6)


@pytest.mark.parametrize("name", FILES)
def test_file(tmp_path: Path, name: str) -> None:
    data, um = FILES[name]
    path = tmp_path / name
    path.write_bytes(data)
    check(read_scan(path, None), um)


@pytest.mark.parametrize("name", FILES)
def test_a_cut_file_is_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(FILES[name][0][:-60])
    with pytest.raises(InputError) as caught:
        read_scan(path, None)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{name}: expected ")


def test_x3p_and_netcdf_as_the_library_writes_them(tmp_path: Path) -> None:
    from SurfaceTopography import Topography

    stored = np.ma.masked_invalid(with_void(np.nan, "f8").T * 1e-9)
    written = Topography(stored, (1.2e-6, 2e-6), unit="m")
    written.to_x3p(str(tmp_path / "a.x3p"))
    check(read_scan(tmp_path / "a.x3p", None), 1e-3)


def test_arrays_of_hdf5_and_matlab_lie_as_npy(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    from scipy.io import savemat

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["height"] = TOP_FIRST
    savemat(tmp_path / "a.mat", {"height": TOP_FIRST})
    for name in ("a.h5", "a.mat"):
        scan = read_scan(tmp_path / name, None)
        np.testing.assert_array_equal(scan.heights, TOP_FIRST)
        assert (scan.um_per_unit, scan.pitch_um, scan.steps) == (None, None, None)


def test_gsf_without_units_states_the_ratio(tmp_path: Path) -> None:
    data = gsf().replace(b"XYUnits = m\n", b"# comment 12").replace(b"ZUnits = nm\n", b"# comment 12")
    (tmp_path / "a.gsf").write_bytes(data)
    scan = read_scan(tmp_path / "a.gsf", None)
    assert (scan.um_per_unit, scan.pitch_um) == (None, None)
    assert scan.steps == pytest.approx((1e-7, 2e-7))


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.nhf", b"\x89HDF\r\n\x1a\n", "HDF5"),
        ("a.Z_mtrx", b"ONTMATRX0101", "Omicron MATRIX"),
        ("a.dat", b"[Paramco32]\r\nKey / Value=0\r\n" + b"\0\1\2" * 99, "Createc"),
        ("a.asd", bytes(range(40)), "Asahi"),
        ("a.sm4", b"S\0T\0i\0M\0a\0g\0e\0", "RHK"),
        ("a.grd", b"DSBB" + b"\0" * 50, "Surfer"),
        ("a.mdt", b"\x01\xb0\x93\xff" + b"\0" * 60, "NT-MDT"),
        ("a.frt", b"FRTM_GLIDERV" + b"\0" * 40, "FRT"),
        ("a.mnt", b"\xd0\xcf\x11\xe0" + b"\0" * 600, "Mountains"),
        ("a.plux", b"PK\x03\x04 cut", "Sensofar .plux"),
        ("a.vk4", b"VK4_" + b"\0" * 40, "Keyence"),
        ("a.nms", b"\0" * 4000, "NanoFocus"),
        ("a.dat", b"\x88\x1b\x03\x6f" + b"\0" * 100, "Zygo MetroPro"),
    ],
)
def test_a_format_that_cannot_be_read_is_named(tmp_path: Path, name: str, data: bytes, said: str) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_scan(path, None)
    message = str(caught.value)
    assert "\n" not in message
    assert said in message


@pytest.mark.parametrize(
    ("member", "said"),
    [
        ("header.properties", "JPK force curves"),
        ("xl/workbook.xml", "an Excel workbook; save the sheet with the heights as .csv"),
        ("Kontur1.prf", "a line profile of Mahr"),
    ],
)
def test_zips_that_are_not_read_are_named(tmp_path: Path, member: str, said: str) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, "x")
    with pytest.raises(InputError, match=said):
        read_scan(path, None)


def test_every_format_of_the_library_is_offered() -> None:
    from SurfaceTopography.IO import lookup_reader_by_format

    # read here by other means, or profiles and elevation models without a scan
    elsewhere = {"gwy", "ezd", "npy", "npz", "xyz", "hgt", "qep", "mitutoyo"}
    assert set(lookup_reader_by_format) - elsewhere <= set(BY_LIBRARY)
    assert len({entry.key for entry in READ}) == len(READ)


@pytest.mark.parametrize(
    ("name", "um_per_unit", "pitch"),
    [("iso25178.sdf", None, 0.15625), ("g_simple.gsf", 1e6, 0.15625), ("t_wyko_ascii.asc", None, 0.156)],
)
def test_files_of_the_field(name: str, um_per_unit: float | None, pitch: float) -> None:
    scan = read_scan(shared_file(f"field/{name}"), None)
    assert scan.heights.shape == (64, 64)
    assert scan.pitch_um == pytest.approx((pitch, pitch))
    assert um_per_unit in (None, scan.um_per_unit)
