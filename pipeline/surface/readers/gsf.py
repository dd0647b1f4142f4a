"""Reads Gwyddion's simple fields, .gsf: a text header, then float32 samples, the top row first."""

from pathlib import Path

import numpy as np

from pipeline.surface.readers.common import fault, library_version, micrometres, pick_channel
from pipeline.surface.readers.room import make_room
from pipeline.surface.scan import Scan

MAGIC = b"Gwyddion Simple Field 1.0\n"
_EXPECTED = "a Gwyddion .gsf file"
# a header has ten lines or so
_HEADER_BYTES = 1 << 16
_CUT = "the file may be damaged or cut short: copy or export it again"


def read(path: Path, channel: str | None) -> Scan:
    """Reads the field; NaN is a hole. Without a unit, the size of the field gives the ratio of x to y."""
    with path.open("rb") as file:
        data = file.read(_HEADER_BYTES)
    end = data.find(b"\0")
    if end < 0:
        raise fault(path.name, _EXPECTED, "no end of the header (a NUL byte)", _CUT)
    lines = data[len(MAGIC) : end].decode("utf-8", errors="replace").splitlines()
    header = {key.strip(): value.strip() for key, _, value in (line.partition("=") for line in lines)}
    try:
        nx, ny = int(header["XRes"]), int(header["YRes"])
        size = float(header.get("XReal", nx)), float(header.get("YReal", ny))
    except (KeyError, ValueError) as error:
        raise fault(path.name, _EXPECTED, f"a header without a valid entry ({error})", _CUT) from None
    make_room(path.name, (ny, nx))
    # one to four NUL bytes end the header at a multiple of four
    start = end + 4 - end % 4
    present = path.stat().st_size - start
    if present < 4 * nx * ny:
        raise fault(path.name, _EXPECTED, f"{present} bytes for {ny} x {nx} samples of four", _CUT)
    samples = np.memmap(path, "<f4", "r", start, (ny, nx))
    unit = header.get("ZUnits", "")
    if unit and micrometres(unit) is None:
        raise fault(path.name, "heights in a unit of length", f"values in {unit!r}", "export the height channel")
    lateral = micrometres(header.get("XYUnits", ""))
    steps = size[0] / nx, size[1] / ny
    name = header.get("Title") or "data"
    pick_channel(path.name, [name], channel, sole=True)
    return Scan(
        np.ascontiguousarray(samples[::-1], dtype=np.float64),
        micrometres(unit),
        None if lateral is None else (steps[0] * lateral, steps[1] * lateral),
        None,
        name,
        (name,),
        "Gwyddion .gsf",
        library_version("numpy"),
        steps=steps if lateral is None else None,
    )
