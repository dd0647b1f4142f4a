"""Host side of the diffraction kernels: arrays in, arrays out; layouts as stated in opencl/*.cl."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from kernels import device, programs

LANES = 8  # doubles in one vector of the kernels
_VECTOR_BYTES = 64  # a double8 or a float16
_TILE = 4096  # nodes in one launch: bounds memory and paces progress
_WAVELENGTHS = 4  # that a work-item of the power spectrum takes at once
_ITEMS_A_UNIT = 64  # work-items of the power spectrum for each compute unit: even shares, and little scratch
_GRID = np.dtype(
    [
        ("dfx", np.float64),
        ("dfy", np.float64),
        ("inverse_2_variance", np.float64),
        ("columns", np.int32),
        ("row_zero", np.int32),
        ("column_zero", np.int32),
        ("padding", np.int32),
    ]
)


@dataclass(frozen=True)
class DeviceStack:
    """A DFT stack on the device, its terms padded to `blocks` whole vectors; else as diffraction.dft_stack has it.

    shape: its rows and columns.
    """

    buffer: Any
    decay: Any
    grid: np.ndarray
    terms: int
    blocks: int
    reach: tuple[int, int]
    half_range_um: float
    band_per_um: tuple[float, float]
    shape: tuple[int, int]


def upload_stack(
    coefficients: np.ndarray,
    zero: tuple[int, int],
    spacing_per_um: tuple[float, float],
    reach: tuple[int, int],
    sigma_f_per_um: float,
    half_range_um: float,
    band_per_um: tuple[float, float],
) -> DeviceStack:
    """Pads the terms to whole vectors and copies the stack to the device. `zero` is (row, column) of f = 0.

    A float32 stack stays float32, and where its terms fill whole vectors it is shared with the device, not copied.
    """
    if 2 * max(reach) + 1 > programs.MOST_TAPS:
        raise ValueError(f"a window of {2 * max(reach) + 1} coefficients: kernels hold {programs.MOST_TAPS} at most")
    rows, columns, _, terms = coefficients.shape
    lanes = _VECTOR_BYTES // coefficients.itemsize
    blocks = -(-terms // lanes)
    inverse = 0.5 / sigma_f_per_um**2
    grid = np.array([(*spacing_per_um, inverse, columns, *zero, 0)], dtype=_GRID)
    offsets = [np.arange(-r, r + 1) * d for r, d in zip(reach, spacing_per_um, strict=True)]
    decay = np.exp(-(np.concatenate(offsets) ** 2) * inverse).astype(coefficients.dtype)
    if terms == blocks * lanes:
        buffer = device.lent(coefficients)
    else:
        padded = device.empty((rows, columns, 2, blocks * lanes), coefficients.dtype)
        padded[..., :terms], padded[..., terms:] = coefficients, 0.0
        buffer = device.shared(padded)
    shape = rows, columns
    return DeviceStack(buffer, device.upload(decay), grid, terms, blocks, reach, half_range_um, band_per_um, shape)


def taylor_table(
    stack: DeviceStack, uv: np.ndarray, lambda_um: np.ndarray, weights: np.ndarray
) -> Iterator[tuple[slice, np.ndarray]]:
    """I_p at nodes, tile by tile: which nodes, and their values in float64 (nodes of the tile, 3, 2 N + 1).

    `uv` (nodes, 2), `lambda_um` (L,), `weights` (L, 3). Every u must be >= 0: the stack holds that half plane and
    I_p(-u, -v) = (-1)^p I_p(u, v).
    """
    powers, width = 2 * stack.terms - 1, 2 * LANES * stack.blocks
    constants = {"BLOCKS": stack.blocks, "MOST_TAPS": programs.MOST_TAPS}
    program = device.program(("taylor_table.cl",), constants)
    series = _taylor_series(lambda_um, stack)
    nodes, *spectrum = (device.upload(a) for a in (uv, lambda_um, series, fourth_column(weights)))
    tile = np.empty((_TILE, 3, width))
    result = device.result_buffer(tile.nbytes)
    for first in range(0, len(uv), _TILE):
        count = min(_TILE, len(uv) - first)
        program.launch(
            "taylor_table",
            (count,),
            stack.buffer,
            stack.decay,
            stack.grid,
            *(np.int32(n) for n in (stack.terms, *stack.reach)),
            nodes,
            np.int32(first),
            *spectrum,
            np.int32(len(lambda_um)),
            *(np.float64(f) for f in stack.band_per_um),
            result,
        )
        yield slice(first, first + count), device.download(result, tile)[:count, :, :powers]


def line_order(uvw: np.ndarray) -> np.ndarray:
    """Indices (directions,) that sort directions into lines of one v, u ascending, for `exact_power`.

    `uvw` (directions, 3). Those with u < 0 are placed as (-u, -v), whose frequency serves them.
    """
    u, v = (_turn(uvw)[:, None] * uvw[:, :2]).T
    return np.lexsort((u, v))


def _turn(uvw: np.ndarray) -> np.ndarray:
    """-1 where u < 0, else 1, (directions,): the stack holds the half plane u >= 0."""
    return np.where(uvw[:, 0] < 0.0, -1.0, 1.0)


def _lines(uvw: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions `uvw` (directions, 3) in lines: where each begins, the directions in order, where each came from.

    As exact_power.cl's `first`, `directions` and `place`.
    """
    order, turn = line_order(uvw), _turn(uvw)[:, None]
    directions = np.concatenate([turn * uvw[:, :2], uvw[:, 2:], turn], axis=1)[order]
    begins = np.flatnonzero(np.diff(directions[:, 1], prepend=np.nan))
    return np.append(begins, len(uvw)).astype(np.int32), directions, order.astype(np.int32)


@dataclass(frozen=True)
class PartOfTerms:
    """A part of a stack's terms, in vectors: those before it, and those of all parts."""

    before: int
    all_blocks: int


def exact_power(stack: DeviceStack, uvw: np.ndarray, lambda_um: np.ndarray) -> np.ndarray:
    """|P|^2 (directions, L) of the window in the middle of a whole stack; see `ExactPower`."""
    rows, columns = stack.shape
    found = ExactPower(uvw, lambda_um, (np.ones((columns, 1)), np.ones((rows, 1))), in_parts=False)
    found.add(stack, PartOfTerms(0, stack.blocks))
    return found.power()


class ExactPower:
    """|P|^2 of directions `uvw` (directions, 3) and wavelengths `lambda_um` (L,), of a Chebyshev stack or parts.

    `modes` are the factors (columns, modes), (rows, modes) that stand for the windows. Directions of equal v are
    cheaper together than apart: a map's rows, five times. One launch for each part: callers choose how many
    directions they hold at once, and hand over maps in `line_order`.
    """

    def __init__(
        self, uvw: np.ndarray, lambda_um: np.ndarray, modes: tuple[np.ndarray, np.ndarray], *, in_parts: bool
    ) -> None:
        first, directions, place = _lines(uvw)
        self._lines, self._groups = len(first) - 1, -(-len(lambda_um) // _WAVELENGTHS)
        self._wavelengths, padding = len(lambda_um), self._groups * _WAVELENGTHS - len(lambda_um)
        read = first, directions, place, np.pad(lambda_um, (0, padding), mode="edge")
        self._read = [device.upload(a) for a in read]
        self._modes = modes
        count = modes[0].shape[1] * modes[1].shape[1]
        kept = 16 * len(uvw) * self._groups * _WAVELENGTHS * count if in_parts else 16
        self._amplitude = device.result_buffer(kept)
        self._out = device.empty((len(uvw), self._groups * _WAVELENGTHS), np.float64)

    def add(self, stack: DeviceStack, part: PartOfTerms) -> None:
        """Adds the terms of one part of the stack; parts come in order."""
        modes_x, modes_y = (factors.shape[1] for factors in self._modes)
        items = min(self._lines * self._groups, _ITEMS_A_UNIT * device.default_device().compute_units)
        room = _scratch(stack.reach[0], stack.blocks, part.all_blocks, (modes_x, modes_y))
        result = device.shared(self._out)
        programs.exact().launch(
            "exact_power",
            (items,),
            stack.buffer,
            stack.decay,
            stack.grid,
            *(device.upload(factors) for factors in self._modes),
            *(np.int32(n) for n in (modes_x, modes_y, stack.blocks, part.before, part.all_blocks, *stack.reach)),
            np.int32(self._lines),
            np.int32(self._groups),
            *self._read,
            np.float64(stack.half_range_um),
            *(np.float64(f) for f in stack.band_per_um),
            device.result_buffer(8 * items * room),
            np.int64(room),
            self._amplitude,
            result,
        )
        device.settle(result, self._out)

    def power(self) -> np.ndarray:
        """|P|^2 (directions, L) once all parts were added; NaN beyond the scan's Nyquist limits."""
        return self._out[:, : self._wavelengths]


def _scratch(reach_x: int, blocks: int, all_blocks: int, modes: tuple[int, int]) -> int:
    """Doubles that a work-item of the power spectrum holds."""
    taps = 2 * reach_x + 1
    return _WAVELENGTHS * 2 * LANES * ((taps + modes[0]) * modes[1] * blocks + 2 * all_blocks)


def exact_power_bytes(
    directions: int, wavelengths: int, reach_x: int, terms: int, units: int, modes: tuple[int, int] = (1, 1)
) -> int:
    """Bytes of `ExactPower`: its result and the scratch of its work-items on a device with `units` compute units."""
    blocks = -(-terms // LANES)
    scratch = _ITEMS_A_UNIT * units * _scratch(reach_x, blocks, blocks, modes)
    return 8 * (directions * (wavelengths + _WAVELENGTHS) + scratch)


def taylor_table_bytes(nodes: int, terms: int) -> int:
    """Bytes of `taylor_table`: the nodes on the device, and a tile of results there and here."""
    return 16 * nodes + 2 * 8 * _TILE * 3 * 2 * LANES * -(-terms // LANES)


def _taylor_series(lambda_um: np.ndarray, stack: DeviceStack) -> np.ndarray:
    """(i k H)^n / n! (L, 2, 8 BLOCKS): what multiplies F_n at each wavelength; zero beyond the last term."""
    phase = 2.0 * np.pi / lambda_um[:, None] * stack.half_range_um
    n = np.arange(1, stack.terms)
    factors = np.cumprod(np.concatenate([np.ones((len(lambda_um), 1), complex), 1j * phase / n], axis=1), axis=1)
    series = np.zeros((len(lambda_um), 2, LANES * stack.blocks))
    series[:, 0, : stack.terms] = factors.real
    series[:, 1, : stack.terms] = factors.imag
    return series


def fourth_column(rows: np.ndarray) -> np.ndarray:
    """Rows of three as OpenCL's 4-vectors."""
    return np.pad(rows, ((0, 0), (0, 1)))
