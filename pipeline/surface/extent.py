"""The extent of a height field, which is known before its heights are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Extent:
    """The size of a height field.

    shape: samples (ny, nx). pitch_um: their distance along (x, y), um.
    half_range_um: half of the height range, um; an upper limit where only the parameters of a recipe are known.
    """

    shape: tuple[int, int]
    pitch_um: tuple[float, float]
    half_range_um: float

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.shape[0] * self.shape[1]

    @property
    def bytes(self) -> int:
        """Bytes of the heights in float64."""
        return 8 * self.samples

    @property
    def size_um(self) -> tuple[float, float]:
        """Extent of the patch along (x, y), um."""
        return self.shape[1] * self.pitch_um[0], self.shape[0] * self.pitch_um[1]
