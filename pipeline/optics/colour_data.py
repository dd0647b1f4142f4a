"""Tables of colour-science, kept in the user's cache folder once they were used.

Importing the library takes a second and a half of a processor, as long as a whole table: a process that finds what it
needs in the cache leaves it alone.
"""

import os
import zipfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
import platformdirs

from pipeline import digest
from pipeline.optics.geometry import Array

Tables = dict[str, Array]


@cache
def illuminant(name: str) -> tuple[Array, Array]:
    """Wavelengths (n,), nm, and relative spectral power (n,) of an illuminant."""

    def read() -> Tables:
        import colour

        found = colour.SDS_ILLUMINANTS[name]
        return {"lambda_nm": found.wavelengths, "values": found.values}

    tables = _kept(f"illuminant {name}", read)
    return tables["lambda_nm"], tables["values"]


@cache
def observer(name: str) -> tuple[Array, Array]:
    """Wavelengths (n,), nm, and colour matching functions (n, 3) of an observer."""

    def read() -> Tables:
        import colour

        found = colour.MSDS_CMFS[name]
        return {"lambda_nm": found.wavelengths, "values": found.values}

    tables = _kept(f"observer {name}", read)
    return tables["lambda_nm"], tables["values"]


@cache
def srgb_to_xyz() -> Array:
    """The matrix (3, 3) from linear sRGB to XYZ."""

    def read() -> Tables:
        import colour

        return {"matrix": colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ}

    return _kept("sRGB to XYZ", read)["matrix"]


@cache
def xyz_to_srgb() -> Array:
    """The matrix (3, 3) from XYZ to linear sRGB, as the standard rounds it: not quite the other's inverse."""

    def read() -> Tables:
        import colour

        return {"matrix": colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB}

    return _kept("XYZ to sRGB", read)["matrix"]


@cache
def srgb_white() -> Array:
    """XYZ (3,) of sRGB's white, Y = 1."""

    def read() -> Tables:
        import colour

        x, y = colour.RGB_COLOURSPACES["sRGB"].whitepoint
        return {"white": np.array([x / y, 1.0, (1.0 - x - y) / y])}

    return _kept("sRGB white", read)["white"]


def _kept(what: str, read: Callable[[], Tables]) -> Tables:
    """The tables of this name from the cache, or read and put there where the cache can be written."""
    folder = Path(platformdirs.user_cache_dir("diffract-bake")) / f"colour-science-{version('colour-science')}"
    file = folder / f"{digest.of_json(what)}.npz"
    try:
        with np.load(file) as kept:
            return {name: np.asarray(kept[name], float) for name in kept.files}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        tables = {name: np.asarray(values, float) for name, values in read().items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f"{file.stem}-{os.getpid()}.writing.npz")
        np.savez(beside, allow_pickle=False, **tables)
        beside.replace(file)
    except OSError:
        pass  # a cache that cannot be written only costs the next process its import
    return tables
