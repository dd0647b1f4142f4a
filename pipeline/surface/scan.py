"""One channel of a scan file, as a reader returns it: values and units are not yet checked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Scan:
    """One channel of a scan file, as stored.

    heights: float64 (ny, nx), y **upwards** (row 0 is the bottom), NaN where the file marks a hole.
    um_per_unit: micrometres per unit of `heights`; None where the file does not state it.
    pitch_um: sample distance along (x, y), um; None where the file does not state it.
    full_code: the largest code that an image can store (255, 65535); None for other formats.
    channel: the name of this channel. channels: the names of all channels that may hold heights.
    format: the format in words. reader: the library that read it, with its version.
    mask: bool (ny, nx), true where a mask of the file covers the channel; None where it has none.
    steps: sample distance along (x, y) in a unit that the file does not state; only its ratio can be checked.
    unread: lines of a header with numbers or units that were not understood. warnings: sentences for the user.
    """

    heights: NDArray[np.float64]
    um_per_unit: float | None
    pitch_um: tuple[float, float] | None
    full_code: float | None
    channel: str
    channels: tuple[str, ...]
    format: str
    reader: str
    mask: NDArray[np.bool_] | None = None
    steps: tuple[float, float] | None = None
    unread: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
