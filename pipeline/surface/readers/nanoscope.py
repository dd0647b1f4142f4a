"""Reads what SurfaceTopography leaves out of a Nanoscope header: the true field, and the direction of each image."""

import re
from collections.abc import Mapping
from pathlib import Path

_HEADER_BYTES = 1 << 20
_END = b"\\*File list end"
_SCAN_LISTS = ("ciao scan list", "afm list", "stm list", "nc afm list")
_IMAGE_LIST = re.compile(rb"^(\\\*(?:Ciao |AFM |STM |NCAFM )?image list)\s*$", re.IGNORECASE | re.MULTILINE)
# a field whose sides differ by less was given as a square
_SQUARE = 1e-6

Section = Mapping[str, str]


def scan_list(path: Path) -> dict[str, str]:
    """Returns the entries of a file's scan list, keys in lower case; empty where there is none."""
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES).split(_END)[0].decode("latin-1")
    found: dict[str, str] = {}
    inside = False
    for line in header.splitlines():
        if line.startswith("\\*"):
            inside = line[2:].strip().lower() in _SCAN_LISTS
        elif inside and ": " in line:
            key, value = line.lstrip("\\").split(": ", 1)
            found[key.lower()] = value.strip()
    return found


def one_image_each(path: Path) -> list[bytes]:
    """Returns the file once for each image, without the others in its header; places in the file stay.

    An image whose entries are odd then does not keep the others from being read.
    """
    data = path.read_bytes()
    end = data.find(_END)
    header, samples = data[:end], data[end:]
    places = [match.end(1) for match in _IMAGE_LIST.finditer(header)]
    versions = []
    for kept in places:
        hidden = bytearray(header)
        for place in places:
            if place != kept:
                hidden[place - 1 : place] = b"_"
        versions.append(bytes(hidden) + samples)
    return versions


def slow_size(field: tuple[float, float], shape: tuple[int, int], image: Section, scan: Section) -> float:
    """Corrects the size along y of a "Capture Now" and of a rectangular scan, whose header gives a square field.

    This is Gwyddion's rule (modules/file/nanoscope.c): where there is no slow axis size, and the image is not 1:1,
    the size along y is that of the whole scan. It is multiplied by lines / samples where the scan is not 1:1 either,
    and else by the share of the scan's lines that the image has.

    field: size along (x, y). shape: (nx, ny). image, scan: entries of the image's section and of the scan list.
    Returns the size along y, in the unit of `field`.
    """
    nx, ny = shape
    stored = (_count(image, "samps/line"), _count(image, "number of lines"))
    square = abs(field[0] - field[1]) <= _SQUARE * field[0]
    if "slow axis size" in scan or not square or not _is_oblong(image) or stored != shape:
        return field[1]
    if _is_oblong(scan):
        return field[1] * ny / nx
    lines = _count(scan, "lines")
    return field[1] * ny / lines if lines else field[1]


def direction(image: Section) -> tuple[str, ...]:
    """Returns the words of an image's header on which scan of a line it is, such as ("retrace", "interleave")."""
    words = []
    if image.get("line direction", "").lower() in ("trace", "retrace"):
        words.append(image["line direction"].lower())
    if image.get("scan line", "").lower() == "interleave":
        words.append("interleave")
    return tuple(words)


def _is_oblong(section: Section) -> bool:
    aspect = re.fullmatch(r"\s*([\d.]+)\s*(?::\s*([\d.]+))?\s*", section.get("aspect ratio", ""))
    return aspect is not None and float(aspect[1]) not in (0.0, float(aspect[2] or 1))


def _count(section: Section, key: str) -> int | None:
    value = section.get(key, "").strip()
    return int(value) if value.isdecimal() else None
