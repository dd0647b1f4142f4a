"""Readers: values of real files, the orientation of patterns made for the test, and error messages."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pipeline.errors import InputError
from pipeline.surface.readers import read_scan
from pipeline.surface.readers.common import micrometres

DATA = Path(__file__).parents[2].parent / "shared" / "data"

# y up: the corner at the right of the bottom is 1, one step up from it 2; no flip or turn looks the same
HANDED = np.zeros((10, 12))
HANDED[0, -1], HANDED[1, -1], HANDED[-1, 0] = 1.0, 2.0, 3.0
TOP_FIRST = HANDED[::-1]


def real(name: str) -> Path:
    path = DATA / name
    if not path.exists():
        pytest.skip(f"no real scans here: {path} is absent")
    return path


def message_of(path: Path, channel: str | None = None) -> str:
    """The error message, which has one line."""
    with pytest.raises(InputError) as caught:
        read_scan(path, channel)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path.name}: expected ")
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    return message


def levelled(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    rows, columns = np.indices(heights.shape)
    basis = np.stack([rows.ravel(), columns.ravel(), np.ones(heights.size)], axis=1)
    plane = basis @ np.linalg.lstsq(basis, heights.ravel(), rcond=None)[0]
    return heights - plane.reshape(heights.shape)


def rows_levelled(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Without the line through each row, in which readings of one scan differ."""
    x = np.arange(heights.shape[1])
    lines = np.polynomial.polynomial.polyfit(x, heights.T, 1)
    return heights - np.polynomial.polynomial.polyval(x, lines)


def alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Correlation of two maps."""
    return float(np.corrcoef(rows_levelled(a).ravel(), rows_levelled(b).ravel())[0, 1])


# --- real files --------------------------------------------------------------------------------------

# name, shape (ny, nx), pitch um, height range um as stored, default channel
MICROSCOPES = [
    ("grid.nid", (256, 256), 3.0 / 256, 0.30263, "Scan forward (Z-Axis)"),
    ("squares_holes.nid", (256, 256), 50.0 / 256, 0.91777, "Scan forward (Topography)"),
    ("circles_holes.nid", (256, 256), 50.0 / 256, 7.41257, "Scan forward (Topography)"),
    ("nanoscope.000", (512, 512), 2.0 / 512, 0.33241, "Height"),
    ("di-6.di", (512, 512), 10.0 / 512, 0.12389, "Height"),
    ("spot_1-1000nm.ibw", (256, 256), 20.0 / 256, 0.37339, "HeightTrace"),
    ("mi-1.mi", (256, 256), 20.0 / 256, 0.16564, "Topography"),
    ("top-1.top", (256, 256), 0.6 / 256, 0.0188851, "Default"),
    ("stp-1.stp", (256, 256), 0.6 / 256, 0.0137008, "Default"),
    ("example_ps.tiff", (512, 512), 1.0 / 512, 0.03669, "Z Height"),
]
TEXTS = [
    ("matrix-3.txt", (256, 256), 10.0 / 256, 0.40883, "ZSensor"),
    ("grooves_nm.txt", (128, 128), 10.0 / 128, 0.57213, "Topography_Flat_Bwd (128x128)"),
]


def check_real(name: str, shape: tuple[int, int], pitch: float, span: float, channel: str) -> None:
    scan = read_scan(real(f"scans/{name}"), None)
    assert scan.heights.shape == shape
    assert scan.heights.dtype == np.float64
    assert scan.pitch_um == pytest.approx((pitch, pitch), rel=1e-6)
    assert scan.um_per_unit is not None
    assert np.ptp(scan.heights) * scan.um_per_unit == pytest.approx(span, rel=1e-4)
    assert scan.full_code is None
    assert scan.channel == channel
    assert channel in scan.channels


@pytest.mark.parametrize(("name", "shape", "pitch", "span", "channel"), MICROSCOPES)
def test_microscope_file(name: str, shape: tuple[int, int], pitch: float, span: float, channel: str) -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    check_real(name, shape, pitch, span, channel)


@pytest.mark.parametrize(("name", "shape", "pitch", "span", "channel"), TEXTS)
def test_text_file(name: str, shape: tuple[int, int], pitch: float, span: float, channel: str) -> None:
    check_real(name, shape, pitch, span, channel)


def test_gwyddion_file_without_units_is_not_guessed() -> None:
    pytest.importorskip("gwyfile")
    scan = read_scan(real("scans/test.gwy"), None)
    assert scan.heights.shape == (128, 128)
    assert (scan.um_per_unit, scan.pitch_um, scan.channel) == (None, None, "Test")


@pytest.mark.parametrize(
    ("name", "shape", "codes"),
    [
        ("elaphe_65um.png", (1332, 1332), (0, 255)),
        ("xenopeltis_65um.png", (1332, 1332), (0, 252)),
        ("cd_tracks.png", (1024, 1024), (0, 255)),
    ],
)
def test_snake_image(name: str, shape: tuple[int, int], codes: tuple[int, int]) -> None:
    path = real(f"snakes/{name}")
    scan = read_scan(path, None)
    assert scan.heights.shape == shape
    assert (scan.heights.min(), scan.heights.max()) == codes
    assert (scan.full_code, scan.um_per_unit, scan.pitch_um) == (255.0, None, None)
    top_row = np.asarray(Image.open(path).convert("RGB"))[0, :, 0]
    np.testing.assert_array_equal(scan.heights[-1], top_row)


def test_instrument_facts() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    grains = read_scan(real("scans/di-6.di"), None)
    assert levelled(grains.heights).std() == pytest.approx(14.3, abs=0.05)  # nm
    holes = read_scan(real("scans/squares_holes.nid"), None)
    flat = levelled(holes.heights) * 1e9
    bottom, top = np.median(flat[flat < -100]), np.median(flat[flat > -100])
    assert top - bottom == pytest.approx(486, abs=25)


def test_period_of_text_grooves() -> None:
    scan = read_scan(real("scans/grooves_nm.txt"), None)
    row = scan.heights.mean(axis=0)
    edges = np.flatnonzero(np.diff((row > row.mean()).astype(int)) == 1)
    assert scan.pitch_um is not None
    assert np.diff(edges).mean() * scan.pitch_um[0] == pytest.approx(2.89, abs=0.1)


def test_asylum_field_is_the_scan_size() -> None:
    """The file's own note: the tip moves at ScanSpeed and is sampled at Sample Rate."""
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    path = real("scans/spot_1-1000nm.ibw")
    note = dict(line.split(b":", 1) for line in path.read_bytes().split(b"\r") if line.count(b":") == 1)
    pitch_um = float(note[b"ScanSpeed"]) / float(note[b"Sample Rate"]) * 1e6
    assert read_scan(path, None).pitch_um == pytest.approx((pitch_um, pitch_um), rel=1e-4)


def test_channels_of_length_can_be_chosen_and_others_not() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    path = real("scans/spot_1-1000nm.ibw")
    trace, retrace = read_scan(path, None), read_scan(path, "heightretrace")
    assert retrace.channel == "HeightRetrace"
    # the way back differs by hysteresis, but lies the same way
    assert 0.8 < alike(trace.heights, retrace.heights) < 0.99
    assert alike(trace.heights, retrace.heights[:, ::-1]) < 0.2
    assert "'HeightTrace', 'HeightRetrace'" in message_of(path, "PhaseTrace")
    di = real("scans/di-6.di")
    first, second = read_scan(di, None), read_scan(di, "Height #2")
    assert not np.array_equal(first.heights, second.heights)
    assert alike(first.heights, second.heights) > 0.8


# --- which way up ------------------------------------------------------------------------------------


def test_nanoscope_stores_the_bottom_line_first() -> None:
    """The reference CSV is in the file's order, bottom line first: it is our array without a flip."""
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    stored = np.loadtxt(real("scans/nanoscope.000.reference.csv"), delimiter=",")
    heights = read_scan(real("scans/nanoscope.000"), None).heights
    assert np.abs(rows_levelled(heights) - rows_levelled(stored)).max() < 0.1  # nm, its last digit
    assert alike(heights[::-1], stored) < 0.9
    as_text = read_scan(real("scans/nanoscope.000.reference.csv"), None)
    np.testing.assert_array_equal(as_text.heights, stored[::-1])
    assert (as_text.um_per_unit, as_text.pitch_um) == (None, None)


def test_park_heights_agree_with_the_preview() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    path = real("scans/example_ps.tiff")
    heights = read_scan(path, None).heights
    with Image.open(path) as preview:
        shown = np.asarray(preview.convert("RGB").resize(heights.shape[::-1])).sum(axis=2, dtype=float)
    assert np.corrcoef(levelled(heights).ravel(), levelled(shown[::-1]).ravel())[0, 1] > 0.95


def test_wsxm_integers_and_doubles_have_one_orientation() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    one, other = (read_scan(real(f"scans/{name}"), None).heights for name in ("top-1.top", "stp-1.stp"))
    assert alike(one, other) > 0.99


def test_png_8_and_16_bit(tmp_path: Path) -> None:
    for dtype, full_code in ((np.uint8, 255.0), (np.uint16, 65535.0)):
        path = tmp_path / "handed.png"
        Image.fromarray((TOP_FIRST * 80).astype(dtype)).save(path)
        scan = read_scan(path, None)
        np.testing.assert_array_equal(scan.heights, HANDED * 80)
        assert (scan.full_code, scan.um_per_unit, scan.pitch_um) == (full_code, None, None)


@pytest.mark.parametrize("suffix", ["bmp", "tif"])
def test_other_images(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"handed.{suffix}"
    Image.fromarray(TOP_FIRST.astype(np.uint8)).save(path)
    np.testing.assert_array_equal(read_scan(path, None).heights, HANDED)


def test_float_tiff_keeps_its_values_and_holes(tmp_path: Path) -> None:
    path = tmp_path / "handed.tiff"
    stored = (TOP_FIRST * 0.25).astype(np.float32)
    stored[-1, 0] = np.nan
    Image.fromarray(stored).save(path)
    scan = read_scan(path, None)
    np.testing.assert_array_equal(scan.heights, stored[::-1])
    assert scan.full_code is None
    assert np.isnan(scan.heights[0, 0])


def test_grey_in_colour_channels(tmp_path: Path) -> None:
    path = tmp_path / "grey.png"
    grey = (TOP_FIRST * 80).astype(np.uint8)
    Image.fromarray(np.stack([grey] * 3, axis=-1)).save(path)
    np.testing.assert_array_equal(read_scan(path, None).heights, HANDED * 80)


def test_npy_is_taken_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "handed.npy"
    np.save(path, HANDED.astype(np.int32))
    scan = read_scan(path, None)
    np.testing.assert_array_equal(scan.heights, HANDED)
    assert (scan.full_code, scan.um_per_unit, scan.pitch_um) == (None, None, None)


def test_npz_by_name_and_alone(tmp_path: Path) -> None:
    alone, several = tmp_path / "alone.npz", tmp_path / "several.npz"
    np.savez(alone, z=HANDED, x=np.arange(12.0))
    np.savez(several, a=HANDED, b=2 * HANDED)
    np.testing.assert_array_equal(read_scan(alone, None).heights, HANDED)
    np.testing.assert_array_equal(read_scan(several, "b").heights, 2 * HANDED)
    assert "channels 'a', 'b'" in message_of(several)


@pytest.mark.parametrize(
    ("separator", "point"), [(" ", "."), (",", "."), (";", "."), ("\t", "."), (";", ","), ("\t", ",")]
)
def test_text_matrix(tmp_path: Path, separator: str, point: str) -> None:
    path = tmp_path / "handed.txt"
    rows = [separator.join(f"{v:.2f}".replace(".", point) for v in row) for row in TOP_FIRST / 4]
    path.write_text("# made by hand\n" + "\n".join(rows))
    scan = read_scan(path, None)
    np.testing.assert_array_equal(scan.heights, HANDED / 4)
    assert (scan.um_per_unit, scan.pitch_um) == (None, None)


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_gwyddion_text_header(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "handed.txt"
    header = "# Channel: Height\n# Width: 6.0 \u00b5m\n# Height: 1e4 nm\n# Value units: m\n"
    body = "\n".join("\t".join(f"{v}" for v in row) for row in TOP_FIRST)
    path.write_text(header + body, encoding=encoding)
    scan = read_scan(path, None)
    np.testing.assert_array_equal(scan.heights, HANDED)
    assert scan.pitch_um == pytest.approx((0.5, 1.0))
    assert (scan.um_per_unit, scan.channel) == (1e6, "Height")


@pytest.mark.parametrize("gap", [" ", "\n"])
def test_flat_list_with_a_header(tmp_path: Path, gap: str) -> None:
    path = tmp_path / "handed.txt"
    counts = "Image Width : 12\nImage Height : 10\n\n"
    header = f"{counts}Real Width : 6 \u03bcm\nReal Height : 10 \u03bcm\nZ Unit : nm\n\n"
    path.write_text(header + gap.join(f"{v}" for v in TOP_FIRST.ravel()), encoding="utf-8")
    scan = read_scan(path, None)
    np.testing.assert_array_equal(scan.heights, HANDED)
    assert scan.pitch_um == pytest.approx((0.5, 1.0))
    assert scan.um_per_unit == 1e-3


def test_xyz_triples_lie_where_they_say(tmp_path: Path) -> None:
    path = tmp_path / "handed.xyz"
    rows, columns = np.indices(HANDED.shape)
    triples = np.stack([columns.ravel() / 3, rows.ravel() / 7, HANDED.ravel()], axis=1)
    np.random.default_rng(1).shuffle(triples)
    np.savetxt(path, triples[1:], fmt="%.7g")
    heights = read_scan(path, None).heights
    hole = np.isnan(heights)
    assert np.count_nonzero(hole) == 1
    np.testing.assert_array_equal(heights[~hole], HANDED[~hole])


@pytest.mark.parametrize(("unit_xy", "unit_z", "pitch"), [("m", "m", (0.5, 1.0)), ("", "", None)])
def test_gwy(tmp_path: Path, unit_xy: str, unit_z: str, pitch: tuple[float, float] | None) -> None:
    gwyfile = pytest.importorskip("gwyfile")
    from gwyfile.objects import GwyContainer, GwyDataField

    assert gwyfile
    path = tmp_path / "handed.gwy"
    container = GwyContainer()
    fields = (("Phase", "deg", 5 * TOP_FIRST), ("Height", unit_z, TOP_FIRST))
    for number, (title, unit, data) in enumerate(fields):
        container[f"/{number}/data/title"] = title
        container[f"/{number}/data"] = GwyDataField(data, xreal=6e-6, yreal=10e-6, si_unit_xy=unit_xy, si_unit_z=unit)
    container.tofile(str(path))
    scan = read_scan(path, None)
    np.testing.assert_array_equal(scan.heights, HANDED)
    assert scan.pitch_um == (None if pitch is None else pytest.approx(pitch))
    assert scan.um_per_unit == (1e6 if unit_z else None)
    assert scan.channels == ("Height",)


SXM_HEADER = """:NANONIS_VERSION:
2
:BIAS:
1.0
:ACQ_TIME:
10.0
:SCAN_PIXELS:
       12       10
:SCAN_TIME:
             1.0             1.0
:SCAN_RANGE:
           6.000000E-6           1.000000E-5
:SCAN_OFFSET:
             0.0             0.0
:SCAN_DIR:
{direction}
:DATA_INFO:
\tChannel\tName\tUnit\tDirection\tCalibration\tOffset
\t14\tZ\tm\tboth\t1.0\t0.0
\t0\tCurrent\tA\tboth\t1.0\t0.0

:SCANIT_END:


"""


def write_sxm(path: Path, direction: str, forward: NDArray[Any], backward: NDArray[Any]) -> None:
    """A Nanonis file; lines and samples in the order in which they are scanned."""
    samples = np.stack([forward, backward, forward + 9, backward + 9])
    header = SXM_HEADER.format(direction=direction).encode()
    path.write_bytes(header + b"\x1a\x04" + samples.astype(">f4").tobytes())


@pytest.mark.parametrize("direction", ["up", "down"])
@pytest.mark.parametrize("suffix", ["sxm", "dat"])
def test_sxm(tmp_path: Path, direction: str, suffix: str) -> None:
    pytest.importorskip("nanonispy2")
    path = tmp_path / f"handed.{suffix}"
    scanned = HANDED if direction == "up" else TOP_FIRST
    write_sxm(path, direction, scanned, 2 * scanned[:, ::-1])
    forward, backward = read_scan(path, None), read_scan(path, "Z backward")
    np.testing.assert_array_equal(forward.heights, HANDED)
    np.testing.assert_array_equal(backward.heights, 2 * HANDED)
    assert forward.pitch_um == pytest.approx((0.5, 1.0))
    assert forward.um_per_unit == 1e6
    assert forward.channels == ("Z", "Z backward")


def test_sxm_lines_never_scanned_are_holes(tmp_path: Path) -> None:
    pytest.importorskip("nanonispy2")
    part = HANDED.copy()
    part[7:] = np.nan
    write_sxm(tmp_path / "part.sxm", "up", part, part)
    assert np.isnan(read_scan(tmp_path / "part.sxm", None).heights).sum() == 3 * 12


def write_jpk(path: Path, raster: NDArray[Any], reflect: int) -> None:
    """The least that JPK's TIFF holds: a thumbnail with the grid, and one calibrated channel."""
    tifffile = pytest.importorskip("tifffile")

    def text(code: int, value: str) -> tuple[int, str, int, str, bool]:
        return (code, "s", 0, value, True)

    grid = [(0x8042, "d", 1, 6e-6, True), (0x8043, "d", 1, 10e-6, True), (0x8045, "H", 1, reflect, True)]
    about = [text(0x8000, "2.0"), text(0x8003, "2020-01-01 00:00:00 +0100")]
    slot = [
        text(0x8050, "height"),
        (0x8051, "H", 1, 0, True),
        text(0x8052, "Height"),
        (0x8080, "I", 1, 1, True),
        text(0x8081, "nominal"),
        text(0x8090, "nominal"),
        text(0x80A2, "m"),
        text(0x80A3, "LinearScaling"),
        (0x80A4, "d", 1, 1e-9, True),
        (0x80A5, "d", 1, 0.0, True),
        (0x8045, "H", 1, reflect, True),
    ]
    with tifffile.TiffWriter(path) as writer:
        writer.write(np.zeros((4, 4), np.uint8), extratags=sorted(about + grid), metadata=None)
        writer.write(raster, extratags=sorted(slot), metadata=None)


@pytest.mark.parametrize(("reflect", "first"), [(0, HANDED), (1, TOP_FIRST)])
def test_jpk(tmp_path: Path, reflect: int, first: NDArray[np.float64]) -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    path = tmp_path / "handed.jpk"
    write_jpk(path, first.astype(np.int32), reflect)
    scan = read_scan(path, None)
    np.testing.assert_allclose(scan.heights, HANDED * 1e-9)
    assert scan.pitch_um == pytest.approx((0.5, 1.0))
    assert (scan.um_per_unit, scan.channel, scan.format) == (1e6, "Height", "JPK image scan")


# --- faults ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("nonsense_txt_file.txt", "expected numbers, found 'This is nonsense."),
        ("wrongnpyfile.npy", "begins with ef bf bd"),
        ("single_column.txt", "single column of 9 numbers and no width"),
    ],
)
def test_bad_file(name: str, says: str) -> None:
    assert says in message_of(real(f"bad/{name}"))


def test_truncated_nanoscope_file() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    assert "not large enough" in message_of(real("bad/di_corrupted.di"))


@pytest.mark.parametrize(
    "name", ["grid.nid", "nanoscope.000", "spot_1-1000nm.ibw", "mi-1.mi", "top-1.top", "example_ps.tiff"]
)
@pytest.mark.parametrize("kept", [0.01, 0.1])
def test_truncated_microscope_file(tmp_path: Path, name: str, kept: float) -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    data = real(f"scans/{name}").read_bytes()
    path = tmp_path / name
    path.write_bytes(data[: int(len(data) * kept)])
    message_of(path)


def test_truncated_gwy(tmp_path: Path) -> None:
    pytest.importorskip("gwyfile")
    path = tmp_path / "cut.gwy"
    path.write_bytes(real("scans/test.gwy").read_bytes()[:60000])
    assert "gwyfile cannot read" in message_of(path)


def test_truncated_sxm(tmp_path: Path) -> None:
    pytest.importorskip("nanonispy2")
    path = tmp_path / "cut.sxm"
    write_sxm(path, "up", HANDED, HANDED)
    path.write_bytes(path.read_bytes()[:-40])
    assert "nanonispy2 cannot read" in message_of(path)


def test_truncated_png(tmp_path: Path) -> None:
    path = tmp_path / "cut.png"
    noise = np.random.default_rng(1).integers(0, 255, (64, 64), dtype=np.uint8)
    Image.fromarray(noise).save(path)
    for kept in (12, 900):
        path.write_bytes(path.read_bytes()[:kept])
        message_of(path)


def test_missing_extra_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "gwyfile", None)
    path = tmp_path / "some.gwy"
    path.write_bytes(b"GWYPGwyContainer\0\0\0\0\0")
    assert "pip install 'diffract-bake[readers]'" in message_of(path)


def test_content_decides_not_the_suffix(tmp_path: Path) -> None:
    image, array = tmp_path / "image.spm", tmp_path / "array.png"
    Image.fromarray(TOP_FIRST.astype(np.uint8)).save(image, format="PNG")
    with array.open("wb") as file:
        np.save(file, HANDED)
    assert read_scan(image, None).full_code == 255.0
    np.testing.assert_array_equal(read_scan(array, None).heights, HANDED)


def test_text_under_an_image_suffix_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "matrix.png"
    np.savetxt(path, TOP_FIRST)
    assert "found plain text" in message_of(path)


def test_no_such_file_a_folder_and_an_empty_file(tmp_path: Path) -> None:
    empty = tmp_path / "empty.txt"
    empty.touch()
    assert "No such file" in message_of(tmp_path / "absent.png")
    assert "directory" in message_of(tmp_path)
    assert "an empty file" in message_of(empty)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"\xff\xd8\xff\xe0 rest", "JPEG"),
        (b"\x1f\x8b rest", "gzip"),
        (b"\x89HDF\r\n", "HDF5"),
        (b"\x01\x02\x03\x04", "unknown content (it begins with 01 02 03 04)"),
        (b"# nothing but a comment\n", "no numbers"),
        (b"1 2 3\n4 5\n", "number of columns changed"),
        (b"1 2 3\n4 oops 6\n", "oops"),
        (b"1 2 3\nfoot\n", "'foot' in line 2"),
        (b"1,5 2,5\n3,5 4,5\n", "decimal points"),
        (b"Image Width : 4\nImage Height : 4\n1 2 3\n", "expected 4 x 4 numbers"),
        (b"0 0 1\n1 0 1\n5 0 1\n0 1 1\n1 1 1\n", "steps along x"),
        (b"1 2 3 4 5 6 7 8 9\n", "single row of 9 numbers"),
    ],
)
def test_unreadable_content(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "scan.dat"
    path.write_bytes(content)
    assert says in message_of(path)


@pytest.mark.parametrize(("header", "says"), [("# Value units: V", "values in 'V'"), ("# Width: 3 V", "3 V")])
def test_text_in_other_units(tmp_path: Path, header: str, says: str) -> None:
    path = tmp_path / "other.txt"
    np.savetxt(path, TOP_FIRST, header=f"{header[2:]}\nHeight: 3 um")
    assert says in message_of(path)


def test_images_that_would_lie(tmp_path: Path) -> None:
    coloured, faint, pages = tmp_path / "c.png", tmp_path / "t.png", tmp_path / "p.tif"
    rgb = np.zeros((10, 12, 4), np.uint8)
    rgb[..., 3] = 255
    rgb[3, 4, 1] = 7
    Image.fromarray(rgb).save(coloured)
    rgb[..., 1], rgb[0, 0, 3] = 0, 9
    Image.fromarray(rgb).save(faint)
    page = Image.fromarray(TOP_FIRST.astype(np.uint8))
    page.save(pages, save_all=True, append_images=[page])
    assert "(R = G = B), found 1 coloured" in message_of(coloured)
    assert "transparent" in message_of(faint)
    assert "2 pages" in message_of(pages)


def test_16_bit_colour_png_is_refused(tmp_path: Path) -> None:
    """Pillow would drop the low bytes."""
    import zlib

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    path = tmp_path / "deep.png"
    pixels = np.zeros((10, 1 + 12 * 6), np.uint8).tobytes()
    header = struct.pack(">IIBBBBB", 12, 10, 16, 2, 0, 0, 0)
    parts = (chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(pixels)), chunk(b"IEND", b""))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    assert "16-bit colour" in message_of(path)


def test_arrays_that_are_no_height_map(tmp_path: Path) -> None:
    path = tmp_path / "array.npy"
    for array, says in (
        (np.zeros((9, 9, 3)), "3-D data (9 x 9 x 3)"),
        (np.zeros(()), "0-D data"),
        (np.zeros((1, 40)), "1 x 40"),
        (np.zeros((0, 40)), ""),
        (np.zeros((9, 9), complex), "complex128"),
        (np.full((9, 9), "a"), "<U1"),
    ):
        np.save(path, array)
        assert says in message_of(path)
    np.save(path, np.full((9, 9), None), allow_pickle=True)
    message_of(path)


def test_a_claimed_size_costs_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "wide.npy"
    np.save(path, np.zeros((8, 8193), np.int8))
    assert "at most 8192" in message_of(path)


def test_zip_that_holds_no_arrays(tmp_path: Path) -> None:
    import zipfile

    path = tmp_path / "book.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("sheet.xml", "<x/>")
    assert "a zip of sheet.xml" in message_of(path)


def test_wanted_channel_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "grey.png"
    Image.fromarray(TOP_FIRST.astype(np.uint8)).save(path)
    assert "only 'grey'" in message_of(path, "Height")


def test_units_of_length() -> None:
    assert micrometres("nm") == 1e-3
    assert micrometres(" \u00b5m ") == micrometres("\u03bcm") == micrometres("[um]") == micrometres("~m") == 1.0
    assert micrometres("m") == 1e6
    assert micrometres("\u212b") == micrometres("\u00c5") == 1e-4
    assert [micrometres(u) for u in ("V", "A", "deg", "", "1/m")] == [None] * 5
