"""Reads the formats of scanning probe microscopes that SurfaceTopography supports."""

import logging
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import (
    check_shape,
    library_version,
    micrometres,
    pick_channel,
    third_party,
    unique_names,
)
from pipeline.surface.scan import Scan

# SurfaceTopography's name of the format -> the format in words
FORMATS = {
    "di": "Bruker/Veeco Nanoscope",
    "ibw": "Igor binary wave",
    "jpk": "JPK image scan",
    "ezd": "Nanosurf .nid/.ezd",
    "wsxm": "WSxM",
    "mi": "Agilent/Molecular Imaging .mi",
    "ps": "Park Systems TIFF",
}
_LIBRARY = "SurfaceTopography"
# tifffile, which it uses, logs faults of damaged files, and logging prints to stderr where no handler is set
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def read(path: Path, key: str, channel: str | None) -> Scan:
    """Reads one height channel of a file in the format `key` of FORMATS.

    Raises InputError where the file is damaged or has no such channel.
    """
    with third_party(path.name, f"a {FORMATS[key]} file", _LIBRARY):
        from SurfaceTopography.IO import open_topography

        with open_topography(str(path), format=key) as opened:
            candidates = [(c, unit) for c in opened.channels if (unit := _height_unit(c)) is not None]
            names = unique_names([str(c.name) for c, _ in candidates])
            index = pick_channel(path.name, names, channel)
            chosen, unit = candidates[index]
            check_shape(path.name, chosen.nb_grid_pts[::-1])
            heights = _heights(chosen.topography().heights())
            pitch = _pitch(chosen, unit)
    return Scan(heights, unit, pitch, None, names[index], tuple(names), FORMATS[key], library_version(_LIBRARY))


def _height_unit(channel: Any) -> float | None:
    """Returns micrometres per unit of a channel's heights and lateral sizes; None for phases, voltages and profiles.

    The library converts heights and sizes to one unit where both are lengths; otherwise it gives a pair of units, or
    a separate unit of the values.
    """
    one_unit = isinstance(channel.unit, str) and isinstance(channel.data_unit, str)
    if channel.dim != 2 or not one_unit or micrometres(channel.data_unit) is None:
        return None
    return micrometres(channel.unit)


def _heights(stored: Any) -> NDArray[np.float64]:
    """Converts the library's array, whose first axis is x, to heights (ny, nx) with y upwards and NaN for holes.

    The library turns every format so that heights().T is the image with the top row first. This was compared with the
    preview inside a Park file (heights().T), and with another program's reading of a Nanoscope file, which stores the
    bottom line first (heights().T[::-1]).
    """
    filled = np.ma.filled(np.ma.asarray(stored, dtype=np.float64), np.nan)
    return np.ascontiguousarray(filled.T[::-1])


def _pitch(channel: Any, um_per_unit: float) -> tuple[float, float]:
    """Computes the pitch along (x, y), um: size of the field over number of samples."""
    notes = channel.info.get("raw_metadata", {})
    px, py = (
        _field(size, n, notes.get(note)) * um_per_unit / n
        for size, n, note in zip(
            channel.physical_sizes, channel.nb_grid_pts, ("FastScanSize", "SlowScanSize"), strict=True
        )
    )
    return px, py


def _field(size: float, n: int, scan_size: str | None) -> float:
    """Returns the size of the field of n samples, in the unit of `size`.

    Asylum scales its Igor waves so that the last sample lies at the scan size, a pitch of scan size / (n - 1), and
    the library multiplies this pitch by n. But samples are taken at a constant rate over the whole line: ScanSpeed
    over Sample Rate in the file's note is scan size / n. The field is therefore the scan size.
    """
    if scan_size is not None and isclose(size * (n - 1) / n, float(scan_size), rel_tol=1e-4):
        return float(scan_size)
    return float(size)
