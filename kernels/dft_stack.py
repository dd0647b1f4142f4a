"""Host side of opencl/dft_stack.cl: the transforms of every Chebyshev term, of the frequencies kept alone."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels import device, programs

_VECTOR_BYTES = 64
_ITEMS_A_UNIT = 4  # work-items, each with scratch that stays in a core's cache
_AXIS = np.dtype([(name, np.int32) for name in ("n", "n1", "n2", "pairs", "padded", "blocks")])


@dataclass(frozen=True)
class Kept:
    """The frequencies kept, as indices of the DFT, which wrap: psi from -psi_max on, phi from -reach to phi_max."""

    psi_max: int
    phi_max: int
    reach: int

    @property
    def shape(self) -> tuple[int, int]:
        """(psi, phi)."""
        return 2 * self.psi_max + 1, self.reach + self.phi_max + 1


def between_bytes(kept: Kept, rows: int) -> int:
    """Bytes of what `transform` of `rows` rows holds between its steps: a vector of terms, real and imaginary."""
    return 2 * _VECTOR_BYTES * (max(kept.phi_max, kept.reach) + 1) * rows


def transform(
    heights_um: NDArray[np.float64],
    scale_per_um: float,
    kept: Kept,
    out: NDArray[Any],
    done: Callable[[float], None],
    first_term: int = 0,
) -> NDArray[Any]:
    """Fills `out` (psi, phi, 2, terms), float32 or float64, with mean(T_n(scale h) exp(+2 pi i f.x)).

    n counts from `first_term`.
    x and y count from the middle sample. `done` is called with the completed share of terms. Terms are computed in
    double: a recurrence in single precision would lose n^2 of its digits at |t| = 1.
    """
    ny, nx = heights_um.shape
    lanes, terms = _VECTOR_BYTES // out.dtype.itemsize, out.shape[3]
    columns, rows = max(kept.phi_max, kept.reach) + 1, kept.shape[0]
    sizes = device.default_device().blocks.chosen("STEP", "KEPT")
    x = _axis(nx, np.arange(columns), sizes["STEP"], sizes["KEPT"], out.dtype)
    y = _axis(ny, np.arange(-kept.psi_max, kept.psi_max + 1), 1, sizes["KEPT"], out.dtype)
    program = programs.polar() if out.dtype == np.float32 else programs.exact()
    items, room = _ITEMS_A_UNIT * device.default_device().compute_units, max(3 * nx, 2 * ny)
    scratch = device.result_buffer(_VECTOR_BYTES * items * room), np.int64(room)
    between = device.empty((columns, ny, 2, lanes), out.dtype)
    samples, narrow, result = (
        device.lent(np.ascontiguousarray(heights_um)),
        device.shared(between),
        device.shared(out),
    )
    mean = out.dtype.type(1.0 / heights_um.size)
    for first in range(0, terms, lanes):
        start = np.int32(first_term + first)
        program.launch(
            "along_x", (items,), samples, np.float64(scale_per_um), start, *x, np.int32(ny), *scratch, narrow
        )
        shape = (np.int32(n) for n in (first, terms, kept.reach, kept.phi_max, rows))
        program.launch("along_y", (items,), narrow, *y, np.int32(columns), *scratch, *shape, mean, result)
        done(min(1.0, (first + lanes) / terms))
    return device.settle(result, out)


def _axis(n: int, frequencies: NDArray[np.int64], step: int, kept: int, dtype: Any) -> list[Any]:
    """The tables of one axis of n = n1 n2 samples, on the device, and its sizes."""
    n1 = max(d for d in range(1, min(isqrt(n), 2 * programs.MOST_PAIRS - 2) + 1) if n % d == 0)
    n2, pairs = n // n1, n1 // 2 + 1
    padded = step * ceil(pairs / step)
    angle = 2.0 * np.pi * np.outer(np.arange(pairs), np.arange(padded)) / n1
    parts = [part for k1 in range(n1) for part in _parts(np.flatnonzero(frequencies % n1 == k1), kept)]
    place = np.full((len(parts), kept), -1, np.int32)
    turn = np.zeros((len(parts), n2, kept))
    for at, turned, part in zip(place, turn, parts, strict=True):
        at[: len(part)] = part
        # whole turns go first: their sines would lose digits
        turned[:, : len(part)] = 2.0 * np.pi / n * (np.outer(np.arange(n2), frequencies[part]) % n)
    tables = np.cos(angle), np.sin(angle), np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    first_of = np.array([frequencies[part[0]] % n1 for part in parts], np.int32)
    buffers = [device.upload(a) for a in (*(t.astype(dtype) for t in tables), first_of, place)]
    return [*buffers, np.array((n, n1, n2, pairs, padded, len(parts)), _AXIS)]


def _parts(indices: NDArray[np.int64], size: int) -> list[NDArray[np.int64]]:
    return [indices[first : first + size] for first in range(0, len(indices), size)]
