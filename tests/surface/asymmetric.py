"""A height field that looks the same under no flip or turn, for files of many formats."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

NY, NX = 10, 12
# top row first; nothing looks the same when it is flipped or turned
TOP_FIRST = np.arange(1.0, 121.0).reshape(NY, NX)
VOID = (2, 3)
PITCH_UM = (0.1, 0.2)


def with_void(value: float, dtype: str) -> NDArray[Any]:
    stored = TOP_FIRST.astype(dtype)
    stored[VOID] = value
    return stored


def padded(text: str, length: int) -> bytes:
    return text.encode().ljust(length, b"\0")[:length]
