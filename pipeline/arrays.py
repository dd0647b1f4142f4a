"""The type of an array of real numbers, which all rooms share; docstrings give its shape and unit."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

Array = NDArray[np.float64]

_LINE_BYTES = 64


def on_a_cache_line(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Returns an uninitialised array that begins on a cache line: a device that shares it needs no copy."""
    nbytes = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
    raw = np.empty(nbytes + _LINE_BYTES, np.uint8)
    first = -raw.ctypes.data % _LINE_BYTES
    return raw[first : first + nbytes].view(dtype).reshape(shape)
