"""Reads the tags of a TIFF's first page, which say what its samples are."""

import struct
from pathlib import Path

BITS, COMPRESSION, PHOTOMETRIC, ORIENTATION = 258, 259, 262, 274
X_RESOLUTION, Y_RESOLUTION, MAX_SAMPLE, SAMPLE_FORMAT = 282, 283, 281, 339
PIXEL_SCALE, NO_DATA, DESCRIPTION = 33550, 42113, 270
UNSIGNED, SIGNED, FLOAT = 1, 2, 3

Tags = dict[int, tuple[float, ...] | str]
# type of an entry -> format of its numbers, and whether they are fractions
_TYPES = {1: "B", 3: "H", 4: "I", 5: "2I", 6: "b", 8: "h", 9: "i", 10: "2i", 11: "f", 12: "d", 13: "I", 16: "Q"}
_TEXT = 2
# private tags of some instruments hold whole images; nothing that is read here is longer
_MOST = 4096


def tags(path: Path) -> Tags:
    """Returns the tags of the first page by number; an empty dict where the file is truncated."""
    with path.open("rb") as file:
        data = file.read(16)
        order = "<" if data[:2] == b"II" else ">"
        big = data[2:4] in (b"+\0", b"\0+")
        count_form, entry, value_bytes = ("Q", f"{order}HHQ8s", 8) if big else ("H", f"{order}HHI4s", 4)
        found: Tags = {}
        try:
            (start,) = struct.unpack_from(f"{order}{'Q' if big else 'I'}", data, 8 if big else 4)
            file.seek(start)
            (count,) = struct.unpack(f"{order}{count_form}", file.read(struct.calcsize(count_form)))
            size = struct.calcsize(entry)
            entries = [struct.unpack(entry, file.read(size)) for _ in range(min(count, _MOST))]
            for tag, kind, number, value in entries:
                nbytes = number * (1 if kind == _TEXT else struct.calcsize(f"<{_TYPES.get(kind, 'B')}"))
                found[tag] = ()
                if nbytes > _MOST or (kind != _TEXT and kind not in _TYPES):
                    continue
                if nbytes > value_bytes:
                    file.seek(struct.unpack(f"{order}{'Q' if big else 'I'}", value)[0])
                    value = file.read(nbytes)
                found[tag] = _value(order, kind, number, value[:nbytes])
        except (struct.error, OverflowError, OSError):
            return {}
    return found


def number(found: Tags, tag: int) -> float | None:
    """Returns the first number of a tag, or a text that is a number; None where there is none."""
    value = found.get(tag, ())
    try:
        return float(value if isinstance(value, str) else value[0])
    except (ValueError, IndexError):
        return None


def _value(order: str, kind: int, count: int, data: bytes) -> tuple[float, ...] | str:
    if kind == _TEXT:
        return data.split(b"\0")[0].decode("latin-1").strip()
    form = _TYPES[kind]
    if len(form) == 1:
        return struct.unpack(f"{order}{count}{form}", data)
    numbers = struct.unpack(f"{order}{2 * count}{form[1]}", data)
    return tuple(a / b if b else 0.0 for a, b in zip(numbers[::2], numbers[1::2], strict=True))
