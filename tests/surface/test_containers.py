"""Formats that are containers of other files, written by the tests from their layouts: orientation, units, voids."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.surface.readers import read_scan
from tests.surface.asymmetric import NX, NY, PITCH_UM, TOP_FIRST, VOID, check, check_cut, packed

pytestmark = pytest.mark.usefixtures("surface_topography")

DASHES = "-" * 42
# picometres along x and y, and per count of height
STEPS = (100_000, 200_000, 1000)


def nmm(micro: bytes = b"[um]") -> bytes:
    """A nano measuring machine's scan: a description, and a table for each line, whose Ly grows from line to line."""
    pitch_x, pitch_y = PITCH_UM
    field = {"Number of scans": "1", "Number of lines": str(NY)}
    field |= {"Scan line length": f"{pitch_x * (NX - 1)} [um]", "Scan field width": f"{pitch_y * (NY - 1)} [um]"}
    field |= {"Distance beetween points": f"{pitch_x} [um]", "Distance beetween lines": f"{pitch_y} [um]"}
    lines = [DASHES, "Scan procedure description file", "Creation time : 2020-01-01", DASHES, "3. Scan field"]
    members = {"a.dsc": "\n".join([*lines, *(f"{key} : {value}" for key, value in field.items()), DASHES])}
    for line, heights in enumerate(TOP_FIRST[::-1]):
        columns = ("Lx", "Ly", "-Lz+Az")
        told = [f"{i} : 2020-01-01 : {name} : {NX} : {name}" for i, name in enumerate(columns)]
        members[f"a_1_{line + 1}.dsc"] = "\n".join([DASHES, *told, DASHES])
        rows = [f"{1e-6 * pitch_x * i} {1e-6 * pitch_y * line} {1e-9 * h}" for i, h in enumerate(heights)]
        members[f"a_1_{line + 1}.dat"] = "\n".join(rows)
    return packed({name: text.encode().replace(b"[um]", micro) for name, text in members.items()})


def directory(start: int, entries: dict[int, tuple[int, bytes]], following: int = 0) -> bytes:
    """One directory of a TIFF at the offset `start`: tag -> (type, value); the next one lies `following` bytes on."""
    behind, head, values = start + 6 + 12 * len(entries), struct.pack("<H", len(entries)), b""
    for tag, (kind, value) in sorted(entries.items()):
        count = len(value) // {2: 1, 3: 2, 4: 4}[kind]
        place = value.ljust(4, b"\0") if len(value) <= 4 else struct.pack("<I", behind + len(values))
        values += value + b"\0" * (len(value) % 2) if len(value) > 4 else b""
        head += struct.pack("<HHI", tag, kind, count) + place
    return head + struct.pack("<I", behind + len(values) + following if following else 0) + values


def image(description: str, pixels: bytes, bits: int, photometric: int, start: int) -> dict[int, tuple[int, bytes]]:
    """The entries of a page of one uncompressed strip at the offset `start`."""
    short = {256: NX, 257: NY, 258: bits, 259: 1, 262: photometric, 277: 1, 278: NY}
    long = {273: start, 279: len(pixels)}
    entries = {tag: (3, struct.pack("<H", value)) for tag, value in short.items()}
    entries |= {tag: (4, struct.pack("<I", value)) for tag, value in long.items()}
    return entries | {270: (2, description.encode() + b"\0")}


def lext(invalid: bool = True) -> bytes:
    """Olympus LEXT: a TIFF with pages for intensity, height and invalid samples; numbers are 1e-6 um and 1e-6."""
    axes, factors = "", ""
    for axis, picometres in zip("XYZ", STEPS, strict=True):
        axes += f"<HeightDataPerPixel{axis}>{picometres / 2}</HeightDataPerPixel{axis}>"
        axes += f"<HeightDataUnit{axis}>1</HeightDataUnit{axis}>"
        factors += f"<MakerCalibrationValue{axis}>2000000</MakerCalibrationValue{axis}>"
    told = f"<TiffTagDescData><HeightInfo>{axes}</HeightInfo></TiffTagDescData>"
    settings = f"<ExifTagDescData><ImageCommonSettingsInfo>{factors}</ImageCommonSettingsInfo></ExifTagDescData>"
    void = np.zeros((NY, NX), bool)
    void[VOID] = True
    heights = TOP_FIRST.astype("<u2").tobytes()
    pages = [(told, heights, 16, 1), ("HEIGHT", heights, 16, 1)]
    pages += [("INVALID", np.packbits(void, axis=1).tobytes(), 1, 4)] if invalid else []
    data = struct.pack("<2sHI", b"II", 42, 0)
    data += directory(len(data), {0xA40B: (2, settings.encode() + b"\0")})
    data = data[:4] + struct.pack("<I", len(data) + len(heights)) + data[8:]
    for i, (name, pixels, bits, photometric) in enumerate(pages):
        entries = image(name, pixels, bits, photometric, len(data))
        entries |= {0x8769: (4, struct.pack("<I", 8))} if i == 0 else {}
        data += pixels
        data += directory(len(data), entries, len(pages[i + 1][1]) if i + 1 < len(pages) else 0)
    return data


def oir(invalid: bool = True) -> bytes:
    """Olympus OIR: XML that describes the channels, and a block of codes for each, the top line first."""

    def text(data: str) -> bytes:
        return struct.pack("<I", len(data)) + data.encode()

    def block(kind: int, data: bytes) -> bytes:
        return struct.pack("<9I", kind, 1, 1, 0, 0, 1, 1, 1, 1) + data

    def xml(name: str, *inside: str) -> str:
        return f"<{name}>{''.join(inside)}</{name}>"

    def axes(space: str, *values: object) -> str:
        return "".join(xml(f"{space}:{axis}", str(value)) for axis, value in zip("xyz", values, strict=True))

    factors = (2.0, 0.5, 4.0)
    lengths = [1e-6 * picometres / factor for picometres, factor in zip(STEPS, factors, strict=True)]
    pitch = xml("commonphase:length", axes("commonparam", *lengths))
    pitch += xml("commonphase:pixelUnit", axes("commonphase", *["MICRO_METER"] * 3))
    void = np.zeros((NY, NX), "<u2")
    void[VOID] = 1
    images = {"INTENSITY": np.zeros((NY, NX), "<u2"), "HEIGHT": TOP_FIRST.astype("<u2")}
    images |= {"INVALID": void} if invalid else {}
    channels = ""
    for name in images:
        kind = xml("commonphase:imageType", name) + xml("commonphase:depth", "2")
        channels += f'<commonphase:channel id="{name.lower()}">{pitch}'
        channels += xml("commonphase:imageDefinition", kind) + "</commonphase:channel>"
    phase = xml("commonimage:phase", xml("commonphase:group", channels))
    info = xml("commonimage:imageInfo", xml("commonimage:width", str(NX)), xml("commonimage:height", str(NY)), phase)
    calibration = xml("commonimage:pixelCalibration", axes("commonparam", *factors))
    more = xml("commonimage:general", xml("base:creationDateTime", "2020-01-01"))
    more += xml("commonimage:microscope", xml("base:name", "OLS5000"))
    more += xml("commonimage:acquisition", xml("commonimage:microscopeConfiguration", calibration))
    listed = block(2, text(xml("lsmimage:imageProperties", more, info)))
    listed += block(6, struct.pack("<I", 1) + text("t001_0_1") + struct.pack("<I", 0))
    listed += block(8, struct.pack("<I", len(images)) + b"".join(text(name.lower()) + b"\0" * 4 for name in images))
    data = b"OLYMPUSRAWFORMAT" + struct.pack("<14I", 12, 0, 1, 2, 0, 0, 0, 0, 17, 0, 1, 0, 0, 0)
    data += b"UNKNOWN\0" + struct.pack("<4I", 1, 1, 0xFFFFFFFF, 0xFFFFFFFF)
    data += struct.pack("<ii", len(listed), 0) + listed
    for name, codes in images.items():
        head = struct.pack("<II", 0, codes.nbytes) + text(f"t001_0_1_{name.lower()}_0")
        data += struct.pack("<ii", len(head), 3) + head + struct.pack("<II", codes.nbytes, 4) + codes.tobytes()
    return data + struct.pack("<i", -1)


def poir() -> bytes:
    """Olympus POIR: a zip of OIR files, of which that of the camera has no heights."""
    camera = oir().replace(b"lsmimage:imageProperties", b"camimage:imageProperties")
    return packed({"Camera.oir": camera, "LSM.oir": oir()})


def ole(name: str, stream: bytes) -> bytes:
    """An OLE compound file of one stream of 4096 bytes or more: header, one sector of the FAT, folder, data."""
    n, end, free = -(-len(stream) // 512), 0xFFFFFFFE, 0xFFFFFFFF
    header = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 16
    header += struct.pack("<5H6x", 0x3E, 3, 0xFFFE, 9, 6) + struct.pack("<9I", 0, 1, 1, 0, 4096, end, 0, end, 0)
    header += struct.pack("<109I", 0, *[free] * 108)
    fat = [0xFFFFFFFD, end, *range(3, n + 2), end]

    def entry(text: str, kind: int, child: int, start: int, size: int) -> bytes:
        encoded = text.encode("utf-16-le")
        head = encoded.ljust(64, b"\0") + struct.pack("<HBB3I", len(encoded) + 2, kind, 1, free, free, child)
        return head + b"\0" * 36 + struct.pack("<IQ", start, size)

    folder = entry("Root Entry", 5, 1, end, 0) + entry(name, 2, free, 2, len(stream))
    table = struct.pack("<128I", *fat, *[free] * (128 - len(fat)))
    return header + table + folder.ljust(512, b"\0") + stream.ljust(512 * n, b"\0")


def mnt(masked: bool = True) -> bytes:
    """Digital Surf Mountains: an OLE file with a tree of tags; counts and mask in compressed blocks."""

    def box(tag: int, *inside: bytes) -> bytes:
        data = b"".join(inside)
        return struct.pack("<HQ", tag, len(data)) + data

    def number(tag: int, form: str, value: float) -> bytes:
        return box(tag, struct.pack(f"<{form}", value))

    def text(tag: int, value: str) -> bytes:
        return box(tag, b"\4" + value.encode("utf-16-le"))

    def kind(value: int) -> bytes:
        return box(1, number(1, "I", value))

    def array(tag: int, of: int, stored: NDArray[Any]) -> bytes:
        # the second half of the samples comes first
        flat, half = stored.ravel(), stored.size // 2
        blocks = struct.pack("<Q", stored.nbytes)
        for first, part in ((half, flat[half:]), (0, flat[:half])):
            compressed = zlib.compress(part.tobytes())
            blocks += struct.pack("<QII", first, part.size, len(compressed)) + compressed
        return box(tag, kind(of), box(2, number(1, "I", stored.size), box(2, blocks)))

    def scale(step: float, unit: str, shown: str, origin: float) -> bytes:
        return box(0xFFFF, number(1, "d", step), text(2, unit), text(3, shown), number(5, "d", origin))

    def axis(tag: int, step: float, n: int) -> bytes:
        return box(tag, box(0xFFFF, scale(step, "m", "mm", 0), number(1, "I", n)))

    mask = np.full((NY + 2, NX + 2), 22, "u1")
    mask[1:-1, 1:-1] = 9
    mask[1 + VOID[0], 1 + VOID[1]] = 22
    picture = box(2, number(1, "I", NX), number(2, "I", NY), array(5, 9048, mask))
    grid = axis(1, 1e-12 * STEPS[0], NX) + axis(2, 1e-12 * STEPS[1], NY)
    grid += box(3, kind(9056), picture) if masked else b""
    heights = array(1, 9049, TOP_FIRST.astype("<i4")) + box(2, scale(1e-12 * STEPS[2], "m", "\u00b5m", 5))
    measured = box(0xFFFF, box(0xFFFF, grid), heights)
    surface = kind(9012) + box(2, box(1, kind(9062), box(2, measured)))
    objects = struct.pack("<Q", 0) + box(1, surface)
    # settings of the page, which are skipped, make the stream long enough
    contents = box(1, box(0x7FFF, b"\0" * 4096), box(0x2BD, box(2, box(1, objects))))
    return ole("ScopedContents", struct.pack("<Q", len(contents)) + contents)


# name -> (content, void, micrometres per unit of TOP_FIRST)
FILES: dict[str, tuple[Callable[[], bytes], bool, float]] = {
    "a.zip": (nmm, False, 1e-3),
    "latin.zip": (lambda: nmm(b"[\xb5m]"), False, 1e-3),
    "utf8.zip": (lambda: nmm("[\u00b5m]".encode()), False, 1e-3),
    "a.lext": (lext, True, 1e-3),
    "measured.lext": (lambda: lext(invalid=False), False, 1e-3),
    "a.oir": (oir, True, 1e-3),
    "measured.oir": (lambda: oir(invalid=False), False, 1e-3),
    "a.poir": (poir, True, 1e-3),
    "a.mnt": (mnt, True, 1e-3),
    "measured.mnt": (lambda: mnt(masked=False), False, 1e-3),
}


@pytest.mark.parametrize("name", FILES)
def test_file(tmp_path: Path, name: str) -> None:
    make, void, um = FILES[name]
    (tmp_path / name).write_bytes(make())
    check(read_scan(tmp_path / name, None), void, um, PITCH_UM)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kept", [0.9, 0.5])
def test_a_cut_file_is_one_line(tmp_path: Path, name: str, kept: float) -> None:
    check_cut(tmp_path / name, FILES[name][0](), kept)
