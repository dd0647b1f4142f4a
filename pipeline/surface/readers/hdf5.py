"""Reads the HDF5 files of two microscopes: JPK's .h5-jpk and Nanosurf's .nhf.

The layouts are those of two published readers: AFMReader (h5_jpk.py) for JPK, and the vendor's own, of the package
nanosurf (nhf_reader.py), for Nanosurf.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import (
    fault,
    library_version,
    micrometres,
    pick_channel,
    third_party,
    unique_names,
)
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

_GRID = "position-pattern.grid."
_ENCODER = "net-encoder.scaling."
# version 1 of .nhf numbers the types of samples; codes from the lowest to the highest span the calibrated range
_NUMBERED_TYPES = ("int32", "uint8", "uint16", "uint32", "uint64", "int16", "int64", "double")
_IMAGE_GROUPS = ("image_line_based",)


@dataclass(frozen=True)
class _Channel:
    """A channel of heights: its name, its samples and the attributes that say what they are.

    shape: (ny, nx). field_um: size along (x, y). frame, frames: the image's number in a movie, from 0, and their
    number. reflected: whether the top line is stored first.
    """

    name: str
    data: Any
    attributes: dict[str, Any]
    shape: tuple[int, int]
    field_um: tuple[float, float]
    frame: int = 0
    frames: int = 1
    reflected: bool = False


def read_jpk(path: Path, channel: str | None) -> Scan:
    """Reads one image of JPK's .h5-jpk; its first line is the bottom one, unless the grid is reflected.

    Of a movie, each frame is a channel, and one must be named. Raises InputError where no channel fits.
    """
    with third_party(path.name, "a JPK .h5-jpk file", "h5py"):
        import h5py

        with h5py.File(path, "r") as opened:
            channels = list(_jpk_channels(opened))
            if channel is None and channels and channels[0].frames > 1:
                listed = f"a movie of {channels[0].frames} frames"
                raise fault(path.name, "one image", listed, f"set surface.channel, such as {channels[0].name!r}")
            chosen, names, index = _chosen(path, channels, channel)
            stored = chosen.data[:, chosen.frame] if chosen.data.ndim == 2 else chosen.data[:]
            heights = stored.astype(np.float64).reshape(chosen.shape)
            heights = heights * chosen.attributes.get(f"{_ENCODER}multiplier", 1.0)
            if chosen.reflected:
                heights = heights[::-1]
            unit = micrometres(_text(chosen.attributes.get(f"{_ENCODER}unit.unit", "")))
    return _scan(chosen, heights, unit, names, index, "JPK .h5-jpk")


def read_nanosurf(path: Path, channel: str | None) -> Scan:
    """Reads one image of Nanosurf's .nhf; its first line is the bottom one, and its fill value marks holes.

    Raises InputError where no channel of an image is calibrated as a length.
    """
    with third_party(path.name, "a Nanosurf .nhf file", "h5py"):
        import h5py

        with h5py.File(path, "r") as opened:
            chosen, names, index = _chosen(path, list(_nanosurf_channels(opened)), channel)
            heights = _calibrated(chosen)
            unit = micrometres(_calibration(chosen.attributes, "unit"))
    return _scan(chosen, heights, unit, names, index, "Nanosurf .nhf")


def _chosen(path: Path, channels: list[_Channel], channel: str | None) -> tuple[_Channel, list[str], int]:
    names = unique_names([found.name for found in channels])
    index = pick_channel(path.name, names, channel)
    chosen = channels[index]
    make_room(path.name, chosen.shape)
    expected = chosen.shape[0] * chosen.shape[1] * chosen.frames
    if chosen.data.size != expected:
        found = f"{chosen.data.size} samples"
        raise fault(path.name, f"{expected} samples, as its grid says", found, "copy or export it again")
    return chosen, names, index


def _scan(
    chosen: _Channel, heights: NDArray[np.float64], unit: float | None, names: list[str], index: int, form: str
) -> Scan:
    ny, nx = chosen.shape
    pitch = chosen.field_um[0] / nx, chosen.field_um[1] / ny
    heights = np.ascontiguousarray(heights)
    return Scan(heights, unit, pitch, None, names[index], tuple(names), form, library_version("h5py"))


def _text(value: Any) -> str:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)


# --- JPK ---------------------------------------------------------------------------------------------


def _jpk_channels(opened: Any) -> Iterator[_Channel]:
    """Lists the channels whose values are lengths, or have no unit; every frame of a movie is one."""
    for measurement in (group for key, group in opened.items() if key.startswith("Measurement")):
        grid = measurement.attrs
        shape = int(grid[f"{_GRID}jlength"]), int(grid[f"{_GRID}ilength"])
        scale = micrometres(_text(grid.get(f"{_GRID}unit.unit", "m"))) or 0.0
        field = float(grid[f"{_GRID}ulength"]) * scale, float(grid[f"{_GRID}vlength"]) * scale
        reflected = _is_true(grid.get(f"{_GRID}reflect", False))
        for group in (group for key, group in measurement.items() if key.startswith("Channel")):
            attributes = dict(group.attrs)
            unit = _text(attributes.get(f"{_ENCODER}unit.unit", ""))
            sets = [found for found in group.values() if hasattr(found, "dtype") and found.ndim in (1, 2)]
            if len(sets) != 1 or (unit and micrometres(unit) is None):
                continue
            name = _text(attributes.get("channel.name", "channel"))
            name += " (retrace)" if _is_true(attributes.get("retrace", False)) else ""
            frames = sets[0].shape[1] if sets[0].ndim == 2 else 1
            for frame in range(frames):
                numbered = f"{name} frame {frame + 1}" if frames > 1 else name
                yield _Channel(numbered, sets[0], attributes, shape, field, frame, frames, reflected)


def _is_true(value: Any) -> bool:
    return _text(value).strip().casefold() in ("true", "1")


# --- Nanosurf ----------------------------------------------------------------------------------------


def _nanosurf_channels(opened: Any) -> Iterator[_Channel]:
    """Lists the channels of images that are calibrated as lengths; a segment is a direction of the scan."""
    for measurement in (group for group in opened.values() if hasattr(group, "values")):
        kind = measurement.attrs.get("group_type", measurement.attrs.get("measurement_type"))
        if _text(kind) not in _IMAGE_GROUPS:
            continue
        for segment in (group for group in measurement.values() if hasattr(group, "values")):
            attributes = {**measurement.attrs, **segment.attrs}
            shape, field = _nanosurf_grid(attributes)
            direction = _text(attributes.get("segment_name", attributes.get("name", "")))
            for data in segment.values():
                found = dict(data.attrs)
                signal = found.get("signal_name", found.get("name"))
                if signal is None or shape is None or micrometres(_calibration(found, "unit")) is None:
                    continue
                yield _Channel(f"{_text(signal)} ({direction})", data, found, shape, field)


def _nanosurf_grid(attributes: dict[str, Any]) -> tuple[tuple[int, int] | None, tuple[float, float]]:
    """Returns the samples (ny, nx) and the field along (x, y), um, by the names of either version."""
    if "rect_axis_size" in attributes and "rect_axis_range" in attributes:
        (ny, nx), (range_y, range_x) = attributes["rect_axis_size"], attributes["rect_axis_range"]
    elif "image_points_per_line" in attributes:
        nx, ny = attributes["image_points_per_line"], attributes["image_number_of_lines"]
        range_x, range_y = attributes["image_size_x"], attributes["image_size_y"]
    else:
        return None, (0.0, 0.0)
    return (int(ny), int(nx)), (1e6 * float(range_x), 1e6 * float(range_y))


def _calibration(attributes: dict[str, Any], what: str) -> str:
    """Returns the calibration's "min", "max" or "unit", by the names of either version."""
    value = attributes.get(f"signal_calibration_{what}", attributes.get(f"base_calibration_{what}", ""))
    return _text(value)


def _calibrated(chosen: _Channel) -> NDArray[np.float64]:
    """Returns the heights in the calibration's unit: codes from lowest to highest span its minimum to its maximum."""
    kind = chosen.attributes["dataset_element_type"]
    numbered = not isinstance(kind, str | bytes)
    kind = _NUMBERED_TYPES[int(kind)] if numbered else _text(kind)
    stored = chosen.data[:]
    heights = stored.astype(np.float64)
    low, high = 0.0, 1.0
    if kind != "double":
        limits = np.iinfo(kind)
        low, high = float(limits.min), float(limits.max)
        if not numbered:
            # from version 2 on, the lowest signed or the highest unsigned code marks a void
            void = limits.max if limits.min == 0 else limits.min
            low, high = (low, high - 1) if limits.min == 0 else (low + 1, high)
            heights[(stored == void) | (stored == chosen.data.fillvalue) & (chosen.data.fillvalue != 0)] = np.nan
    bottom, top = float(_calibration(chosen.attributes, "min")), float(_calibration(chosen.attributes, "max"))
    scaled: NDArray[np.float64] = bottom + (heights - low) * ((top - bottom) / (high - low))
    return scaled.reshape(chosen.shape)
