"""Reads NumPy's .npy and .npz files: 2-D arrays with y upwards with the row, without units."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import check_shape, fault, library_version, pick_channel, third_party
from pipeline.surface.scan import Scan

_CHANNEL = "array"


def read_npy(path: Path, channel: str | None) -> Scan:
    """Reads the array of a .npy file. Raises InputError unless it is 2-D and has real numbers."""
    pick_channel(path.name, [_CHANNEL], channel)
    with third_party(path.name, "a NumPy .npy file", "numpy"):
        _refuse_objects(path)
        # mapped into memory, so that a shape which is refused is not loaded
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
        heights = _heights(path, stored)
    return _scan(heights, _CHANNEL, [_CHANNEL], "NumPy .npy")


def read_npz(path: Path, channel: str | None) -> Scan:
    """Reads the 2-D array of an .npz file that `channel` names; None takes the only one, or the one named as heights.

    Raises InputError where there is no such array.
    """
    with (
        third_party(path.name, "a NumPy .npz archive", "numpy"),
        np.load(path, allow_pickle=False) as archive,
    ):
        arrays = _matrices(archive)
        if not arrays:
            listed = ", ".join(archive.files[:4]) or "nothing"
            raise fault(path.name, "an .npz with a 2-D array", f"a zip of {listed}", "save the heights as .npy")
        names = list(arrays)
        name = names[pick_channel(path.name, names, channel)]
        heights = _heights(path, arrays[name])
    return _scan(heights, name, names, "NumPy .npz")


def _refuse_objects(path: Path) -> None:
    """Refuses an array of Python objects, which cannot be mapped, by the header alone."""
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        if version not in ((1, 0), (2, 0)):
            return
        read_header = (
            np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        )
        _, _, stored = read_header(file)
    if stored.hasobject:
        raise fault(path.name, "real numbers", "an array of Python objects", "save the heights as float64")


def _matrices(archive: Any) -> dict[str, NDArray[Any]]:
    """Returns the 2-D arrays of an archive by name; members that are no arrays, or need pickle, are skipped."""
    arrays = {}
    for name in archive.files:
        try:
            member = archive[name]
        except ValueError:
            continue
        if isinstance(member, np.ndarray) and member.ndim == 2:
            arrays[name] = member
    return arrays


def _heights(path: Path, stored: NDArray[Any]) -> NDArray[np.float64]:
    check_shape(path.name, stored.shape)
    if stored.dtype.kind not in "iuf":
        found = f"an array of {stored.dtype}"
        raise fault(path.name, "real numbers", found, "save the heights as float64")
    return np.array(stored, dtype=np.float64, order="C")


def _scan(heights: NDArray[np.float64], name: str, names: list[str], form: str) -> Scan:
    return Scan(heights, None, None, None, name, tuple(names), form, library_version("numpy"))
