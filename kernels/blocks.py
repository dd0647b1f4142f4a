"""Block sizes of the kernels: how much of a loop is written out so that its sums stay in registers.

Kernels work on vectors of 64 bytes. Such a vector takes one of 32 registers with AVX-512, two of 16 with AVX2 and
four with SSE or NEON, so blocks follow the width of the device's vector registers. `diffract-bake bench` times every
constant beside other values.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from kernels import device

# By the floats of a vector register. dft_stack: STEP_X and STEP_Y of the first step's k1, with sums of two and of
# four vectors, and KEPT frequencies of the second step, with two. polar_spectrum: S_BLOCK nodes in s, with four.
# spectral_operator: W_BLOCK nodes of w with two vectors, and SHARE_BLOCK nodes of w with six.
_BY_WIDTH = {
    16: {"STEP_X": 5, "STEP_Y": 4, "KEPT": 6, "S_BLOCK": 4, "W_BLOCK": 4, "SHARE_BLOCK": 2},
    8: {"STEP_X": 2, "STEP_Y": 1, "KEPT": 2, "S_BLOCK": 1, "W_BLOCK": 2, "SHARE_BLOCK": 1},
    4: {"STEP_X": 1, "STEP_Y": 1, "KEPT": 1, "S_BLOCK": 1, "W_BLOCK": 1, "SHARE_BLOCK": 1},
}
# polar_spectrum: neighbouring RADII share most of what their windows read; USUAL_TAPS, 2 reach_x + 1 of a patch of
# four sigma, is the width of a window whose loop along x is written out. 1 and 0 are without either.
_OF_ALL = {"RADII": 8, "USUAL_TAPS": 7}
_WITHOUT = {"RADII": 1, "USUAL_TAPS": 0}
_instead: dict[str, int] = {}


def of_device() -> dict[str, int]:
    """Every block size for the default device, by the constant's name in the kernels."""
    return _BY_WIDTH[device.default_device().vector_width] | _OF_ALL | _instead


def chosen(*names: str) -> dict[str, int]:
    """Some of them, as constants of a program."""
    blocks = of_device()
    return {name: blocks[name] for name in names}


def other_value(name: str) -> int:
    """Another value to hold a constant against: that for registers of another width, or that without it."""
    if name in _WITHOUT:
        return _WITHOUT[name]
    width = device.default_device().vector_width
    return _BY_WIDTH[8 if width == 16 else 16][name]


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
