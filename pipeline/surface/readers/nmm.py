"""Prepares the archives of nano measuring machines (NMM) for SurfaceTopography."""

from io import BytesIO
from pathlib import Path
from zipfile import ZipFile


def in_utf8(path: Path) -> bytes:
    """Copies an archive with its descriptions in UTF-8, which alone the library reads.

    The instrument's program writes the sign of micro in one byte.
    """
    copied = BytesIO()
    with ZipFile(path) as archive, ZipFile(copied, "w") as copy:
        for name in archive.namelist():
            data = archive.read(name)
            copy.writestr(name, _utf8(data) if name.endswith(".dsc") else data)
    return copied.getvalue()


def _utf8(data: bytes) -> bytes:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1").encode("utf-8")
    return data
