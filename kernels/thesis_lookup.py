"""Host side of thesis_lookup.cl: |P|^2 from the min/max-normalised DFT terms of [S14]; layouts as stated there."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from kernels import device

Weight = Literal["gaussian", "sinc"]
_LANES = 8  # doubles in one vector of the kernel
_TAPS_BOUND = 17  # coefficients along an axis; more takes a program of its own, for four times as many
_TILE = 2**18  # pairs in one launch: bounds memory
_GRID = np.dtype(
    [
        ("df", np.float64, 2),
        ("sigma", np.float64, 2),
        ("columns", np.int32),
        ("row_zero", np.int32),
        ("column_zero", np.int32),
        ("padding", np.int32),
    ]
)


@dataclass(frozen=True)
class DeviceTerms:
    """DFT terms on the device, padded to `blocks` whole vectors, and the `reach` (x, y) of a neighbourhood."""

    buffer: Any
    extrema: Any
    grid: np.ndarray
    blocks: int
    reach: tuple[int, int]


def upload_terms(
    normalised: np.ndarray,
    least: np.ndarray,
    span: np.ndarray,
    zero: tuple[int, int],
    spacing_per_um: tuple[float, float],
    reach: tuple[int, int],
    sigma_f_per_um: float,
) -> DeviceTerms:
    """Pads the terms to whole vectors and copies them to the device.

    `normalised` float32 (rows, columns, 2, terms), `least` and `span` (2, terms), `zero` (row, column) of f = 0,
    `reach` coefficients (x, y) on either side of the anchor.
    """
    rows, columns, _, terms = normalised.shape
    blocks = -(-terms // _LANES)
    padded = device.empty((rows, columns, 2, blocks * _LANES), np.float32)
    padded[..., :terms], padded[..., terms:] = normalised, 0.0
    extrema = np.zeros((2, 2, blocks * _LANES))
    extrema[0, :, :terms], extrema[1, :, :terms] = least, span
    sigma = [sigma_f_per_um / d for d in spacing_per_um]
    grid = np.array([(spacing_per_um, sigma, columns, *zero, 0)], dtype=_GRID)
    return DeviceTerms(device.shared(padded), device.upload(extrema), grid, blocks, reach)


def power(terms: DeviceTerms, weight: Weight, fx: np.ndarray, fy: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """|P|^2 (pairs,) at frequencies `fx`, `fy` (1/um) and k w H = `phase` (radians), all (pairs,).

    Every neighbourhood must lie within the terms uploaded.
    """
    constants = {"BLOCKS": terms.blocks, "MOST_TAPS": device.bound(2 * max(terms.reach) + 1, _TAPS_BOUND)}
    program = device.program(("thesis_lookup.cl",), constants)
    reach = [np.int32(n) for n in terms.reach]
    out = np.empty(len(phase))
    pairs = np.zeros((min(_TILE, len(phase)), 4))
    for first in range(0, len(phase), _TILE):
        tile = slice(first, min(first + _TILE, len(phase)))
        count = tile.stop - first
        for column, values in enumerate((fx, fy, phase)):
            pairs[:count, column] = values[tile]
        given, result = device.upload(pairs[:count]), device.result_buffer(8 * count)
        program.launch(f"{weight}_power", (count,), terms.buffer, terms.extrema, terms.grid, *reach, given, result)
        device.download(result, out[tile])
    return out
