"""Memory behind the arrays that kernels read and write."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

LINE = 64  # bytes of a cache line, and of a vector
MOST_SPARE_BYTES = 2**28


class MemoryPool:
    """Arrays on memory that served before: page faults on fresh memory cost as much as a kernel's work."""

    def __init__(self) -> None:
        self._spare: list[np.ndarray] = []
        self._keepers = 0
        # collecting garbage may free pages while pages are being taken
        self._lock = threading.RLock()

    def empty(self, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
        """Return an array that begins on a cache line: elsewhere every vector that a kernel loads would touch two.

        Its memory returns to the pool once nothing refers to it.
        """
        bytes_ = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
        raw = np.asarray(_Pages(self, self.take(bytes_ + LINE), bytes_ + LINE))
        first = -raw.ctypes.data % LINE
        array: np.ndarray = raw[first : first + bytes_].view(dtype).reshape(shape)
        return array

    def take(self, bytes_: int) -> np.ndarray:
        """Return the smallest spare memory of `bytes_` to twice that, or else new memory of `bytes_`."""
        with self._lock:
            fitting = (i for i, spare in enumerate(self._spare) if bytes_ <= spare.nbytes <= 2 * bytes_)
            i = min(fitting, key=lambda i: self._spare[i].nbytes, default=None)
            return np.empty(bytes_, np.uint8) if i is None else self._spare.pop(i)

    def give(self, memory: np.ndarray) -> None:
        """Keep memory for later; the oldest goes where the pool holds too much."""
        with self._lock:
            self._spare.append(memory)
            self._drop()

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Let no memory go while this lasts: what follows takes arrays of the same sizes again and again."""
        with self._lock:
            self._keepers += 1
        try:
            yield
        finally:
            with self._lock:
                self._keepers -= 1
                self._drop()

    @property
    def spare_bytes(self) -> int:
        """Bytes that nothing refers to."""
        return sum(spare.nbytes for spare in self._spare)

    def _drop(self) -> None:
        while not self._keepers and self.spare_bytes > MOST_SPARE_BYTES:
            self._spare.pop(0)


class _Pages:
    """A part of the pool's memory, held until the last array on it is gone."""

    def __init__(self, pool: MemoryPool, memory: np.ndarray, bytes_: int) -> None:
        # `memory` is taken before: an object whose memory could not be had would still be deleted
        self._pool, self._memory = pool, memory
        self.__array_interface__ = {**self._memory.__array_interface__, "shape": (bytes_,)}

    def __del__(self) -> None:
        self._pool.give(self._memory)
