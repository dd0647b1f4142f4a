"""Constants that the kernels are compiled with for speed: blocks of loops written out, whose sums stay in registers.

Registers hold 16 floats with AVX-512, and there are 32 of them; with AVX2 there are 16 of 8, and sums of a tile's
azimuths, vectors of 16 floats, take two each. The kernels of the stack work on vectors of one register.
`diffract-bake bench speed` times every constant beside another value.
"""

from collections.abc import Iterator
from contextlib import contextmanager

# dft_stack: K_PAIRS of frequencies, four registers each.
# polar_power_spectrum: USUAL_TAPS, 2 reach_x + 1 of a patch of four sigma, whose loop along x is written out; NODES
#   in s, four vectors of azimuths each.
# spectral_operator: W_BLOCK nodes of w, two vectors of azimuths each; XYZ_VECTORS, registers of azimuths with a
#   sum of X, Y and Z each: all four of AVX2 leave one of its registers for a factor and three for weights.
# Milliseconds of one core of an AMD EPYC (Zen 4), of each kernel with these and with other values, *Elaphe* 1332^2:
#   512 bits: K_PAIRS 5 40.8 (2 42.3, 3 42.1, 4 42.9); NODES 2 29.7 (1 30.5); W_BLOCK 4 33.6 (2 40.8, 8 34.0)
#   256 bits: K_PAIRS 3 53.0 (2 57.7, 4 59.8, 5 60.5); NODES 1 32.1 (2 33.9); W_BLOCK 2 44.3 (1 50.3, 4 55.7);
# Milliseconds of one core of an AMD EPYC (Zen 3), the table's kernels for one light and for one more:
#   256 bits: XYZ_VECTORS 4 64.2 and 25.0 (2 67.6 and 32.1, 1 68.8 and 59.1)
_WIDE = {"K_PAIRS": 5, "USUAL_TAPS": 7, "NODES": 2, "W_BLOCK": 4, "XYZ_VECTORS": 2}
_NARROW = {"K_PAIRS": 3, "USUAL_TAPS": 7, "NODES": 1, "W_BLOCK": 2, "XYZ_VECTORS": 4}
_WIDE_VECTOR = 16  # floats


class Blocks:
    """The values of these constants on one device."""

    def __init__(self, vector_width: int) -> None:
        wide = vector_width >= _WIDE_VECTOR
        self.vector_width = vector_width
        chosen, other = (_WIDE, _NARROW) if wide else (_NARROW, _WIDE)
        # those of the other kind of processor; but no window of its own, and half of the registers of azimuths
        self.others = {**other, "USUAL_TAPS": 0, "XYZ_VECTORS": chosen["XYZ_VECTORS"] // 2}
        self._values = dict(chosen)

    def lanes(self, itemsize: int) -> int:
        """Return how many numbers of `itemsize` bytes a vector has: those of a register, a line of the cache at most.

        OpenCL has no vectors of one.
        """
        return min(64, max(2 * itemsize, 4 * self.vector_width)) // itemsize

    def chosen(self, *names: str) -> dict[str, int]:
        """Return the values of some constants, by their names in the kernels; of all where none is named."""
        return {name: self._values[name] for name in names or self._values}

    @contextmanager
    def instead(self, **constants: int) -> Iterator[None]:
        """Take other values while this lasts, to time them."""
        before = self._values
        self._values = before | constants
        try:
            yield
        finally:
            self._values = before
