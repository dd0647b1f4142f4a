"""Host side of opencl/dft_stack.cl: the transforms of every Chebyshev term, of the frequencies kept alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels import device, factored_axis, programs
from kernels.factored_axis import FactoredAxis

_LINE_BYTES = 64
# of terms between the transforms along both axes, where rows divide into strips. Strips after the first add to the
# whole stack: on 4096 x 4096 samples two take a fifth longer than one, four twice as long
_MOST_BETWEEN_BYTES, _MOST_STRIPS = 288 * 2**20, 4
_ITEMS_A_UNIT = 4  # work-items, each with scratch that stays in a core's cache


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
    """Bytes of what `transform` of `rows` rows holds between its steps: a line of terms of a strip of rows."""
    return _strip_bytes(kept, rows // _strips(kept, rows))


def _strips(kept: Kept, rows: int) -> int:
    """Strips of rows that are transformed one after the other: as few as the bound allows, or the most."""
    strips = [n for n in range(1, min(rows, _MOST_STRIPS) + 1) if rows % n == 0]
    return next((n for n in strips if _strip_bytes(kept, rows // n) <= _MOST_BETWEEN_BYTES), strips[-1])


def _strip_bytes(kept: Kept, rows: int) -> int:
    """Bytes of a line of terms, real and imaginary, of a strip."""
    return 2 * _LINE_BYTES * (max(kept.phi_max, kept.reach) + 1) * _apart(rows)


def _apart(rows: int) -> int:
    """An odd number of rows: columns that are a power of two apart share few lines of a cache."""
    return rows | 1


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
    line, terms, strips = _LINE_BYTES // out.dtype.itemsize, out.shape[3], _strips(kept, ny)
    columns, rows = max(kept.phi_max, kept.reach) + 1, ny // strips
    tall = _apart(rows)
    program = programs.polar() if out.dtype == np.float32 else programs.exact()
    blocks = device.default_device().blocks
    pairs, groups = blocks.chosen("K_PAIRS")["K_PAIRS"], line // blocks.lanes(out.dtype.itemsize)
    x, y = factored_axis.of_real(nx, columns, pairs), factored_axis.of_complex(rows, kept.psi_max, pairs)
    items, room = _ITEMS_A_UNIT * device.default_device().compute_units, max(x.vectors(groups), y.vectors(groups))
    scratch = device.result_buffer(_LINE_BYTES // groups * items * room), np.int64(room)
    between = device.empty((columns, tall, 2, line), out.dtype)
    samples, narrow, result = (
        device.lent(np.ascontiguousarray(heights_um)),
        device.shared(between),
        device.shared(out),
    )
    along_x, along_y = _tables(x, out.dtype), _tables(y, out.dtype)
    order, divided = np.array((y.inner, y.levels[2].points), np.int32), np.array((rows, strips), np.int32)
    shifts = [device.upload(_shift(strip, kept, heights_um.shape).astype(out.dtype)) for strip in range(strips)]
    for first in range(0, terms, line):
        heights = samples, np.float64(scale_per_um), np.int32(first_term + first)
        shape = [np.int32(n) for n in (first, terms, kept.reach, kept.phi_max, kept.shape[0])]
        for strip, shift in enumerate(shifts):
            part = divided, np.int32(strip), order, np.int32(tall)
            program.launch("along_x", (items,), *heights, *along_x, *part, *scratch, narrow)
            sizes = np.int32(columns), np.int32(tall), *scratch, *shape
            program.launch("along_y", (items,), narrow, *along_y, *sizes, shift, np.int32(strip), result)
        done(min(1.0, (first + line) / terms))
    return device.settle(result, out)


def _shift(strip: int, kept: Kept, samples: tuple[int, ...]) -> NDArray[np.float64]:
    """exp(2 pi i strip psi / ny) / samples of every row of a stack, (rows, 2)."""
    psi = np.arange(-kept.psi_max, kept.psi_max + 1)
    angle = 2.0 * np.pi / samples[0] * (strip * psi % samples[0])
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1) / (samples[0] * samples[1])


def _tables(axis: FactoredAxis, dtype: Any) -> list[Any]:
    """The tables of an axis on the device, and its sizes."""
    tables = axis.factors().astype(dtype), axis.turn().astype(dtype), axis.of, axis.place
    return [*(device.upload(table) for table in tables), axis.sizes()]
