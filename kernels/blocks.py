"""Constants that the kernels are compiled with for speed: blocks of loops written out, whose sums stay in registers.

Kernels work on vectors of 64 bytes, which take one of 32 registers with AVX-512 and two of 16 with AVX2. Blocks that
fit the smaller set are as fast with the larger one, to the noise of the measurement, and compile a tenth faster: one
set serves both. `diffract-bake bench speed` times every constant beside another value.
"""

from collections.abc import Iterator
from contextlib import contextmanager

# dft_stack: STEP of the first step's k1, with sums of two vectors, and KEPT frequencies of the second step, with two.
# polar_power_spectrum: USUAL_TAPS, 2 reach_x + 1 of a patch of four sigma, whose loop along x is written out.
# spectral_operator: W_BLOCK nodes of w with two vectors.
_CHOSEN = {
    "STEP": 2,
    "KEPT": 2,
    "USUAL_TAPS": 7,
    "W_BLOCK": 2,
}
# what fills 32 registers; and no window of its own
OTHERS = {
    "STEP": 10,
    "KEPT": 10,
    "USUAL_TAPS": 0,
    "W_BLOCK": 4,
}


class Blocks:
    """The values of these constants on one device."""

    def __init__(self) -> None:
        self._values = dict(_CHOSEN)

    def chosen(self, *names: str) -> dict[str, int]:
        """Return the values of some constants, by their names in the kernels."""
        return {name: self._values[name] for name in names}

    @contextmanager
    def instead(self, **constants: int) -> Iterator[None]:
        """Take other values while this lasts, to time them."""
        before = self._values
        self._values = before | constants
        try:
            yield
        finally:
            self._values = before
