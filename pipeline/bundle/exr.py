"""Tables as EXR images: RGBA, for GPUs have no three-channel half float."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from pipeline.report.images import write_exr

CHANNELS = ("R", "G", "B", "A")


def write_rgba(path: Path, pixels: NDArray[Any]) -> None:
    """Pixels (rows, columns, RGBA) in float32 or float16, row 0 first. Raises StorageError."""
    write_exr(path, {name: pixels[..., c] for c, name in enumerate(CHANNELS)}, "data")


def describe(path: Path) -> dict[str, Any]:
    """Width, height, channel names (sorted) and pixel type ("float", "half", "uint", "mixed") of an EXR.

    Raises RuntimeError where the file is none.
    """
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        first, last = file.header()["dataWindow"]
        types = {channel.type().name.lower() for channel in channels.values()}
        return {
            "width": int(last[0] - first[0] + 1),
            "height": int(last[1] - first[1] + 1),
            "channels": sorted(channels),
            "pixel_type": types.pop() if len(types) == 1 else "mixed",
        }
