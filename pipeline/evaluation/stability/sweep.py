"""A test case, and the families of cases: heights, pitches, sizes, shapes, windows, surfaces, tables."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
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


_BASE = StressCase("", "device", "chebyshev", "float32", "noise", 0.5, (128, 128), (0.1, 0.1), 3.2)
SERIES: tuple[tuple[Basis, Precision], ...] = (
    ("taylor", "float32"),
    ("taylor", "float64"),
    ("chebyshev", "float32"),
    ("chebyshev", "float64"),
)
# where Taylor's series in float64 has failed, and where Chebyshev's in float32 holds
TAYLOR_FAILS_UM, TALLEST_UM = 2.0, 10.0
_SERIES_HEIGHTS_UM = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0, 7.0, 10.0)
# heights that Taylor tables of 1e-4 take, and one that they must refuse
_TAYLOR_HEIGHTS_UM = (1e-3, 0.1, 0.3, 0.5, 2.0)
# samples (ny, nx) and pitches of patches that are not square
_OBLONG = (
    ((65, 33), (0.1, 0.2)),
    ((64, 256), (0.1, 0.1)),
    ((200, 72), (0.05, 0.13)),
    ((128, 128), (0.02, 0.2)),
)
_KINDS: tuple[Kind, ...] = ("flat", "spike", "steps", "hills", "noise")


def cases(quick: bool = False) -> list[StressCase]:
    """Return the sweep, or a part of it that takes seconds."""
    return [*_by_height(quick), *_by_geometry(quick), *_by_table(quick)]


def tall() -> list[StressCase]:
    """Return the cases that `verdict.criterion` reads."""
    return [case for case in _by_height(quick=True) if case.height_um in (TAYLOR_FAILS_UM, TALLEST_UM)]


def _by_height(quick: bool) -> Iterator[StressCase]:
    heights = (1e-3, 0.1, 0.5, 2.0, 10.0) if quick else _SERIES_HEIGHTS_UM
    for height in heights:
        for basis, precision in SERIES:
            yield replace(
                _BASE, family="height, series", algorithm="series", basis=basis, precision=precision, height_um=height
            )
    for height in (1e-3, 0.5, 10.0) if quick else (1e-3, 0.03, 0.5, 2.0, 5.0, 10.0):
        yield from _on_device(replace(_BASE, family="height", height_um=height), with_taylor=False)
    for height in _TAYLOR_HEIGHTS_UM:
        yield replace(_BASE, family="height, I_p", basis="taylor", height_um=height)


def _on_device(case: StressCase, with_taylor: bool = True) -> Iterator[StressCase]:
    """A case by every algorithm that stages run; the paper's tables at a height that they take."""
    yield replace(case, precision="float32")
    yield replace(case, precision="float64")
    if with_taylor:
        yield replace(case, basis="taylor", height_um=min(case.height_um, 0.1))


def _by_geometry(quick: bool) -> Iterator[StressCase]:
    for pitch in (0.005, 0.2) if quick else (0.005, 0.01, 0.02, 0.05, 0.2):
        sigma = 0.25 * _BASE.shape[1] * pitch
        yield from _on_device(replace(_BASE, family="pitch", pitch_um=(pitch, pitch), sigma_um=sigma))
    for n in (64, 512) if quick else (64, 256, 1024, 4096):
        square = replace(_BASE, family="size", shape=(n, n), pitch_um=(0.02, 0.02), sigma_um=0.005 * n)
        yield from _on_device(square, n <= 1024)
    for shape, pitches in _OBLONG[:1] if quick else _OBLONG:
        yield from _on_device(replace(_BASE, family="shape", shape=shape, pitch_um=pitches, sigma_um=1.5))
    # from one pixel, which must be refused, over two to twice the patch's width
    for sigma in (0.1, 0.2, 12.8) if quick else (0.1, 0.2, 0.4, 6.4, 12.8, 25.6):
        yield from _on_device(replace(_BASE, family="window", sigma_um=sigma))
    for kind in _KINDS[:3] if quick else _KINDS:
        for height in (10.0,) if quick else (0.1, 2.0, 10.0):
            yield from _on_device(replace(_BASE, family="surface", kind=kind, height_um=height), height == 0.1)


def _by_table(quick: bool) -> Iterator[StressCase]:
    base = replace(_BASE, family="table", algorithm="table", shape=(64, 64), height_um=0.3, sigma_um=1.6)
    yield base
    if quick:
        return
    yield replace(base, kind="flat")
    yield replace(base, kind="spike", height_um=1.0)
    yield replace(base, kind="steps", height_um=1e-3)
    yield replace(base, kind="hills", height_um=2.0)
    # the spectral integral has more wavelengths to follow than radii
    yield replace(base, kind="hills", height_um=6.0)
    yield replace(base, shape=(128, 96), pitch_um=(0.05, 0.1))
    yield replace(base, shape=(128, 128), pitch_um=(0.2, 0.2), sigma_um=6.4)
    yield replace(base, sigma_um=0.8)
    yield replace(base, sigma_um=6.4)
