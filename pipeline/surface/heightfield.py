"""The height field h[j, i], the input of every diffraction algorithm in this project."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.extent import Extent

_ROUNDING = 1e-14


@dataclass(frozen=True)
class HeightField:
    """The heights of one patch.

    heights_um: float64 (ny, nx), um; x grows with the column, y **upwards** with the row.
    pitch_um: sample distance along (x, y), um.
    """

    heights_um: NDArray[np.float64]
    pitch_um: tuple[float, float]

    @property
    def nbytes(self) -> int:
        """Bytes of the heights."""
        return self.heights_um.nbytes

    @property
    def extent(self) -> Extent:
        """Samples, pitch and height range."""
        return Extent(self.shape, self.pitch_um, self.half_range_um)

    @property
    def shape(self) -> tuple[int, int]:
        """Samples as (ny, nx)."""
        ny, nx = self.heights_um.shape
        return ny, nx

    @property
    def size_um(self) -> tuple[float, float]:
        """Extent of the patch along (x, y), um; each sample covers one pitch."""
        ny, nx = self.shape
        return nx * self.pitch_um[0], ny * self.pitch_um[1]

    @property
    def band_limit_per_um(self) -> tuple[float, float]:
        """Nyquist limits along (x, y), 1/um: 1 / (2 pitch)."""
        return 0.5 / self.pitch_um[0], 0.5 / self.pitch_um[1]

    @property
    def half_range_um(self) -> float:
        """Half of the peak-to-valley height, um."""
        return 0.5 * float(self.heights_um.max() - self.heights_um.min())

    def coordinates_um(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Computes the sample positions x (nx,) and y (ny,), um, which are 0 at the middle sample n // 2."""
        ny, nx = self.shape
        x = (np.arange(nx) - nx // 2) * self.pitch_um[0]
        y = (np.arange(ny) - ny // 2) * self.pitch_um[1]
        return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)

    def centred(self) -> "HeightField":
        """Returns the field with the middle of its height range at 0, which changes no intensity.

        A field that is centred to the rounding of its range is returned itself.
        """
        h = self.heights_um
        low, high = float(h.min()), float(h.max())
        middle = 0.5 * (low + high)
        return self if abs(middle) <= _ROUNDING * (high - low) else HeightField(h - middle, self.pitch_um)
