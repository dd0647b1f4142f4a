"""Reads Nanosurf's .nid and .ezd files: sections of key=value, then the samples of every data set."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers.common import (
    fault,
    library_version,
    micrometres,
    pick_channel,
    unique_names,
)
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

_DATA = b"#!"
_EXPECTED = "a Nanosurf .nid file"
_CUT = "the file may be damaged or cut short: copy or export it again"


@dataclass(frozen=True)
class _DataSet:
    """One data set: the entries of its section and the place of its samples in the file."""

    entries: Mapping[str, str]
    start: int

    @property
    def shape(self) -> tuple[int, int]:
        return int(self.entries["Lines"]), int(self.entries["Points"])

    @property
    def sample(self) -> np.dtype:
        order = "<" if self.entries.get("SaveOrder", "Intel") == "Intel" else ">"
        kind = "i" if self.entries.get("SaveSign", "Signed") == "Signed" else "u"
        return np.dtype(f"{order}{kind}{int(self.entries['SaveBits']) // 8}")

    @property
    def nbytes(self) -> int:
        rows, columns = self.shape
        return rows * columns * self.sample.itemsize

    @property
    def name(self) -> str:
        return f"{self.entries.get('Frame', '')} ({self.entries.get('Dim2Name', '')})".strip()

    @property
    def is_height_map(self) -> bool:
        """Whether all three axes are lengths; curves of force have other units along x."""
        return all(micrometres(self.entries.get(f"Dim{i}Unit", "")) is not None for i in range(3))


def read(path: Path, channel: str | None) -> Scan:
    """Reads one image of heights; the file has its bottom line first.

    Data sets in other units, such as curves of force, and everything that is no image are skipped; a date is not
    needed. Lines beyond the file's current line were not scanned, and become holes where they hold one value.
    """
    data = path.read_bytes()
    sets = [found for found in _data_sets(path, data) if found.is_height_map]
    names = unique_names([found.name for found in sets])
    chosen = sets[index := pick_channel(path.name, names, channel)]
    make_room(path.name, chosen.shape)
    rows, columns = chosen.shape
    if chosen.start + chosen.nbytes > len(data):
        found = f"{len(data)} bytes where {chosen.name!r} ends at byte {chosen.start + chosen.nbytes}"
        raise fault(path.name, _EXPECTED, found, _CUT)
    codes = np.frombuffer(data, chosen.sample, rows * columns, chosen.start).reshape(rows, columns)
    entries = chosen.entries
    with _valid_entries(path):
        span, low = float(entries["Dim2Range"]), float(entries.get("Dim2Min", 0))
        px, py = (
            float(entries[f"Dim{axis}Range"]) * (micrometres(entries[f"Dim{axis}Unit"]) or 0.0) / n
            for axis, n in ((0, columns), (1, rows))
        )
    middle = low + span / 2 if chosen.sample.kind == "i" else low
    heights = middle + codes * (span / 2.0 ** (8 * chosen.sample.itemsize))
    heights[_unscanned(entries, codes)] = np.nan
    unit = micrometres(entries["Dim2Unit"])
    reader = library_version("numpy")
    return Scan(heights, unit, (px, py), None, names[index], tuple(names), "Nanosurf .nid/.ezd", reader)


@contextmanager
def _valid_entries(path: Path) -> Iterator[None]:
    """Turns the error of an entry that is absent or no number into an InputError."""
    try:
        yield
    except (KeyError, ValueError, TypeError) as error:
        raise fault(path.name, _EXPECTED, f"a header without a valid entry ({error})", _CUT) from None


def _data_sets(path: Path, data: bytes) -> list[_DataSet]:
    """Lists the data sets in the order of their samples."""
    sections, start = _sections(path, data)
    content = sections.get("DataSet", {})
    found = []
    with _valid_entries(path):
        # no more sets than entries, whatever the counts say
        for group in range(min(int(content["GroupCount"]), len(content))):
            for number in range(min(int(content[f"Gr{group}-Count"]), len(content))):
                entries = sections.get(content.get(f"Gr{group}-Ch{number}", ""))
                if entries is None:
                    continue
                data_set = _DataSet(entries, start)
                if entries.get("SaveMode", "Binary") != "Binary":
                    mode = f"data set {data_set.name!r} saved as {entries['SaveMode']!r}"
                    raise fault(path.name, "binary data sets", mode, "export the height channel again")
                found.append(data_set)
                start += data_set.nbytes
    return found


def _sections(path: Path, data: bytes) -> tuple[dict[str, dict[str, str]], int]:
    """Returns the header's sections and the place of the first sample."""
    # the marker is the only line that begins with it
    end = data.find(b"\n" + _DATA)
    if end < 0:
        raise fault(path.name, _EXPECTED, "a header without the samples behind it", _CUT)
    sections: dict[str, dict[str, str]] = {}
    entries: dict[str, str] = {}
    for line in data[:end].decode("latin-1").splitlines():
        stripped = line.strip()
        if stripped.startswith("[") and stripped.endswith("]"):
            entries = sections.setdefault(stripped[1:-1], {})
        elif "=" in stripped:
            key, value = stripped.split("=", 1)
            entries[key] = value.strip()
    return sections, end + 1 + len(_DATA)


def _unscanned(entries: Mapping[str, str], codes: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Marks the lines beyond the current line, at the end of the file's lines or at their start."""
    lines = codes.shape[0]
    marked = np.zeros(lines, dtype=bool)
    current = entries.get("CurLine", "")
    if not current.isdecimal() or int(current) >= lines - 1:
        return marked
    missing = lines - 1 - int(current)
    constant = (codes == codes[:, :1]).all(axis=1)
    if constant[-missing:].all():
        marked[-missing:] = True
    elif constant[:missing].all():
        marked[:missing] = True
    return marked
