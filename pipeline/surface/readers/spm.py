"""Reads the formats of microscopes and profilometers that SurfaceTopography supports."""

import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from math import isclose
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers import igor, nanoscope, nmm, olympus
from pipeline.surface.readers.common import (
    EXPORT,
    fault,
    library_version,
    micrometres,
    one_line,
    pick_channel,
    replaced,
    third_party,
    unique_names,
)
from pipeline.surface.readers.formats import BY_LIBRARY, LIBRARY
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

_LIBRARY = LIBRARY
# arrays lie as in .npy, and the library takes their first axis for x; it takes a line of Wyko's text for a row, which
# is a column of the image, from the bottom (Gwyddion's opdfile.c)
_TRANSPOSED = ("h5", "mat", "asc")
# whose first line has the lowest y: the tables of a nano measuring machine hold the Ly of each sample
_BOTTOM_FIRST = ("nmm",)
# modules that are not named as the format in capital letters
_MODULES = {
    "opdx": "OPDx",
    "asc": "Text",
    "metropro": "MetroPro",
    "poir": "OIR",
    "mitutoyo": "Mitutoyo",
    "mat": "Matlab",
}
# tifffile, which it uses, logs faults of damaged files, and logging prints to stderr where no handler is set
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def read(path: Path, key: str, channel: str | None) -> Scan:
    """Reads one height channel of a file in the format `key` of formats.BY_LIBRARY.

    Raises InputError where the file is damaged or has no such channel.
    """
    with third_party(path.name, f"{BY_LIBRARY[key]} data", _LIBRARY), _without_dates():
        channels = _channels(path, key)
        labels = igor.labels(path) if key == "ibw" else [_clean(c.name) for c in channels]
        maps = [(c, label) for c, label in zip(channels, labels, strict=True) if c.dim == 2]
        candidates: list[tuple[Any, str, float | None]]
        candidates = [(c, label, unit) for c, label in maps if (unit := _height_unit(c)) is not None]
        # arrays of HDF5 and MATLAB have no unit
        candidates = candidates or [(c, label, None) for c, label in maps if c.unit is None and c.data_unit is None]
        if channels and not maps:
            raise fault(path.name, "a 2-D height map", "line profiles only", "take an areal scan")
        plain = unique_names([label for _, label, _ in candidates])
        names = _names([c for c, _, _ in candidates], [label for _, label, _ in candidates])
        wanted = names[plain.index(channel)] if channel in plain else channel
        index = pick_channel(path.name, names, wanted)
        chosen, _, unit = candidates[index]
        make_room(path.name, chosen.nb_grid_pts[::-1])
        sizes = {} if chosen.physical_sizes is not None else {"physical_sizes": chosen.nb_grid_pts}
        stored = chosen.topography(**sizes).heights()
        heights = _heights(stored, key)
        if key == "nms":
            heights[_end_codes(heights, _notes(chosen))] = np.nan
        if key in olympus.KEYS:
            heights[olympus.not_measured(path, key, chosen)[::-1]] = np.nan
        steps = _steps(path, key, chosen)
        pitch = None if steps is None or unit is None else (steps[0] * unit, steps[1] * unit)
        form = ", ".join((BY_LIBRARY[key], *_direction(chosen)))
    reader = library_version(_LIBRARY)
    return Scan(
        heights,
        unit,
        pitch,
        None,
        names[index],
        tuple(names),
        form,
        reader,
        steps=steps if pitch is None else None,
    )


def _channels(path: Path, key: str) -> Sequence[Any]:
    """Lists the channels of a file. Where the library refuses a Nanoscope file, each image is tried alone."""
    from SurfaceTopography.Exceptions import CorruptFile, UnsupportedFormatFeature

    try:
        found: Sequence[Any] = _reader(key)(_source(path, key)).channels
    except CorruptFile:
        raise
    except UnsupportedFormatFeature as error:
        raise fault(path.name, f"{BY_LIBRARY[key]} data with an image", one_line(str(error)), EXPORT) from None
    except Exception:
        if key != "di":
            raise
        alone = [_alone(version) for version in nanoscope.one_image_each(path)]
        found = [channel for channels in alone for channel in channels]
        if not found:
            raise
    return found


def import_readers_alone() -> None:
    """Makes an import of one of the library's readers import nothing else of it, for a process that reads one file.

    The packages themselves import all readers, statistics and plots, with pandas and matplotlib, and NuMPI, of which
    sums are used, imports optimisers with scipy: two seconds of a processor where 0.3 s are enough.
    """
    found = find_spec(_LIBRARY)
    if found is None or not found.submodule_search_locations:
        return
    folder = Path(found.submodule_search_locations[0])
    for name, place in ((_LIBRARY, folder), (f"{_LIBRARY}.IO", folder / "IO")):
        package = ModuleType(name)
        package.__path__ = [str(place)]
        sys.modules[name] = package
    # the reader of Wyko's text imports its base class from the package
    package.__getattr__ = lambda name: getattr(import_module(f"{_LIBRARY}.IO.Reader"), name)  # type: ignore[method-assign]
    sys.modules["NuMPI.Optimization"] = ModuleType("NuMPI.Optimization")


def _reader(key: str) -> Callable[..., Any]:
    """Returns the library's reader of a format."""
    from SurfaceTopography.IO.Reader import ReaderBase

    module = import_module(f"{_LIBRARY}.IO.{_MODULES.get(key, key.upper())}")
    classes: list[Any] = [c for c in vars(module).values() if isinstance(c, type) and issubclass(c, ReaderBase)]
    found: Callable[..., Any] = next(c for c in classes if c.__module__ == module.__name__ and c.format() == key)
    return found


def _source(path: Path, key: str) -> str | Callable[[], BytesIO]:
    """Returns what the library opens.

    It knows .sdf by the name of the ISO, and not by the older one of the BCR. It reads the descriptions of a nano
    measuring machine in UTF-8 only.
    """
    if key == "sdf":
        data = path.read_bytes()
        data = data[:1] + b"ISO" + data[4:]
    elif key == "nmm":
        data = nmm.in_utf8(path)
    else:
        return str(path)
    return lambda: BytesIO(data)


def _alone(data: bytes) -> Sequence[Any]:
    try:
        found: Sequence[Any] = _reader("di")(lambda: BytesIO(data)).channels
    except Exception:
        return []
    return found


@contextmanager
def _without_dates() -> Iterator[None]:
    """Keeps the library from reading dates, which are not used here, and which fail in other languages."""
    import dateutil.parser
    from SurfaceTopography.IO import expr

    def no_date(*_arguments: object, **_keywords: object) -> datetime:
        return datetime(1970, 1, 1)

    functions = {**expr._FUNCTIONS, **dict.fromkeys(("parse_datetime", "make_datetime", "from_timestamp"), no_date)}
    with replaced(dateutil.parser, "parse", no_date), replaced(expr, "_FUNCTIONS", functions):
        yield


def _clean(name: object) -> str:
    """Cuts a channel's name at its NUL, behind which some programs leave bytes of longer names."""
    return str(name).split("\0")[0].strip()


def _names(channels: Sequence[Any], plain: Sequence[str]) -> list[str]:
    """Names the channels: of several with one name, those that are no trace of the main scan say what they are."""
    told = []
    for name, channel in zip(plain, channels, strict=True):
        words = [word for word in _direction(channel) if word != "trace"] if plain.count(name) > 1 else []
        told.append(" ".join([name, *words]))
    return unique_names(told)


def _direction(channel: Any) -> tuple[str, ...]:
    return nanoscope.direction(_notes(channel))


def _notes(channel: Any) -> dict[str, Any]:
    """Returns the channel's entries of the header; keys of Nanoscope files are in lower case."""
    notes = channel.info.get("raw_metadata", {})
    return notes if isinstance(notes, dict) else {}


def _height_unit(channel: Any) -> float | None:
    """Returns micrometres per unit of a channel's heights and lateral sizes; None for phases, voltages and profiles.

    The library converts heights and sizes to one unit where both are lengths; otherwise it gives a pair of units, or
    a separate unit of the values.
    """
    one_unit = isinstance(channel.unit, str) and isinstance(channel.data_unit, str)
    if channel.dim != 2 or not one_unit or micrometres(channel.data_unit) is None:
        return None
    return micrometres(channel.unit)


def _heights(stored: Any, key: str) -> NDArray[np.float64]:
    """Converts the library's array, whose first axis is x, to heights (ny, nx) with y upwards and NaN for holes.

    The library turns nearly every format so that heights().T is the image with the top row first. This was compared
    with the preview inside a Park file, and with Gwyddion's reading of fifteen other formats.
    """
    # it masks the samples that a format marks as not measured
    filled = np.ma.filled(np.ma.asarray(stored, dtype=np.float64), np.nan)
    if key not in _TRANSPOSED:
        filled = filled.T if key in _BOTTOM_FIRST else filled.T[::-1]
    return np.ascontiguousarray(filled)


def _end_codes(heights: NDArray[np.float64], header: dict[str, Any]) -> NDArray[np.bool_]:
    """Marks the samples of a NanoFocus file with its lowest or highest code.

    Its heights have 65534 steps in 65536 codes. No published layout says whether the lowest or the highest code marks
    voids; of the measured heights, only the extreme one has it.
    """
    codes = np.rint((heights - header["zmin"]) / (header["zmax"] - header["zmin"]) * 65534)
    return np.asarray((codes == 0) | (codes == 65535))


def _steps(path: Path, key: str, channel: Any) -> tuple[float, float] | None:
    """Computes the sample distance along (x, y) in the channel's unit: size of the field over number of samples."""
    if channel.physical_sizes is None:
        return None
    notes = _notes(channel)
    nx, ny = (int(n) for n in channel.nb_grid_pts)
    size_x, size_y = (float(size) for size in channel.physical_sizes)
    if key == "asc":
        return size_y / ny, size_x / nx
    size_x, size_y = _field(size_x, nx, notes.get("FastScanSize")), _field(size_y, ny, notes.get("SlowScanSize"))
    if key == "di":
        size_y = nanoscope.slow_size((size_x, size_y), (nx, ny), notes, nanoscope.scan_list(path))
    return size_x / nx, size_y / ny


def _field(size: float, n: int, scan_size: str | None) -> float:
    """Returns the size of the field of n samples, in the unit of `size`.

    Asylum scales its Igor waves so that the last sample lies at the scan size, a pitch of scan size / (n - 1), and
    the library multiplies this pitch by n. But samples are taken at a constant rate over the whole line: ScanSpeed
    over Sample Rate in the file's note is scan size / n. The field is therefore the scan size.
    """
    if scan_size is not None and isclose(size * (n - 1) / n, float(scan_size), rel_tol=1e-4):
        return float(scan_size)
    return float(size)
