"""Reads grey images as height maps: codes 0..full_code, the first row at the top, without units."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from pipeline.surface.readers.common import (
    MAX_SAMPLES,
    check_shape,
    fault,
    library_version,
    pick_channel,
    third_party,
)
from pipeline.surface.scan import Scan

_CHANNEL = "grey"
_EXPECTED = "a PNG, TIFF or BMP image"
_WAY_OUT = "save it as 8- or 16-bit grey PNG or TIFF"
_FULL_8, _FULL_16 = 255.0, 65535.0
_PHOTOMETRIC, _WHITE_IS_ZERO = 262, 0


def read(path: Path, channel: str | None) -> Scan:
    """Reads the codes of a grey image, or of a colour image whose channels are equal.

    full_code is 255 or 65535, None for floating-point TIFFs. Raises InputError for anything but one opaque grey page.
    """
    pick_channel(path.name, [_CHANNEL], channel)
    with third_party(path.name, _EXPECTED, "Pillow"), _opened(path) as opened:
        codes, full_code = _codes(path, opened)
        form = f"{opened.format} image, {opened.mode}"
    heights = np.ascontiguousarray(codes[::-1], dtype=np.float64)
    return Scan(heights, None, None, full_code, _CHANNEL, (_CHANNEL,), form, library_version("pillow"))


def _opened(path: Path) -> Image.Image:
    """Opens an image and reads its header. Pillow's messages would name folders and settings of the library."""
    try:
        return Image.open(path, formats=("PNG", "TIFF", "BMP"))
    except UnidentifiedImageError:
        raise fault(path.name, _EXPECTED, "a damaged one", "export it again") from None
    except Image.DecompressionBombError:
        expected = f"at most {MAX_SAMPLES} samples along each axis"
        raise fault(path.name, expected, "a far larger image", "crop or resample it") from None


def _codes(path: Path, opened: Image.Image) -> tuple[NDArray[np.generic], float | None]:
    """Returns the pixels as stored, top row first, and the largest code."""
    check_shape(path.name, (opened.height, opened.width))
    pages = getattr(opened, "n_frames", 1)
    if pages != 1:
        raise fault(path.name, "one image", f"{pages} pages", "save the page with the heights alone")
    _refuse_lossy(path, opened)
    if opened.mode in ("1", "L"):
        return np.asarray(opened.convert("L")), _FULL_8
    if opened.mode.startswith("I;16") or (opened.mode == "I" and opened.format == "PNG"):
        return np.asarray(opened), _FULL_16
    if opened.mode == "F":
        return np.asarray(opened), None
    if opened.mode in ("P", "PA", "LA", "RGB", "RGBA"):
        return _grey_of_colour(path, np.asarray(opened.convert("RGBA"))), _FULL_8
    raise fault(path.name, "8- or 16-bit codes or floats", f"pixels of type {opened.mode!r}", _WAY_OUT)


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
    white_is_zero = _tiff_tag(opened, _PHOTOMETRIC) == _WHITE_IS_ZERO
    if opened.format == "TIFF" and white_is_zero and opened.mode not in ("1", "L"):
        # Pillow inverts only the 8-bit ones
        raise fault(path.name, "a TIFF in which black is zero", "one in which white is zero", _WAY_OUT)


def _tiff_tag(opened: Image.Image, tag: int) -> object:
    tags = getattr(opened, "tag_v2", None)
    return None if tags is None else tags.get(tag)


def _png_bits_and_colour(path: Path) -> tuple[int, int]:
    """Reads bit depth and colour type, at fixed positions of a PNG's first chunk."""
    with path.open("rb") as file:
        header = file.read(26)
    return header[24], header[25]
