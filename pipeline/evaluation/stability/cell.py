"""A cell of the sweep: one surface, window and way."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter

from pipeline.diffraction.dft_stack import Basis
from pipeline.surface.heightfield import HeightField

Way = Literal["series", "device", "table"]
Precision = Literal["float32", "float64"]
Kind = Literal["flat", "spike", "steps", "hills", "noise"]

LAMBDA_MIN_NM, LAMBDA_MAX_NM = 380.0, 780.0
SEED = 1811


@dataclass(frozen=True)
class Cell:
    """One surface, window and way. `height_um` is the span of heights, 2 H; `shape` is (ny, nx)."""

    family: str
    way: Way
    basis: Basis
    precision: Precision
    kind: Kind
    height_um: float
    shape: tuple[int, int]
    pitch_um: tuple[float, float]
    sigma_um: float

    def field(self) -> HeightField:
        """The surface itself, the same every time."""
        rng = np.random.default_rng(SEED)
        if self.kind == "flat":
            return HeightField(np.full(self.shape, self.height_um), self.pitch_um)
        if self.kind == "spike":
            relief = np.zeros(self.shape)
            # under the window's peak
            relief[self.shape[0] // 2, self.shape[1] // 2] = 1.0
        elif self.kind == "steps":
            # every |t| = 1: no power of t is small, and all T_n reach their bound
            relief = rng.integers(0, 2, self.shape).astype(float)
        else:
            relief = rng.random(self.shape)
            if self.kind == "hills":
                relief = gaussian_filter(relief, 4.0, mode="wrap")
        return HeightField(self.height_um * (relief - relief.min()) / np.ptp(relief), self.pitch_um)
