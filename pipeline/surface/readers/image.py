"""Reads grey images as height maps: codes up to full_code, the first row at the top, mostly without units."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from pipeline.surface.readers import image_units, tiff
from pipeline.surface.readers.common import (
    MAX_SAMPLES,
    check_shape,
    fault,
    library_version,
    pick_channel,
    third_party,
)
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

# Pillow logs faults of damaged files, and logging prints to stderr where no handler is set
logging.getLogger("PIL").addHandler(logging.NullHandler())
_CHANNEL = "grey"
_EXPECTED = "a PNG, TIFF or BMP image"
_WAY_OUT = "save it as 8- or 16-bit grey PNG or TIFF"
_FULL_8, _FULL_16 = 255.0, 65535.0
_WHITE_IS_ZERO = 0
# resolutions that differ by less are one
_SAME = 1e-3
# samples of a TIFF that Pillow reads as they are: (format, bits)
_BY_PILLOW = frozenset(
    ((tiff.UNSIGNED, bits) for bits in (1, 2, 4, 8, 12, 16)),
) | {(tiff.SIGNED, 8), (tiff.SIGNED, 16), (tiff.SIGNED, 32), (tiff.FLOAT, 32)}


@dataclass(frozen=True)
class _Pixels:
    """The pixels of an image, top row first, the largest code above 0, what they are, and the reading library.

    texts: what a PNG's text chunks say.
    """

    stored: NDArray[np.generic]
    full_code: float | None
    form: str
    reader: str
    steps: tuple[float, float] | None = None
    texts: Mapping[Any, Any] = field(default_factory=dict)


def read(path: Path, channel: str | None) -> Scan:
    """Reads the samples of a grey image, or of a colour image whose channels are equal.

    A TIFF's samples are what its tags say: unsigned and signed integers, floats, fewer bits than are stored.
    full_code is the largest code, such as 255 or 65535; None for floats. The number that the tag GDAL_NODATA names is
    a hole. Raises InputError for anything but one opaque grey page.
    """
    pick_channel(path.name, [_CHANNEL], channel, sole=True)
    found = tiff.tags(path) if _is_tiff(path) else {}
    kind = int(tiff.number(found, tiff.SAMPLE_FORMAT) or tiff.UNSIGNED), int(tiff.number(found, tiff.BITS) or 1)
    if found and (kind not in _BY_PILLOW or _is_big_endian_bigtiff(path)):
        pixels = _by_tifffile(path, kind, found)
    else:
        # given a name instead of a file, Pillow maps bytes into memory and garbles those that Orientation turns
        with third_party(path.name, _EXPECTED, "Pillow"), path.open("rb") as file, _opened(path, file) as opened:
            pixels = _by_pillow(path, opened, kind, found)
    check_shape(path.name, pixels.stored.shape)
    heights = np.ascontiguousarray(pixels.stored[::-1], dtype=np.float64)
    if (no_data := tiff.number(found, tiff.NO_DATA)) is not None:
        # the text of the tag may have more digits than the samples
        stored_so = float(pixels.stored.dtype.type(no_data)) if pixels.stored.dtype.kind == "f" else no_data
        heights[heights == stored_so] = np.nan
    ny, nx = heights.shape
    units = (
        image_units.of_tiff(found)
        if found
        else image_units.of_png(path.name, pixels.texts, (ny, nx), pixels.full_code)
    )
    return Scan(
        heights,
        units.um_per_code,
        units.pitch_um,
        pixels.full_code,
        _CHANNEL,
        (_CHANNEL,),
        pixels.form,
        pixels.reader,
        steps=pixels.steps if units.pitch_um is None else None,
    )


def _is_tiff(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def _is_big_endian_bigtiff(path: Path) -> bool:
    """Says whether a TIFF is of the one kind that Pillow does not open."""
    with path.open("rb") as file:
        return file.read(4) == b"MM\0+"


def _opened(path: Path, file: BinaryIO) -> Image.Image:
    """Opens an image and reads its header. Pillow's messages would name folders and settings of the library."""
    try:
        return Image.open(file, formats=("PNG", "TIFF", "BMP"))
    except UnidentifiedImageError:
        raise fault(
            path.name, _EXPECTED, "content that Pillow does not know", f"export it again, or {_WAY_OUT}"
        ) from None
    except Image.DecompressionBombError:
        expected = f"at most {MAX_SAMPLES} samples along each axis"
        raise fault(path.name, expected, "a far larger image", "crop or resample it") from None


def _by_pillow(path: Path, opened: Image.Image, kind: tuple[int, int], found: tiff.Tags) -> _Pixels:
    """Returns the pixels of an image that Pillow reads as they are stored; it also turns them as a tag says."""
    make_room(path.name, (opened.height, opened.width))
    pages = getattr(opened, "n_frames", 1)
    if pages != 1:
        raise fault(path.name, "one image", f"{pages} pages", "save the page with the heights alone")
    _refuse_lossy(path, opened)
    mode, form = opened.mode, f"{opened.format} image, {opened.mode}"
    steps = _steps(found) or _png_steps(opened)
    # before it is loaded, an image whose sides Orientation exchanges has the wrong shape
    opened.load()
    stored, full_code = _codes(path, opened, kind)
    if found and kind[0] == tiff.SIGNED:
        form = f"TIFF image, int{kind[1]}"
    elif found and mode.startswith("I;16"):
        full_code = _full_code(stored, kind[1], found)
        form += f", {full_code:g} at most"
    return _Pixels(stored, full_code, form, library_version("pillow"), steps, opened.info)


def _codes(path: Path, opened: Image.Image, kind: tuple[int, int]) -> tuple[NDArray[np.generic], float | None]:
    """Returns the pixels as stored, top row first, and the largest code."""
    if kind[0] == tiff.SIGNED and opened.mode in ("L", "I"):
        bits = kind[1]
        stored = np.asarray(opened)
        return (stored.view(np.int8) if bits == 8 else stored), 2.0 ** (bits - 1) - 1
    if opened.mode == "L":
        return np.asarray(opened), _FULL_8
    if opened.mode == "1":
        return np.asarray(opened.convert("L")), _FULL_8
    if opened.mode.startswith("I;16") or (opened.mode == "I" and opened.format == "PNG"):
        return np.asarray(opened), _FULL_16
    if opened.mode == "F":
        return np.asarray(opened), None
    if opened.mode in ("P", "PA", "LA", "RGB", "RGBA"):
        return _grey_of_colour(path, np.asarray(opened.convert("RGBA"))), _FULL_8
    raise fault(path.name, "grey codes or floats", f"pixels of type {opened.mode!r}", _WAY_OUT)


def _full_code(stored: NDArray[np.generic], bits: int, found: tiff.Tags) -> float:
    """Returns the largest code of a camera with fewer bits than are stored, where a tag says so."""
    largest = tiff.number(found, tiff.MAX_SAMPLE) or 0.0
    # other values of this tag are the largest code of this image
    full_scale = largest > _FULL_8 and (largest + 1).is_integer() and int(largest + 1).bit_count() == 1
    return largest if full_scale and float(np.max(stored)) <= largest else 2.0**bits - 1


def _by_tifffile(path: Path, kind: tuple[int, int], found: tiff.Tags) -> _Pixels:
    """Returns the pixels of a TIFF whose samples Pillow does not read: half and double floats, 32-bit codes."""
    with third_party(path.name, "a TIFF image", "tifffile"):
        import tifffile

        with tifffile.TiffFile(path) as opened:
            if len(opened.pages) != 1:
                pages = f"{len(opened.pages)} pages"
                raise fault(path.name, "one image", pages, "save the page with the heights alone")
            page = opened.pages[0]
            make_room(path.name, page.shape)
            try:
                stored = page.asarray()
            except ValueError as error:
                if "imagecodecs" not in str(error):
                    raise
                found_so = f"one compressed by {getattr(page.compression, 'name', page.compression)}"
                raise fault(path.name, "an uncompressed TIFF", found_so, "save it without compression") from None
    # a damaged file may decode to another shape than its tags promise
    check_shape(path.name, stored.shape)
    stored = _turned(stored, int(tiff.number(found, tiff.ORIENTATION) or 1))
    if stored.dtype.kind not in "iuf":
        raise fault(path.name, "grey codes or floats", f"pixels of type {stored.dtype}", _WAY_OUT)
    form, bits = kind
    full_code = None if form == tiff.FLOAT else 2.0 ** (bits - (form == tiff.SIGNED)) - 1
    return _Pixels(stored, full_code, f"TIFF image, {stored.dtype.name}", library_version("tifffile"), _steps(found))


def _turned(stored: NDArray[np.generic], orientation: int) -> NDArray[np.generic]:
    """Turns pixels as the tag Orientation says, the first row to the top and the first column to the left."""
    if orientation > 4:
        stored = stored.T
        # 5: no more; 6: rows from the right; 7: both; 8: columns from the bottom
        return {6: stored[:, ::-1], 7: stored[::-1, ::-1], 8: stored[::-1]}.get(orientation, stored)
    return {2: stored[:, ::-1], 3: stored[::-1, ::-1], 4: stored[::-1]}.get(orientation, stored)


def _steps(found: tiff.Tags) -> tuple[float, float] | None:
    """Returns the sample distance along (x, y), in a unit that is not used, where a TIFF's pixels are oblong."""
    scale = found.get(tiff.PIXEL_SCALE, ())
    if not isinstance(scale, str) and len(scale) >= 2:
        return (scale[0], scale[1]) if min(scale[:2]) > 0 else None
    x, y = tiff.number(found, tiff.X_RESOLUTION), tiff.number(found, tiff.Y_RESOLUTION)
    return _oblong(x, y)


def _png_steps(opened: Image.Image) -> tuple[float, float] | None:
    x, y = opened.info.get("dpi") or opened.info.get("aspect") or (None, None)
    return _oblong(x, y)


def _oblong(x: float | None, y: float | None) -> tuple[float, float] | None:
    """Returns the steps of two resolutions that differ; equal ones are mostly a program's default."""
    if not x or not y or min(x, y) <= 0 or abs(x - y) <= _SAME * x:
        return None
    return 1 / x, 1 / y


def _grey_of_colour(path: Path, rgba: NDArray[np.uint8]) -> NDArray[np.uint8]:
    grey = rgba[..., 0]
    if not (np.array_equal(grey, rgba[..., 1]) and np.array_equal(grey, rgba[..., 2])):
        apart = int(np.count_nonzero(np.ptp(rgba[..., :3], axis=-1)))
        raise fault(
            path.name, "grey pixels (R = G = B)", f"{apart} coloured ones", "export heights, not a colour map"
        )
    if rgba[..., 3].min() < 255:
        raise fault(path.name, "opaque pixels", "transparent ones", "flatten the image first")
    return grey


def _refuse_lossy(path: Path, opened: Image.Image) -> None:
    """Raises InputError for formats that Pillow converts silently."""
    if opened.format == "PNG" and _png_bits_and_colour(path) in ((16, 2), (16, 4), (16, 6)):
        # Pillow keeps only the high byte of 16-bit PNGs with colour or alpha
        raise fault(path.name, "8-bit colour or 16-bit grey", "16-bit colour or alpha", _WAY_OUT)
    tags = getattr(opened, "tag_v2", None) or {}
    unsigned_bytes = opened.mode in ("1", "L") and tags.get(tiff.SAMPLE_FORMAT, (tiff.UNSIGNED,))[0] == tiff.UNSIGNED
    if tags.get(tiff.PHOTOMETRIC) == _WHITE_IS_ZERO and not unsigned_bytes:
        # Pillow inverts only the unsigned 8-bit ones
        raise fault(path.name, "a TIFF in which black is zero", "one in which white is zero", _WAY_OUT)


def _png_bits_and_colour(path: Path) -> tuple[int, int]:
    """Reads bit depth and colour type, at fixed positions of a PNG's first chunk."""
    with path.open("rb") as file:
        header = file.read(26)
    return header[24], header[25]
