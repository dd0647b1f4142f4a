"""Recognises the format of a scan file by its content, and by its suffix where the content is ambiguous."""

import codecs
from pathlib import Path

from pipeline.errors import InputError
from pipeline.surface.readers import tiff
from pipeline.surface.readers.common import fault, one_line
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
    (b"PK\x03\x04", "npz"),
    (b"GWYP", "gwyddion"),
    (b":NANONIS_VERSION:", "nanonis"),
    (b"\\*File list", "di"),
    (b"\\*EC File list", "di"),
    (b"?*File list", "di"),
    (b"[DataSet]", "nanosurf"),
    (b"WSxM file copyright", "wsxm"),
    (b"fileType  ", "mi"),
    (b"\x05\x00", "ibw"),
    (b"\x00\x05", "ibw"),
)
# known formats that are refused: first bytes, name, remedy
_REFUSED = (
    (b"\xff\xd8\xff", "a JPEG image, whose compression alters heights", "export PNG or TIFF"),
    (b"GIF8", "a GIF image", "export PNG or TIFF"),
    (b"\x89HDF", "an HDF5 file", "export one 2-D channel as .npy"),
    (b"\x1f\x8b", "a gzip archive", "unpack it first"),
    (b"%PDF", "a PDF document", "export the height data itself"),
)
_IMAGE_SUFFIXES = (".png", ".bmp", ".tif", ".tiff")
_ARRAY_SUFFIXES = (".npy", ".npz")
_PROBE_SUFFIXES = (".gwy", ".sxm", ".ibw", ".jpk", ".spm", ".di", ".nid", ".ezd", ".mi", ".top", ".stp")
_BINARY_SUFFIXES = frozenset((*_IMAGE_SUFFIXES, *_ARRAY_SUFFIXES, *_PROBE_SUFFIXES))
_KNOWN = "an image, .npy/.npz, text or a scanning probe format"
# private tags that only these instruments write on a TIFF's first page
_PARK_MAGIC_TAG = 50432
_JPK_FORMAT_TAG = 0x8000
_HEAD_BYTES = 4096


def sniff(path: Path) -> str:
    """Returns the key of a file's format: "image", "text", "npy", "npz", "gwyddion", "nanonis",
    "nanosurf" or one of spm.FORMATS.

    Raises InputError where the file cannot be opened, is empty, or has a format that no reader knows.
    """
    head = _head(path)
    for magic, found, way_out in _REFUSED:
        if head.startswith(magic):
            raise fault(path.name, _KNOWN, found, way_out)
    for magic, key in _MAGIC:
        if head.startswith(magic):
            return _tiff_kind(path) if key == "tiff" else key
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


def _tiff_kind(path: Path) -> str:
    """Distinguishes images from TIFFs of Park and JPK, which keep heights in private tags, and a preview as image."""
    found = tiff.tags(path)
    if _PARK_MAGIC_TAG in found:
        return "ps"
    return "jpk" if _JPK_FORMAT_TAG in found else "image"
