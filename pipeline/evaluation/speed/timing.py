"""Stopwatches."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What `work` gives, and the seconds it took."""
    started = time.perf_counter()
    result = work()
    return result, time.perf_counter() - started


def best_of(repeats: int, work: Callable[[], T]) -> tuple[T, float]:
    """What `work` gives, and the shortest of several times: what else the machine did only adds."""
    result, best = timed(work)
    for _ in range(repeats - 1):
        result, seconds = timed(work)
        best = min(best, seconds)
    return result, best
