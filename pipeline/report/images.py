"""Image files: EXR for numbers, PNG for display."""

import contextlib
import io
import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.errors import DamagedError, StorageError

# ISO interop ID of linear CIE XYZ, D65 white: without it many readers take Y for luminance and Z for depth
_XYZ_SPACE = "lin_ciexyzd65_scene"
# sRGB with perceptual intent, and the gamma and chromaticities that the PNG specification gives for older readers
_SRGB_CHUNKS = {
    b"cHRM": struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000),
    b"gAMA": struct.pack(">I", 45455),
    b"sRGB": b"\0",
}
# maps are as small as at zlib's usual level 6, in half the time
_PNG_LEVEL = 3
# the channels of tables: GPUs have no format of three half floats
RGBA = ("R", "G", "B", "A")


def write_xyz(path: Path, image: Array) -> None:
    """Writes an XYZ image as an EXR with the float32 channels brdf.X, brdf.Y, brdf.Z.

    path: the file. image: (rows, columns, 3), top row first.
    Raises StorageError where the file cannot be written.
    """
    write_exr(path, {f"brdf.{name}": image[..., c].astype(np.float32) for c, name in enumerate("XYZ")}, _XYZ_SPACE)


def write_rgba(path: Path, pixels: NDArray[Any]) -> None:
    """Writes a table as an EXR whose colour space is "data".

    path: the file. pixels: float32 or float16 (rows, columns, 4), top row first.
    Raises StorageError where the file cannot be written.
    """
    write_exr(path, {name: pixels[..., c] for c, name in enumerate(RGBA)}, "data")


def write_exr(path: Path, channels: Mapping[str, NDArray[Any]], colour_space: str) -> None:
    """Writes an EXR with ZIP compression.

    ZIP compresses 51 tables of 501 x 501 floats to 70 % in 2 s (uncompressed 0.7 s; PIZ 7 s, to 76 %). A second
    thread gains only 5 %. ZSTD compresses to 55 %, but readers before OpenEXR 3.5 do not support it.

    path: the file. channels: float32 or float16 (rows, columns) by name, top row first. colour_space: the ISO interop
        ID.
    Raises StorageError where the file cannot be written.
    """
    import OpenEXR

    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "colorInteropID": colour_space,
    }
    # OpenEXR.File replaces arrays in the dict that it is given: this is a copy
    planes = {name: np.ascontiguousarray(plane) for name, plane in channels.items()}
    try:
        OpenEXR.File(header, planes).write(str(path))
    except RuntimeError as error:
        raise StorageError(f"{path}: cannot be written ({error}); is the disk full?") from None


def read_xyz(path: Path) -> NDArray[np.float32]:
    """Reads an image that `write_xyz` wrote, (rows, columns, 3), top row first."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[f"brdf.{name}"].pixels for name in "XYZ"], axis=-1)


def decode(path: Path) -> dict[str, NDArray[Any]]:
    """Reads the pixels of an EXR whose structure was checked (`pipeline.report.exr`).

    Returns each channel (rows, columns) by name.
    Raises DamagedError, which does not name the file, where OpenEXR cannot decode it.
    """
    import OpenEXR

    try:
        with _quiet(), OpenEXR.File(str(path), separate_channels=True) as file:
            return {name: channel.pixels for name, channel in file.channels().items()}
    # OpenEXR raises errors of many classes
    except Exception as error:
        text = " ".join(str(error).split()).rstrip(".")
        raise DamagedError(f"cannot be read as EXR: {text or type(error).__name__}") from None


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Discards what a library prints within the block: OpenEXR's C++ writes to stderr, its Python to sys.stdout."""
    try:
        kept = os.dup(2)
    except OSError:
        # the process has no stderr
        yield
        return
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Writes 8-bit sRGB pixels (rows, columns, 3), top row first, with the chunks that state their colour space."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    for name, content in _SRGB_CHUNKS.items():
        info.add(name, content)
    Image.fromarray(pixels, "RGB").save(path, pnginfo=info, compress_level=_PNG_LEVEL)
