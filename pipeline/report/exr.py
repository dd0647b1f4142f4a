"""The structure of an EXR file that anyone may have written, read without OpenEXR and without its pixels.

OpenEXR allocates and decodes what a header asks for, so the header is checked first: one part of scanlines, 32-bit
numbers, no attribute of an unusual size, and blocks that fill the file (https://openexr.com, "OpenEXR File Layout").
"""

import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from pipeline.errors import DamagedError

_MAGIC = b"\x76\x2f\x31\x01"
# version 2 and names longer than 31 letters; tiles, deep samples and several parts have bits of their own
_VERSION, _LONG_NAMES = 2, 0x400
# the lossless compressions that every reader knows: their names and lines per block
_COMPRESSIONS = {0: ("NONE", 1), 1: ("RLE", 1), 2: ("ZIPS", 1), 3: ("ZIP", 16), 4: ("PIZ", 32)}
_PIXEL_TYPES = {0: ("uint", 4), 1: ("half", 2), 2: ("float", 4)}
# bytes of the attribute types that may be present; None for any number
_ATTRIBUTES = {
    "box2f": 16,
    "box2i": 16,
    "chlist": None,
    "chromaticities": 32,
    "compression": 1,
    "double": 8,
    "float": 4,
    "int": 4,
    "lineOrder": 1,
    "m33f": 36,
    "m44f": 64,
    "rational": 8,
    "string": None,
    "v2f": 8,
    "v2i": 8,
    "v3f": 12,
    "v3i": 12,
}
_REQUIRED = {
    "channels": "chlist",
    "compression": "compression",
    "dataWindow": "box2i",
    "displayWindow": "box2i",
    "lineOrder": "lineOrder",
}
_MOST_HEADER_BYTES = 2**16
_MOST_PIXELS = 2**28
_MOST_CHANNELS = 16


@dataclass(frozen=True)
class Structure:
    """The structure of an EXR file.

    width, height: pixels. channels: their names, sorted. pixel_type: "half", "float", "uint", or "mixed".
    file_bytes: size of the file. pixel_bytes: size of the pixels in 32 bits each, as evaluators hold them.
    """

    width: int
    height: int
    channels: tuple[str, ...]
    pixel_type: str
    file_bytes: int
    pixel_bytes: int


def structure(path: Path) -> Structure:
    """Reads the structure of an EXR file, a plain file, and checks that its blocks fill it.

    Raises DamagedError, which does not name the file, where it is anything but whole scanlines in one part.
    """
    try:
        with path.open("rb") as stream:
            return _read(stream, os.fstat(stream.fileno()).st_size)
    except (ValueError, struct.error, OSError) as error:
        # struct's own message would say nothing of an image
        reason = "it ends in its header" if isinstance(error, struct.error) else str(error)
        raise DamagedError(f"cannot be read as EXR{': ' if reason else ''}{reason}") from None


def _read(stream: BinaryIO, size: int) -> Structure:
    header = stream.read(_MOST_HEADER_BYTES)
    if header[:4] != _MAGIC:
        raise ValueError("")
    (version,) = struct.unpack_from("<I", header, 4)
    if version & ~_LONG_NAMES != _VERSION:
        raise ValueError("expected one part of scanlines, got tiles, deep samples, several parts or another version")
    attributes, start = _attributes(header)
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1 or width * height > _MOST_PIXELS or max(map(abs, (left, top, right, bottom))) >= 2**30:
        raise ValueError(f"expected 1 to {_MOST_PIXELS} pixels, got a window of {width} x {height}")
    channels = _channels(attributes["channels"])
    code = attributes["compression"][0]
    if code not in _COMPRESSIONS:
        known = ", ".join(name for name, _ in _COMPRESSIONS.values())
        raise ValueError(f"expected a compression of {known}, got number {code}")
    if attributes.get("type", b"scanlineimage") != b"scanlineimage":
        raise ValueError("expected scanlines, got another type")
    if attributes["lineOrder"][0] > 1:
        raise ValueError("expected lines in order")
    line_bytes = width * sum(_PIXEL_TYPES[kind][1] for kind in channels.values())
    _check_blocks(stream, start, size, (top, height, _COMPRESSIONS[code][1], line_bytes))
    types = {_PIXEL_TYPES[kind][0] for kind in channels.values()}
    return Structure(
        width=width,
        height=height,
        channels=tuple(sorted(channels)),
        pixel_type=types.pop() if len(types) == 1 else "mixed",
        file_bytes=size,
        pixel_bytes=4 * width * height * len(channels),
    )


def _attributes(header: bytes) -> tuple[dict[str, bytes], int]:
    """Reads all attributes; returns their bytes by name, and the place after the last."""
    found: dict[str, bytes] = {}
    at = 8
    while header[at : at + 1] != b"\0":
        name, at = _text(header, at)
        kind, at = _text(header, at)
        (count,) = struct.unpack_from("<i", header, at)
        at += 4
        if kind not in _ATTRIBUTES or _ATTRIBUTES[kind] not in (None, count) or not 0 <= count <= len(header) - at:
            raise ValueError(f"attribute {name!r} is of type {kind!r} and {count} bytes")
        if name in found or _REQUIRED.get(name, kind) != kind:
            raise ValueError(f"attribute {name!r} is of type {kind!r}, or there are two")
        found[name] = header[at : at + count]
        at += count
    missing = [name for name in _REQUIRED if name not in found]
    if missing:
        raise ValueError(f"its header has no {missing[0]}")
    return found, at + 1


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Reads a name of 1 to 255 ASCII letters that ends with a zero; returns it and the place after it."""
    end = data.find(b"\0", at, at + 256)
    if end <= at:
        raise ValueError("its header holds a name without an end")
    return data[at:end].decode("ascii"), end + 1


def _channels(data: bytes) -> dict[str, int]:
    """Reads the list of channels; returns the number of each one's type by name."""
    found: dict[str, int] = {}
    at = 0
    while data[at : at + 1] != b"\0":
        name, at = _text(data, at)
        kind, _, across, along = struct.unpack_from("<iIii", data, at)
        at += 16
        if name in found or kind not in _PIXEL_TYPES or (across, along) != (1, 1) or len(found) == _MOST_CHANNELS:
            raise ValueError(f"channel {name!r} is there twice, of an unknown type or subsampled, or one of many")
        found[name] = kind
    if not found:
        raise ValueError("it has no channels")
    return found


def _check_blocks(stream: BinaryIO, start: int, size: int, shape: tuple[int, int, int, int]) -> None:
    """Checks that the blocks are in place, no larger than their pixels, and fill the file to its end.

    stream, size: the file and its bytes. start: place of the table of blocks.
    shape: first line, number of lines, lines per block, bytes per line.
    """
    top, height, per_block, line_bytes = shape
    count = -(-height // per_block)
    stream.seek(start)
    # a table that does not fit into the file is not allocated
    if start + 8 * count > size:
        raise ValueError(f"it ends in its table of {count} blocks")
    places = struct.unpack(f"<{count}Q", stream.read(8 * count))
    end = start + 8 * count
    for block in sorted(range(count), key=lambda b: places[b]):
        if places[block] != end or end + 8 > size:
            raise ValueError(f"block {block} is not in its place, or missing")
        stream.seek(end)
        line, length = struct.unpack("<ii", stream.read(8))
        lines = min(per_block, height - block * per_block)
        if line != top + block * per_block or not 0 < length <= lines * line_bytes:
            raise ValueError(f"block {block} begins at line {line} and holds {length} bytes")
        end += 8 + length
    if end != size:
        raise ValueError(f"its blocks end at {end} of {size} bytes")
