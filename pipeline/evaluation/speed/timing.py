"""Stopwatches."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """Return the result of `work` and its seconds."""
    started = time.perf_counter()
    result = work()
    return result, time.perf_counter() - started


def best_of(repeats: int, work: Callable[[], T]) -> tuple[T, float]:
    """Return the result of `work` and the shortest of `repeats` times: other processes only add."""
    result, best = timed(work)
    for _ in range(repeats - 1):
        result, seconds = timed(work)
        best = min(best, seconds)
    return result, best
