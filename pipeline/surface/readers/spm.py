"""Formats of scanning probe microscopes that SurfaceTopography reads."""

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
# beneath it, tifffile logs what it finds in damaged files; without any handler that would be printed
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def read(path: Path, key: str, channel: str | None) -> Scan:
    """One height channel of a file in FORMATS[key]. Raises InputError where there is none, or damage."""
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
    """Micrometres per unit of a channel's heights and field; None for phases, voltages and profiles.

    Where both are lengths the library converts them to one unit; where they are not, it gives a pair, or
    a unit of the values apart.
    """
    one_unit = isinstance(channel.unit, str) and isinstance(channel.data_unit, str)
    if channel.dim != 2 or not one_unit or micrometres(channel.data_unit) is None:
        return None
    return micrometres(channel.unit)


def _heights(stored: Any) -> NDArray[np.float64]:
    """Heights (ny, nx) with y up, NaN for holes, of the library's x-first array.

    Its readers turn every format so that heights().T is the image with the top row first. Held against
    the preview inside a Park file (heights().T), and against another program's reading of a Nanoscope
    file, which stores the bottom line first (heights().T[::-1]).
    """
    filled = np.ma.filled(np.ma.asarray(stored, dtype=np.float64), np.nan)
    return np.ascontiguousarray(filled.T[::-1])


def _pitch(channel: Any, um_per_unit: float) -> tuple[float, float]:
    """Field over number of samples along (x, y), um."""
    notes = channel.info.get("raw_metadata", {})
    px, py = (
        _field(size, n, notes.get(note)) * um_per_unit / n
        for size, n, note in zip(
            channel.physical_sizes, channel.nb_grid_pts, ("FastScanSize", "SlowScanSize"), strict=True
        )
    )
    return px, py


def _field(size: float, n: int, scan_size: str | None) -> float:
    """The field of n samples.

    Asylum scales its Igor waves so that the last sample sits at the scan size, a pitch of
    scan size / (n - 1), and the library takes n times that for the field. But samples are taken at an
    even rate over the whole line: ScanSpeed over Sample Rate in the file's own note is
    scan size / n. So the field is the scan size, and n samples wide.
    """
    if scan_size is not None and isclose(size * (n - 1) / n, float(scan_size), rel_tol=1e-4):
        return float(scan_size)
    return float(size)
