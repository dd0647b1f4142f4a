"""Reads NumPy's .npy and .npz files: 2-D arrays with y upwards with the row, without units."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import fault, library_version, pick_channel, third_party
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

_CHANNEL = "array"
# NumPy itself reads no header of more than 10000 bytes
_HEADER_BYTES = 1 << 14
_CUT = "the file may be damaged or cut short: copy or export it again"


@dataclass(frozen=True)
class _Header:
    """What stands before an array: its shape, its type, whether columns are stored one after another, its length."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    by_columns: bool
    length: int


def read_npy(path: Path, channel: str | None) -> Scan:
    """Reads the array of a .npy file. Raises InputError unless it is 2-D and has real numbers."""
    pick_channel(path.name, [_CHANNEL], channel)
    with third_party(path.name, "a NumPy .npy file", "numpy"), path.open("rb") as file:
        header = _header(file)
        _check(path, header)
        heights = _heights(path, header, file)
    return _scan(heights, _CHANNEL, [_CHANNEL], "NumPy .npy")


def read_npz(path: Path, channel: str | None) -> Scan:
    """Reads the 2-D array of an .npz file that `channel` names; None takes the only one, or the one named as heights.

    Raises InputError where there is no such array. Only the array that is read is decompressed, and only as far as
    its header says.
    """
    with third_party(path.name, "a NumPy .npz archive", "numpy"), ZipFile(path) as archive:
        members = archive.infolist()
        arrays = _matrices(archive, members)
        if not arrays:
            listed = ", ".join(_name(member) for member in members[:4]) or "nothing"
            raise fault(path.name, "an .npz with a 2-D array", f"a zip of {listed}", "save the heights as .npy")
        names = list(arrays)
        name = names[pick_channel(path.name, names, channel)]
        member, header = arrays[name]
        _check(path, header)
        with archive.open(member) as file:
            heights = _heights(path, header, file)
    return _scan(heights, name, names, "NumPy .npz")


def _header(file: IO[bytes]) -> _Header:
    """Reads what stands before an array, in a bounded number of bytes. Raises ValueError where it is none."""
    head = BytesIO(file.read(_HEADER_BYTES))
    version = np.lib.format.read_magic(head)
    # version 3 is for names of fields in Unicode, and arrays with fields are no heights
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read(head)
    return _Header(shape, dtype, by_columns, head.tell())


def _name(member: ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _matrices(archive: ZipFile, members: Sequence[ZipInfo]) -> dict[str, tuple[ZipInfo, _Header]]:
    """Returns the 2-D arrays of an archive by name; members that are no arrays, or need pickle, are skipped."""
    arrays = {}
    for member in members:
        # NumPy stores or deflates; other methods may ask for gigabytes to decompress anything
        if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
            continue
        try:
            with archive.open(member) as file:
                header = _header(file)
        except ValueError:
            continue
        if len(header.shape) == 2 and not header.dtype.hasobject:
            arrays[_name(member)] = member, header
    return arrays


def _check(path: Path, header: _Header) -> None:
    make_room(path.name, header.shape)
    if header.dtype.kind not in "iuf":
        found = "an array of Python objects" if header.dtype.hasobject else f"an array of {header.dtype}"
        raise fault(path.name, "real numbers", found, "save the heights as float64")


def _heights(path: Path, header: _Header, file: IO[bytes]) -> NDArray[np.float64]:
    """Reads the samples line by line, so that their decompressed bytes never lie in memory as a whole."""
    file.seek(header.length)
    heights = np.empty(header.shape)
    for line in heights.T if header.by_columns else heights:
        stored = file.read(line.size * header.dtype.itemsize)
        if len(stored) < line.size * header.dtype.itemsize:
            ny, nx = header.shape
            raise fault(path.name, f"{ny} x {nx} samples, as the header says", "fewer", _CUT)
        line[:] = np.frombuffer(stored, header.dtype)
    # the end of a member is where zipfile compares its checksum
    file.read(1)
    return heights


def _scan(heights: NDArray[np.float64], name: str, names: list[str], form: str) -> Scan:
    return Scan(heights, None, None, None, name, tuple(names), form, library_version("numpy"))
