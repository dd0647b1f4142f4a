"""A test case of the sweep: one surface, window and algorithm."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter

from pipeline.diffraction.dft_stack import Basis
from pipeline.surface.heightfield import HeightField

Algorithm = Literal["series", "device", "table"]
Precision = Literal["float32", "float64"]
Kind = Literal["flat", "spike", "steps", "hills", "noise"]

LAMBDA_MIN_NM, LAMBDA_MAX_NM = 380.0, 780.0
SEED = 1811


@dataclass(frozen=True)
class StressCase:
    """One surface and window, and the algorithm that computes its |P|^2.

    family: of the sweep. basis, precision: of the DFT stack. kind: of the surface. height_um: span of heights, 2 H.
    shape: samples (ny, nx). pitch_um: along (x, y). sigma_um: of the coherence window.
    """

    family: str
    algorithm: Algorithm
    basis: Basis
    precision: Precision
    kind: Kind
    height_um: float
    shape: tuple[int, int]
    pitch_um: tuple[float, float]
    sigma_um: float

    @property
    def samples(self) -> int:
        """Number of samples of the surface."""
        return self.shape[0] * self.shape[1]

    @property
    def id(self) -> str:
        """Dotted name, unique in the sweep."""
        pitch = "x".join(f"{1e3 * pitch:g}" for pitch in self.pitch_um)
        surface = f"{self.kind}.{1e3 * self.height_um:g}nm.{'x'.join(map(str, self.shape))}.{pitch}nm"
        family = self.family.replace(", ", "_")
        return f"{family}.{self.algorithm}.{self.basis}.{self.precision}.{surface}.{1e3 * self.sigma_um:g}nm"

    def __str__(self) -> str:
        """The case for people."""
        size, pitch = (" x ".join(map(str, pair)) for pair in (self.shape, self.pitch_um))
        return (
            f"{self.algorithm}, {self.basis} {self.precision}, {self.kind} of {self.height_um:g} um, "
            f"{size} samples of {pitch} um, sigma {self.sigma_um:g} um"
        )

    def field(self) -> HeightField:
        """Return the surface itself, the same every time."""
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
