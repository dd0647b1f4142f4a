"""Understands the header of the .csv files that Keyence's microscopes (VK) export, in English and German.

Its lines are quoted cells: a key, its value, and for the pitch its unit; the channel's name alone ends them.
The keys are those of a published converter to ISO 25178-71 (Kcsv2Bcr).
"""

import re
from collections.abc import Sequence

from pipeline.surface.readers.common import EXPORT, fault

_PITCH = ("xy calibration", "xy-justierung")
_WORDS = {
    "horizontal": "Columns",
    "horizont.": "Columns",
    "vertical": "Rows",
    "vertikal": "Rows",
    "unit": "Value units",
    "einheit": "Value units",
    "output image data": "Channel",
    "bilddatenausg.": "Channel",
}
_NO_HEIGHTS = re.compile(r"laser|optic|light|colou?r|intens|farb", re.IGNORECASE)
# the header has some 20 lines
_MOST_LINES = 60


def translated(file: str, lines: Sequence[str]) -> list[str]:
    """Writes a Keyence header as `key: value` lines; the lines of other files are returned as they are.

    Lines keep their numbers: those that state neither unit nor size become empty. Raises InputError where the file
    holds another quantity than heights.
    """
    rows = [[cell.strip().strip('"').strip() for cell in re.split("[,;\t]", line)] for line in lines[:_MOST_LINES]]
    keys = [cells[0].casefold() for cells in rows]
    if not any(key in _PITCH for key in keys):
        return list(lines)
    start = next((i for i, cells in enumerate(rows) if _is_number(cells[0])), len(rows))
    found = [""] * start
    for i, (key, cells) in enumerate(zip(keys[:start], rows[:start], strict=True)):
        if key in _PITCH and len(cells) > 2:
            # a decimal comma may have been split, too
            found[i] = f"Pixel size: {'.'.join(cells[1:-1])} {cells[-1]}"
        elif key in _WORDS and len(cells) > 1:
            found[i] = f"{_WORDS[key]}: {cells[1]}"
        if found[i].startswith("Channel") and _NO_HEIGHTS.search(cells[1]):
            raise fault(file, "heights in a Keyence .csv", f"{cells[1]!r}", EXPORT)
    return [*found, *lines[start:]]


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"[-+]?\d[\d.]*(?:[eE][-+]?\d+)?", cell) is not None
