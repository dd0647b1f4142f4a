"""Reads the names of an Igor wave's layers, which end at their first NUL byte."""

import struct
from pathlib import Path

_HEADER = struct.Struct("hhiiii4i4iiii")
_LABEL_BYTES = 32


def labels(path: Path) -> list[str]:
    """Returns the names of the layers of a version 5 wave; a layer without one is "no name (n)".

    Behind the NUL some programs leave bytes of longer names. igor2 removes the NULs and keeps those bytes.
    """
    data = path.read_bytes()
    order = "<" if data[:1] == b"\x05" else ">"
    header = struct.unpack(f"{order}{_HEADER.format}", data[: struct.calcsize(f"{order}{_HEADER.format}")])
    wave, formula, note, data_units = header[2:6]
    dim_units, dim_labels = header[6:10], header[10:14]
    # numbers of samples along the four dimensions, in the wave's own header
    sizes = struct.unpack_from(f"{order}4i", data, 64 + 68)
    layered = sizes[2] != 0
    dimension = 2 if layered or sizes[0] == sizes[1] else 1
    count = sizes[dimension] if layered or dimension == 1 else 1
    start = 64 + wave + formula + note + data_units + sum(dim_units) + sum(dim_labels[:dimension])
    block = data[start : start + dim_labels[dimension]]
    # the first label names the dimension
    stored = [block[i : i + _LABEL_BYTES] for i in range(_LABEL_BYTES, len(block), _LABEL_BYTES)]
    names = [label.split(b"\0")[0].decode("latin-1").strip() for label in stored[: max(count, 1)]]
    names += [""] * (max(count, 1) - len(names))
    return [name or f"no name ({number})" for number, name in enumerate(names, start=1)]
