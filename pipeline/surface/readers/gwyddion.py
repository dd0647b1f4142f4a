"""Reads Gwyddion's .gwy files, by gwyfile."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import (
    check_shape,
    library_version,
    micrometres,
    pick_channel,
    third_party,
    unique_names,
)
from pipeline.surface.scan import Scan

_DATA_KEY = re.compile(r"/(\d+)/data")


@dataclass(frozen=True)
class _Field:
    """One data field: its name, gwyfile's object and its mask's, and micrometres per unit of its values."""

    name: str
    data: Any
    um_per_unit: float | None
    mask: Any


def read(path: Path, channel: str | None) -> Scan:
    """Reads one data field and flips it, because Gwyddion stores the top row first.

    Empty units become None. The mask is returned beside the heights: it marks grains as often as bad data.
    """
    with third_party(path.name, "a Gwyddion .gwy file", "gwyfile"):
        import gwyfile

        fields = _height_fields(gwyfile.load(str(path)))
        names = unique_names([field.name for field in fields])
        index = pick_channel(path.name, names, channel)
        heights = _heights(path, fields[index].data)
        pitch, steps = _pitch(fields[index].data)
        mask = _mask(heights, fields[index].mask)
    return Scan(
        heights,
        fields[index].um_per_unit,
        pitch,
        None,
        names[index],
        tuple(names),
        "Gwyddion .gwy",
        library_version("gwyfile"),
        mask=mask,
        steps=steps,
    )


def _height_fields(container: Any) -> list[_Field]:
    """Lists the fields in a unit of length, or where there is none those without a unit, by their numbers.

    A field over another quantity than length, such as a spectrum over frequency, is no height map.
    """
    numbers = sorted(int(match[1]) for key in container if (match := _DATA_KEY.fullmatch(key)))
    fields = []
    for number in numbers:
        data = container[f"/{number}/data"]
        unit = _unit(data, "si_unit_z")
        lateral = _unit(data, "si_unit_xy")
        if all(text == "" or micrometres(text) is not None for text in (unit, lateral)):
            name = str(container.get(f"/{number}/data/title") or f"channel {number}")
            fields.append(_Field(name, data, micrometres(unit), container.get(f"/{number}/mask")))
    return [field for field in fields if field.um_per_unit is not None] or fields


def _unit(data: Any, key: str) -> str:
    unit = data.get(key)
    return "" if unit is None else str(unit.get("unitstr", ""))


def _heights(path: Path, data: Any) -> NDArray[np.float64]:
    check_shape(path.name, (int(data["yres"]), int(data["xres"])))
    return np.array(data.data[::-1], dtype=np.float64, order="C")


def _mask(heights: NDArray[np.float64], mask: Any) -> NDArray[np.bool_] | None:
    covered = None if mask is None else np.ascontiguousarray(mask.data[::-1] > 0.5)
    return covered if covered is not None and covered.shape == heights.shape else None


def _pitch(data: Any) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Returns the pitch along (x, y), um, or else the steps in a unit that the file does not state."""
    steps = float(data.xreal) / int(data["xres"]), float(data.yreal) / int(data["yres"])
    scale = micrometres(_unit(data, "si_unit_xy"))
    return (None, steps) if scale is None else ((steps[0] * scale, steps[1] * scale), None)
