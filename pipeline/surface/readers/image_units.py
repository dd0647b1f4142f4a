"""Units that programs write into images: Gwyddion into PNG, ImageJ into TIFF."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.surface.readers import tiff
from pipeline.surface.readers.common import fault, micrometres


@dataclass(frozen=True)
class Units:
    """What an image states: the pitch along (x, y), um, and micrometres per code; None where it does not."""

    pitch_um: tuple[float, float] | None = None
    um_per_code: float | None = None


def of_png(file: str, texts: Mapping[Any, Any], shape: tuple[int, int], full_code: float | None) -> Units:
    """Reads Gwyddion's texts: the size of the field, and the heights of code 0 and of the largest code.

    file: name, for messages. texts: by key. shape: (ny, nx). full_code: the largest code.
    Raises InputError where the values are no lengths.
    """
    found = {str(key).removeprefix("Gwy::"): str(text) for key, text in texts.items() if str(key).startswith("Gwy::")}
    numbers = {key: number for key, text in found.items() if (number := _number(text)) is not None}
    unit, lateral = micrometres(found.get("ZUnit", "")), micrometres(found.get("XYUnit", ""))
    if found.get("ZUnit") and unit is None:
        raise fault(file, "heights in a unit of length", f"values in {found['ZUnit']!r}", "export the height channel")
    ny, nx = shape
    size, ends = (numbers.get("XReal"), numbers.get("YReal")), (numbers.get("ZMin"), numbers.get("ZMax"))
    pitch, per_code = None, None
    if lateral is not None and size[0] is not None and size[1] is not None and min(size[0], size[1]) > 0:
        pitch = size[0] * lateral / nx, size[1] * lateral / ny
    if unit is not None and full_code is not None and ends[0] is not None and ends[1] is not None:
        per_code = (ends[1] - ends[0]) * unit / full_code
    return Units(pitch, per_code if per_code is not None and per_code > 0 else None)


def of_tiff(tags: tiff.Tags) -> Units:
    """Reads ImageJ's description: the unit of the resolution, and a straight line from codes to heights.

    Centimetres and inches are units of print, which programs write into any image.
    """
    description = tags.get(tiff.DESCRIPTION, ())
    if not isinstance(description, str) or not description.startswith("ImageJ="):
        return Units()
    entries = dict(line.split("=", 1) for line in description.splitlines() if "=" in line)
    # ImageJ escapes the micro sign, and knows the micron
    unit = entries.get("unit", "").replace("\\u00B5", "u").replace("microns", "um").replace("micron", "um")
    scale = None if unit in ("cm", "inch") else micrometres(unit)
    x, y = tiff.number(tags, tiff.X_RESOLUTION), tiff.number(tags, tiff.Y_RESOLUTION)
    pitch = (scale / x, scale / y) if scale is not None and x and y and min(x, y) > 0 else None
    slope, heights = _number(entries.get("c1", "")), micrometres(entries.get("vunit", ""))
    if entries.get("cf") != "0" or slope is None or heights is None or slope <= 0:
        return Units(pitch)
    return Units(pitch, slope * heights)


def _number(text: str) -> float | None:
    try:
        found = float(text)
    except ValueError:
        return None
    return found if abs(found) < float("inf") else None
