"""Pictures on disk: EXR for numbers, PNG for eyes."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import StorageError
from pipeline.optics.geometry import Array

# ISO interop ID of linear CIE XYZ, D65 white: without it many readers take Y for luminance and Z for depth
_XYZ_SPACE = "lin_ciexyzd65_scene"


def write_xyz(path: Path, image: Array) -> None:
    """An XYZ image (rows, columns, 3) as float32 EXR channels brdf.X, brdf.Y, brdf.Z, first row on top.

    Raises StorageError.
    """
    import OpenEXR

    channels = {f"brdf.{name}": np.ascontiguousarray(image[..., c], np.float32) for c, name in enumerate("XYZ")}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "colorInteropID": _XYZ_SPACE,
    }
    try:
        OpenEXR.File(header, channels).write(str(path))
    except RuntimeError as error:
        raise StorageError(f"{path}: cannot be written ({error}); is the disk full?") from None


def read_xyz(path: Path) -> NDArray[np.float32]:
    """The image (rows, columns, 3) that `write_xyz` wrote."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[f"brdf.{name}"].pixels for name in "XYZ"], axis=-1)


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """8-bit sRGB pixels (rows, columns, 3)."""
    from PIL import Image

    Image.fromarray(pixels, "RGB").save(path)
