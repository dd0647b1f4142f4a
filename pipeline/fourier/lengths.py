"""Lengths whose transforms are fast: products of 2, 3 and 5."""

from math import ceil, log2


def next_fast(length: int) -> int:
    """Returns the least product of powers of 2, 3 and 5 that is not below a length of at least 1."""
    best = 1 << ceil(log2(length))
    fives = 1
    while fives < best:
        odd = fives
        while odd < best:
            best = min(best, odd << max(0, ceil(log2(length / odd))))
            odd *= 3
        fives *= 5
    return best
