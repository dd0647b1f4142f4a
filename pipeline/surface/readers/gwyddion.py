"""Reads Gwyddion's .gwy files, by gwyfile."""

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import (
    library_version,
    micrometres,
    pick_channel,
    third_party,
    unique_names,
)
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

_MAGIC = b"GWYP"
# bytes of a component, or of one entry of an array
_BYTES = {b"b": 1, b"c": 1, b"C": 1, b"i": 4, b"I": 4, b"q": 8, b"Q": 8, b"d": 8, b"D": 8}
# Gwyddion nests objects four deep
_MOST_NESTED = 32
_DATA_KEY = re.compile(r"/(\d+)/data")


@dataclass(frozen=True)
class _Field:
    """One data field: its name, gwyfile's object and its mask's, and micrometres per unit of its values."""

    name: str
    data: Any
    um_per_unit: float | None
    mask: Any


def read(path: Path, channel: str | None) -> Scan:
    """Reads one data field and flips it, because Gwyddion stores the top row first.

    Empty units become None. The mask is returned beside the heights: it marks grains as often as bad data.
    """
    with third_party(path.name, "a Gwyddion .gwy file", "gwyfile"):
        import gwyfile

        data = path.read_bytes()
        _object_end(data, len(_MAGIC), len(data))
        del data
        fields = _height_fields(gwyfile.load(str(path)))
        names = unique_names([field.name for field in fields])
        index = pick_channel(path.name, names, channel)
        heights = _heights(path, fields[index].data)
        pitch, steps = _pitch(fields[index].data)
        mask = _mask(heights, fields[index].mask)
    return Scan(
        heights,
        fields[index].um_per_unit,
        pitch,
        None,
        names[index],
        tuple(names),
        "Gwyddion .gwy",
        library_version("gwyfile"),
        mask=mask,
        steps=steps,
    )


def _object_end(data: bytes, place: int, end: int, depth: int = 0) -> int:
    """Returns the end of the object at `place`, after a check that it and its components end before `end`.

    Where a NUL is missing, gwyfile would not end. The layout is that of Gwyddion's user guide ("GWY file format").
    Raises EOFError or struct.error where something ends too late.
    """
    place = _text_end(data, place, end)
    (size,) = struct.unpack_from("<I", data, place)
    place, last = place + 4, place + 4 + int(size)
    if last > end or depth > _MOST_NESTED:
        raise EOFError("an object ends after the file or the object around it")
    while place < last:
        place = _component_end(data, place, last, depth)
    return last


def _component_end(data: bytes, place: int, end: int, depth: int) -> int:
    place = _text_end(data, place, end)
    kind, place, count = data[place : place + 1], place + 1, 1
    if kind.isupper():
        (count,) = struct.unpack_from("<I", data, place)
        place += 4
    if kind in (b"s", b"S"):
        for _ in range(count):
            place = _text_end(data, place, end)
    elif kind in (b"o", b"O"):
        for _ in range(count):
            place = _object_end(data, place, end, depth + 1)
    elif kind in _BYTES:
        place += count * _BYTES[kind]
    else:
        raise EOFError(f"a component has the unknown type {kind!r}")
    if place > end:
        raise EOFError("a component ends after its object")
    return place


def _text_end(data: bytes, place: int, end: int) -> int:
    found = data.find(b"\0", place, end)
    if found < 0:
        raise EOFError("a name or a text does not end")
    return found + 1


def _height_fields(container: Any) -> list[_Field]:
    """Lists the fields in a unit of length, or where there is none those without a unit, by their numbers.

    A field over another quantity than length, such as a spectrum over frequency, is no height map.
    """
    numbers = sorted(int(match[1]) for key in container if (match := _DATA_KEY.fullmatch(key)))
    fields = []
    for number in numbers:
        data = container[f"/{number}/data"]
        unit = _unit(data, "si_unit_z")
        lateral = _unit(data, "si_unit_xy")
        if all(text == "" or micrometres(text) is not None for text in (unit, lateral)):
            name = str(container.get(f"/{number}/data/title") or f"channel {number}")
            fields.append(_Field(name, data, micrometres(unit), container.get(f"/{number}/mask")))
    return [field for field in fields if field.um_per_unit is not None] or fields


def _unit(data: Any, key: str) -> str:
    unit = data.get(key)
    return "" if unit is None else str(unit.get("unitstr", ""))


def _heights(path: Path, data: Any) -> NDArray[np.float64]:
    make_room(path.name, (int(data["yres"]), int(data["xres"])))
    return np.array(data.data[::-1], dtype=np.float64, order="C")


def _mask(heights: NDArray[np.float64], mask: Any) -> NDArray[np.bool_] | None:
    covered = None if mask is None else np.ascontiguousarray(mask.data[::-1] > 0.5)
    return covered if covered is not None and covered.shape == heights.shape else None


def _pitch(data: Any) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Returns the pitch along (x, y), um, or else the steps in a unit that the file does not state."""
    steps = float(data.xreal) / int(data["xres"]), float(data.yreal) / int(data["yres"])
    scale = micrometres(_unit(data, "si_unit_xy"))
    return (None, steps) if scale is None else ((steps[0] * scale, steps[1] * scale), None)
