"""What a reader takes out of a scan file, before any of it is trusted."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Scan:
    """One channel of a scan file, as stored.

    heights: float64 (ny, nx), y **up** (row 0 is the bottom), NaN where the file marks a hole.
    um_per_unit: micrometres per unit of `heights`; None where the file does not say.
    pitch_um: sample distance along (x, y), um; None where the file does not say.
    full_code: for images, the largest storable code (255, 65535); None elsewhere.
    channel: the name of this channel; channels: the names of all height-like channels in the file.
    format: the format in words; reader: the library and version that read it.
    """

    heights: NDArray[np.float64]
    um_per_unit: float | None
    pitch_um: tuple[float, float] | None
    full_code: float | None
    channel: str
    channels: tuple[str, ...]
    format: str
    reader: str
