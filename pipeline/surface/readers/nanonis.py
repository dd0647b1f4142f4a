"""Reads Nanonis' .sxm files, by nanonispy2."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import (
    fault,
    library_version,
    micrometres,
    pick_channel,
    replaced,
    third_party,
)
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

_BACKWARD = " backward"


def read(path: Path, channel: str | None) -> Scan:
    """Reads one channel in one direction: "Z" is the forward scan, "Z backward" the backward scan.

    Lines that were not scanned are NaN in the file, and become holes.
    """
    with third_party(path.name, "a Nanonis .sxm file", "nanonispy2"):
        from nanonispy2 import read as nanonis

        # it takes the kind of a file from the suffix
        with (
            replaced(nanonis, "_is_valid_file", lambda _, ext: ext),
            replaced(nanonis.Scan, "_determine_filetype", lambda _: "scan"),
        ):
            stored = nanonis.Scan(str(path))
        units = dict(zip(stored.header["data_info"]["Name"], stored.header["data_info"]["Unit"], strict=True))
        names = [name + suffix for name, unit in units.items() if micrometres(unit) for suffix in ("", _BACKWARD)]
        name = names[pick_channel(path.name, names, channel)]
        heights = _heights(path, stored, name)
        um_per_unit = micrometres(units[name.removesuffix(_BACKWARD)])
        # the range is in metres, and N pixels wide
        range_x, range_y = (float(metres) * 1e6 for metres in stored.header["scan_range"])
        pitch = range_x / heights.shape[1], range_y / heights.shape[0]
    return Scan(heights, um_per_unit, pitch, None, name, tuple(names), "Nanonis .sxm", library_version("nanonispy2"))


def _heights(path: Path, stored: Any, name: str) -> NDArray[np.float64]:
    """Turns a channel so that x grows to the right and y upwards; the file has samples in the order of scanning."""
    direction = "backward" if name.endswith(_BACKWARD) else "forward"
    lines = np.array(stored.signals[name.removesuffix(_BACKWARD)][direction], dtype=np.float64)
    make_room(path.name, lines.shape)
    if direction == "backward":
        # backward scans begin at the right
        lines = lines[:, ::-1]
    slow_direction = stored.header["scan_dir"]
    if slow_direction not in ("up", "down"):
        raise fault(path.name, "SCAN_DIR 'up' or 'down'", repr(slow_direction), "export it again")
    if slow_direction == "down":
        # the first line scanned was the top one
        lines = lines[::-1]
    return np.ascontiguousarray(lines)
