"""Block sizes of the kernels: how much of a loop is written out so that its sums stay in registers.

Kernels work on vectors of 64 bytes. Such a vector takes one of 32 registers with AVX-512, two of 16 with AVX2 and
four with SSE or NEON, so blocks follow the width of the device's vector registers. `diffract-bake bench` times every
constant beside other values.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from kernels import device

# By the floats of a vector register. dft_stack: STEP_X and STEP_Y of the first step's k1, with sums of two and of
# four vectors, and KEPT frequencies of the second step, with two. polar_spectrum: S_BLOCK nodes in s, with four, and
# RADII neighbours, whose windows share most of what they read. spectral_operator: W_BLOCK nodes of w with two
# vectors, and SHARE_BLOCK nodes of w with six.
_BY_WIDTH = {
    16: {"STEP_X": 10, "STEP_Y": 5, "KEPT": 10, "S_BLOCK": 4, "RADII": 8, "W_BLOCK": 8, "SHARE_BLOCK": 4},
    8: {"STEP_X": 3, "STEP_Y": 2, "KEPT": 3, "S_BLOCK": 1, "RADII": 8, "W_BLOCK": 4, "SHARE_BLOCK": 1},
    4: {"STEP_X": 2, "STEP_Y": 1, "KEPT": 2, "S_BLOCK": 1, "RADII": 8, "W_BLOCK": 4, "SHARE_BLOCK": 1},
}
_instead: dict[str, int] = {}


def of_device() -> dict[str, int]:
    """Every block size for the default device, by the constant's name in the kernels."""
    return _BY_WIDTH[device.default_device().vector_width] | _instead


def chosen(*names: str) -> dict[str, int]:
    """Some of them, as constants of a program."""
    blocks = of_device()
    return {name: blocks[name] for name in names}


@contextmanager
def instead(**blocks: int) -> Iterator[None]:
    """Other sizes for a while, to time them."""
    before = dict(_instead)
    _instead.update(blocks)
    try:
        yield
    finally:
        _instead.clear()
        _instead.update(before)
