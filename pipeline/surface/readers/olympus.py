"""Finds the samples that Olympus's microscopes mark as not measured, which SurfaceTopography does not read.

An image named INVALID lies with the heights: a page of one bit a sample in a .lext, a channel of its own in an .oir.
No published layout says that a sample other than 0 is invalid; the name does, and surfalize reads .lext files so.
"""

import struct
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import fault

KEYS = ("lext", "oir", "poir")
_NAME = "INVALID"


def not_measured(path: Path, key: str, channel: Any) -> NDArray[np.bool_]:
    """Reads the mask of the samples that a file marks as not measured.

    key: one of KEYS. channel: the library's description of the height channel. Returns bool (ny, nx), the top row
    first, true where a sample is not measured; nowhere in a file without such an image. Raises InputError where pages
    are missing at the end of a .lext.
    """
    nx, ny = (int(n) for n in channel.nb_grid_pts)
    stored = _lext(path) if key == "lext" else _oir(path, key, channel)
    if stored is None:
        return np.zeros((ny, nx), dtype=bool)
    return np.asarray(stored.reshape(ny, nx) != 0)


def _lext(path: Path) -> NDArray[Any] | None:
    from tifffile import TiffFile

    with TiffFile(path) as file:
        pages = list(file.pages)
        # of a chain that leads out of the file, tifffile lists the pages that it still finds
        if _following(file, pages[-1].offset) != 0:
            raise fault(path.name, "all pages of the TIFF", "fewer than it names", "copy or export it again")
        named = [page for page in pages if page.aspage().description.strip() == _NAME]
        return named[0].asarray() if named else None


def _following(file: Any, start: int) -> int:
    """Reads where the directory behind that at the offset `start` begins; 0 for the last one."""
    file.filehandle.seek(start)
    form = file.tiff
    (count,) = struct.unpack(form.tagnoformat, file.filehandle.read(form.tagnosize))
    file.filehandle.seek(start + form.tagnosize + count * form.tagsize)
    (found,) = struct.unpack(form.offsetformat, file.filehandle.read(form.offsetsize))
    return int(found)


def _oir(path: Path, key: str, channel: Any) -> NDArray[Any] | None:
    from SurfaceTopography.IO.OIR import OirMetadataBlockType

    reader = dict(channel.reader._readers)[channel.tags["fn"]] if key == "poir" else channel.reader
    properties = reader.metadata[OirMetadataBlockType.PROPERTIES]["lsmimage:imageProperties"]
    group = properties["commonimage:imageInfo"]["commonimage:phase"]["commonphase:group"]
    named = [
        entry["@id"]
        for entry in group["commonphase:channel"]
        if entry["commonphase:imageDefinition"]["commonphase:imageType"] == _NAME
    ]
    if not named:
        return None
    block = reader._data[f"{reader.metadata[OirMetadataBlockType.TOPOGRAPHY_PREFIX]}_{named[0]}_0"]
    if key == "poir":
        with ZipFile(path) as archive, archive.open(channel.tags["fn"]) as packed:
            data = block(packed)
    else:
        with path.open("rb") as file:
            data = block(file)
    nx, ny = channel.nb_grid_pts
    return np.frombuffer(data, dtype=f"<u{len(data) // (nx * ny)}")
