"""Tables of colour-science, kept in the user's cache folder once they were used.

Importing the library takes a second and a half of a processor, as long as a whole table: a process that finds what it
needs in the cache leaves it alone.
"""

import os
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from pipeline.arrays import Array
from pipeline.store import digest

Tables = dict[str, Any]


@dataclass(frozen=True)
class Srgb:
    """Linear sRGB: matrices (3, 3) to XYZ and from it, as the standard rounds them, and XYZ (3,) of its white."""

    to_xyz: Array
    from_xyz: Array
    white: Array


def illuminant(name: str) -> tuple[Array, Array]:
    """Wavelengths (n,), nm, and relative spectral power (n,) of an illuminant."""
    return _spectral("SDS_ILLUMINANTS", name)


def observer(name: str) -> tuple[Array, Array]:
    """Wavelengths (n,), nm, and colour matching functions (n, 3) of an observer."""
    return _spectral("MSDS_CMFS", name)


@cache
def srgb() -> Srgb:
    """The space that displays show."""

    def read() -> Tables:
        import colour

        space = colour.RGB_COLOURSPACES["sRGB"]
        x, y = space.whitepoint
        white = np.array([x / y, 1.0, (1.0 - x - y) / y])
        return {"to_xyz": space.matrix_RGB_to_XYZ, "from_xyz": space.matrix_XYZ_to_RGB, "white": white}

    return Srgb(**_kept("sRGB", read))


@cache
def _spectral(dataset: str, name: str) -> tuple[Array, Array]:
    """Wavelengths and values of an entry of one of the library's datasets."""

    def read() -> Tables:
        import colour

        found = getattr(colour, dataset)[name]
        return {"lambda_nm": found.wavelengths, "values": found.values}

    tables = _kept(f"{dataset} {name}", read)
    return tables["lambda_nm"], tables["values"]


def _kept(what: str, read: Callable[[], Tables]) -> Tables:
    """The tables of this name from the cache, or read and put there where the cache can be written."""
    folder = Path(platformdirs.user_cache_dir("diffract-bake")) / f"colour-science-{version('colour-science')}"
    file = folder / f"{digest.of_json(what)}.npz"
    try:
        # numpy leaves a damaged file open that it opened itself
        with file.open("rb") as stream, np.load(stream) as kept:
            return {name: np.asarray(kept[name], float) for name in kept.files}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        tables: Tables = {name: np.asarray(values, float) for name, values in read().items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f"{file.stem}-{os.getpid()}.writing.npz")
        np.savez(beside, **tables)
        beside.replace(file)
    except OSError:
        pass  # a cache that cannot be written only costs the next process its import
    return tables
