"""Recognises the format of a scan file by its content, and by its suffix where the content is ambiguous."""

import codecs
import zipfile
from collections.abc import Callable
from pathlib import Path

from pipeline.errors import InputError
from pipeline.surface.readers import gsf, tiff
from pipeline.surface.readers.common import EXPORT, fault, one_line, third_party
from pipeline.surface.readers.formats import NOT_READ, NOT_READ_SUFFIXES
from pipeline.surface.readers.text import utf16_without_mark

# first bytes -> format key of readers.read_scan
_MAGIC = (
    (b"\x89PNG\r\n\x1a\n", "image"),
    (b"BM", "image"),
    (b"II+\x00", "image"),
    (b"MM\x00+", "image"),
    (b"II*\x00", "tiff"),
    (b"MM\x00*", "tiff"),
    (b"\x93NUMPY", "npy"),
    (b"PK\x03\x04", "zip"),
    (b"\x89HDF", "hdf5"),
    (b"GWYP", "gwyddion"),
    (b":NANONIS_VERSION:", "nanonis"),
    (b"\\*File list", "di"),
    (b"\\*EC File list", "di"),
    (b"?*File list", "di"),
    (b"[DataSet]", "nanosurf"),
    (b"WSxM file copyright", "wsxm"),
    (b"fileType  ", "mi"),
    (gsf.MAGIC, "gsf"),
    (b"aISO-1.0", "sdf"),
    (b"bISO-1.0", "sdf"),
    (b"aBCR-1.0", "sdf"),
    (b"bBCR-1.0", "sdf"),
    (b"DIGITAL SURF", "sur"),
    (b"\xd0\xcf\x11\xe0", "mnt"),
    (b"VCA DATA\x01\x00\x00\x55", "opdx"),
    (b"Wyko ASCII Data File Format", "asc"),
    (b"\x88\x1b\x03\x6f", "metropro"),
    (b"\x88\x1b\x03\x70", "metropro"),
    (b"\x88\x1b\x03\x71", "metropro"),
    (b"AliconaImaging\x00", "al3d"),
    (b"FRTM_GLIDERV", "frt"),
    (b"OmniSurf3D", "os3d"),
    (b"Binary TrueMap Data File v2.0", "tmd"),
    (b"VK3_", "vk"),
    (b"VK4_", "vk"),
    (b"VK6", "vk"),
    (b"VK7", "vk"),
    (b"KPK0", "zon"),
    (b"KPK1", "zon"),
    (b"Zeta-Instruments", "zmg"),
    (b"OLYMPUSRAWFORMAT", "oir"),
    (b"\x01\xb0\x93\xff", "mdt"),
    (b"fileformat = bcr", "bcr"),
    ("fileformat = bcr".encode("utf-16-le"), "bcr"),
    (b"\xff\xfe" + "fileformat = bcr".encode("utf-16-le"), "bcr"),
    (b"\xfe\xff" + "fileformat = bcr".encode("utf-16-be"), "bcr"),
    (b"CDF\x01", "nc"),
    (b"CDF\x02", "nc"),
    (b"MATLAB 5.0 MAT-file", "mat"),
    (b"MATLAB 7.3 MAT-file", "mat"),
    (b"\x05\x00", "ibw"),
    (b"\x00\x05", "ibw"),
)
# known formats that are refused: first bytes, name, remedy
_REFUSED = (
    (b"\xff\xd8\xff", "a JPEG image, whose compression alters heights", "export PNG or TIFF"),
    (b"GIF8", "a GIF image", "export PNG or TIFF"),
    (b"\x1f\x8b", "a gzip archive", "unpack it first"),
    (b"%PDF", "a PDF document", "export the height data itself"),
)
_IMAGE_SUFFIXES = (".png", ".bmp", ".tif", ".tiff")
_ARRAY_SUFFIXES = (".npy", ".npz")
_PROBE_SUFFIXES = (".gwy", ".sxm", ".ibw", ".jpk", ".spm", ".di", ".nid", ".ezd", ".mi", ".top", ".stp")
_BINARY_SUFFIXES = frozenset((*_IMAGE_SUFFIXES, *_ARRAY_SUFFIXES, *_PROBE_SUFFIXES))
_KNOWN = "a format that `diffract-bake inspect --formats` lists"
# private tags that only these instruments write on a TIFF's first page
_PARK_MAGIC_TAG = 50432
_JPK_FORMAT_TAG = 0x8000
# an attribute that only JPK's HDF5 files have
_JPK_GRID = "position-pattern.grid.ilength"
_HEAD_BYTES = 4096
# binary formats without first bytes of their own
_BY_SUFFIX = {".plu": "plu", ".apx": "plu", ".nms": "nms"}
# member of a zip that only one format has -> key
_BY_MEMBER = (
    ("main.xml", "x3p"),
    ("index.xml", "plux"),
)
# member of a zip that only one format has, which is not read -> name, remedy
_REFUSED_BY_MEMBER = (
    ("xl/workbook.xml", "an Excel workbook", "save the sheet with the heights as .csv"),
    ("header.properties", "JPK force curves, which are not read", EXPORT),
    ("Kontur1.prf", "a line profile of Mahr (.qep)", "take an areal scan"),
)
_BY_ZIP_SUFFIX = {".poir": "poir", ".x3p": "x3p", ".plux": "plux"}


def sniff(path: Path) -> str:
    """Returns the key of a file's format, one of formats.READ.

    Raises InputError where the file cannot be opened, is empty, or has a format that no reader knows.
    """
    head = _head(path)
    _refuse_known(path, head)
    suffix = path.suffix.lower()
    for magic, key in _MAGIC:
        if head.startswith(magic):
            return _CONTAINERS[key](path) if key in _CONTAINERS else key
    if head[2:11] == b"Directory":
        return "opd"
    if suffix in _BY_SUFFIX and not _is_text(head):
        return _BY_SUFFIX[suffix]
    if not _is_text(head) and utf16_without_mark(head) is None:
        raise _unknown(path, head)
    if path.suffix.lower() in _BINARY_SUFFIXES:
        raise fault(
            path.name,
            f"a {path.suffix.lower()} file, as the suffix says",
            f"plain text ({one_line(head.decode('latin-1'), 40)!r})",
            "rename it to .txt if it holds a matrix of heights",
        )
    return "text"


def _refuse_known(path: Path, head: bytes) -> None:
    """Raises InputError, which names the format, for one that is recognised and cannot be read."""
    for magic, found, way_out in _REFUSED:
        if head.startswith(magic):
            raise fault(path.name, _KNOWN, found, way_out)
    known = next((name for magic, name in NOT_READ if head.startswith(magic)), None)
    if known is None and not _is_text(head):
        known = NOT_READ_SUFFIXES.get(path.suffix.lower())
    if known is not None:
        raise fault(path.name, _KNOWN, f"{known}, which is not read", EXPORT)


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        reason = error.strerror or "an unreadable file"
        raise fault(path.name, "a readable scan file", reason, "check surface.path") from None
    if not head:
        raise fault(path.name, "a scan", "an empty file", "copy or export it again")
    return head


def _unknown(path: Path, head: bytes) -> InputError:
    found = f"unknown content (it begins with {head[:8].hex(' ')})"
    if path.suffix.lower() in _BINARY_SUFFIXES:
        expected = f"a {path.suffix.lower()} file, as the suffix says"
        return fault(path.name, expected, found, "it is damaged or misnamed: export it again")
    return fault(path.name, _KNOWN, found, "export the height channel as .npy, text or 16-bit PNG")


def _is_text(head: bytes) -> bool:
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return True
    return all(byte >= 0x20 or byte in b"\t\n\r\f" for byte in head)


def _zip_kind(path: Path) -> str:
    """Tells archives apart by a member that only one format has."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError):
        names = []
    found = _BY_ZIP_SUFFIX.get(path.suffix.lower())
    found = found or next((key for member, key in _BY_MEMBER if member in names or f"./{member}" in names), None)
    for member, refused, way_out in _REFUSED_BY_MEMBER:
        if found is None and member in names:
            raise fault(path.name, _KNOWN, refused, way_out)
    if found is None and any(name.endswith(".dsc") for name in names):
        return "nmm"
    return found or "npz"


def _hdf5_kind(path: Path) -> str:
    """Tells HDF5 files apart by the entries of three instruments; others are read as arrays without units."""
    with third_party(path.name, "an HDF5 file", "h5py"):
        import h5py

        with h5py.File(path, "r") as opened:
            if "MetaData" in opened:
                return "datx"
            if "nsf_file_version_major" in opened.attrs:
                return "nhf"
            if "Measurement_000" in opened and _JPK_GRID in opened["Measurement_000"].attrs:
                return "h5jpk"
    return "nc" if path.suffix.lower() == ".nc" else "h5"


def _tiff_kind(path: Path) -> str:
    """Distinguishes images from TIFFs of Park and JPK, which keep heights in private tags, and a preview as image."""
    found = tiff.tags(path)
    if _PARK_MAGIC_TAG in found:
        return "ps"
    if _JPK_FORMAT_TAG in found:
        return "jpk"
    return "lext" if path.suffix.lower() == ".lext" else "image"


_CONTAINERS: dict[str, Callable[[Path], str]] = {"tiff": _tiff_kind, "zip": _zip_kind, "hdf5": _hdf5_kind}
