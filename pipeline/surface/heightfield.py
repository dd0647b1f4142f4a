"""The height field h[j, i], the one input of all diffraction in this project."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class HeightField:
    """Heights of one patch, in micrometres.

    heights_um: float64 (ny, nx); x grows with the column, y **up** with the row index.
    pitch_um: sample distance along (x, y), um.
    """

    heights_um: NDArray[np.float64]
    pitch_um: tuple[float, float]

    @property
    def nbytes(self) -> int:
        """Bytes of the heights."""
        return self.heights_um.nbytes

    @property
    def shape(self) -> tuple[int, int]:
        """Samples as (ny, nx)."""
        ny, nx = self.heights_um.shape
        return ny, nx

    @property
    def size_um(self) -> tuple[float, float]:
        """Extent of the patch along (x, y), um: every sample owns one pitch."""
        ny, nx = self.shape
        return nx * self.pitch_um[0], ny * self.pitch_um[1]

    @property
    def band_limit_per_um(self) -> tuple[float, float]:
        """Highest frequency the samples can carry along (x, y), 1/um: 1 / (2 pitch)."""
        return 0.5 / self.pitch_um[0], 0.5 / self.pitch_um[1]

    @property
    def half_range_um(self) -> float:
        """H with |h - mid-range| <= H, um."""
        return 0.5 * float(self.heights_um.max() - self.heights_um.min())

    def coordinates_um(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sample positions (x[nx], y[ny]), um, zero at the middle sample n // 2."""
        ny, nx = self.shape
        x = (np.arange(nx) - nx // 2) * self.pitch_um[0]
        y = (np.arange(ny) - ny // 2) * self.pitch_um[1]
        return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)

    def centred(self) -> "HeightField":
        """The same surface with mid-range at zero, which changes no intensity."""
        h = self.heights_um
        return HeightField(h - 0.5 * (float(h.max()) + float(h.min())), self.pitch_um)
