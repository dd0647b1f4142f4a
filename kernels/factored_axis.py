"""Transforms of n = n1 n2 n3 samples in three levels, of some frequencies alone: tables of opencl/dft_stack.cl."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from math import ceil

import numpy as np
from numpy.typing import NDArray

# operations on a vector that a point costs where a level reads, turns and folds it, or writes it
_FOLD, _TURN, _WRITE = 6, 4, 3
_CALL = 12  # and a block of frequencies, beside its multiply-adds


@dataclass(frozen=True)
class Level:
    """A dense transform of `points`, folded.

    highest: of frequencies k and -k of the points, the largest that is wanted.
    pairs: of frequencies k and -k that are summed at a time.
    """

    points: int
    highest: int
    pairs: int

    @property
    def sets(self) -> int:
        """Of frequencies: even ones and odd ones have sums of their own where the points are even."""
        return 2 - self.points % 2

    @property
    def entries(self) -> int:
        """Sums and differences of a set."""
        return self.points // 4 + 1 if self.sets == 2 else self.points // 2 + 1

    @property
    def blocks(self) -> int:
        """Of `pairs` frequencies, of a set."""
        return ceil((self.highest // self.sets + 1) / self.pairs)

    @property
    def folded(self) -> int:
        """Vectors of complex points, folded."""
        return 4 * self.sets * self.entries

    def frequencies(self) -> NDArray[np.int64]:
        """Every k of the blocks, (sets, blocks, pairs); those beyond `highest` fill the last block."""
        k = np.arange(self.sets)[:, None] + self.sets * np.arange(self.blocks * self.pairs)
        return k.reshape(self.sets, self.blocks, self.pairs)

    def factors(self) -> NDArray[np.float64]:
        """Cosines and sines, (sets, blocks, entries - 1, pairs, 2)."""
        k = self.frequencies()[:, :, None, :]
        # whole turns go first: their sines would lose digits
        angle = 2.0 * np.pi / self.points * (k * np.arange(1, self.entries)[:, None] % self.points)
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def cost(self, *, real: bool = False, turned: bool = False) -> float:
        """Operations on vectors."""
        sums = (2 if real else 4) * self.pairs * (self.entries - 1) + _CALL * self.pairs
        share = 0.5 if real else 1.0
        return self.sets * self.blocks * sums + self.points * (share * _FOLD + _TURN * turned + share * _WRITE)


@dataclass(frozen=True)
class FactoredAxis:
    """The levels of an axis, and where its frequencies go.

    of: (tiles,) the k of a tile of the last level. place: (tiles, sets, blocks, pairs, 2) as the kernels read it.
    """

    levels: tuple[Level, Level, Level]
    of: NDArray[np.int32]
    place: NDArray[np.int32]

    @property
    def inner(self) -> int:
        """Points of the first two levels, n1 n2."""
        return self.levels[0].points * self.levels[1].points

    @property
    def stride(self) -> int:
        """Vectors from k to k before the last level; odd, for those a power of two apart share few cache lines."""
        return self.levels[2].points | 1

    def vectors(self, groups: int) -> int:
        """Vectors of scratch that a work-item needs, with `groups` of them in a line of terms."""
        folded, length = max(level.folded for level in self.levels), 8 * ceil(self.inner / 8)
        heights = groups * ceil(length * self.levels[2].points / 8)
        return 2 * groups * self.inner * self.stride + groups * length + 2 * self.inner + groups * folded + heights

    def sizes(self) -> NDArray[np.int32]:
        """The kernels' Axis."""
        levels = [n for each in self.levels for n in (each.points, each.sets, each.entries, each.blocks)]
        return np.array([self.inner * self.levels[2].points, *levels, len(self.of), self.stride], np.int32)

    def factors(self) -> NDArray[np.float64]:
        """Cosines and sines of all levels, and one number more: a few points have none."""
        return np.concatenate([*(level.factors().ravel() for level in self.levels), [0.0]])

    def turn(self) -> NDArray[np.float64]:
        """Cosines and sines before each level, (n1 + n1 n2 + samples, 2)."""
        n1, n2, n3 = (level.points for level in self.levels)
        inner, last = np.outer(np.arange(n1), np.arange(n2)) / (n1 * n2), np.outer(np.arange(n1 * n2), np.arange(n3))
        angle = 2.0 * np.pi * np.concatenate([np.zeros(n1), inner.ravel(), last.ravel() / (n1 * n2 * n3)])
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@cache
def of_real(n: int, columns: int, pairs: int) -> FactoredAxis:
    """Transform n real samples, of which `columns` frequencies from 0 on are wanted."""
    wanted = np.arange(columns)
    points = _points(n, columns - 1, pairs, real=True)
    inner, n1 = points[0] * points[1], points[0]
    # the first level gives frequencies up to half of its points; of k and -k, one is computed
    k, negative = wanted % n, -wanted % n
    known = [(at % inner) % n1 <= n1 // 2 for at in (k, negative)]
    lower = k % inner <= negative % inner
    direct = known[0] & (lower | ~known[1])
    return _axis(points, np.where(direct, k, negative), np.where(direct, wanted, -2 - wanted), pairs)


@cache
def of_complex(n: int, highest: int, pairs: int) -> FactoredAxis:
    """Transform n complex samples, of which the frequencies from -highest to highest are wanted.

    Of more than n frequencies, those that repeat the first n are not placed.
    """
    points, places = _points(n, highest, pairs, real=False), np.arange(min(n, 2 * highest + 1))
    return _axis(points, (places - highest) % n, places, pairs)


def _axis(points: tuple[int, int, int], k: NDArray[np.int64], places: NDArray[np.int64], pairs: int) -> FactoredAxis:
    """The axis whose frequencies k go to `places`; a frequency that is wanted again takes another tile."""
    inner, n3 = points[0] * points[1], points[2]
    above = k // inner
    highest = int(np.max(np.minimum(above, n3 - above)))
    levels = (Level(points[0], points[0] // 2, pairs), Level(points[1], points[1] // 2, pairs))
    last = Level(n3, highest, pairs)
    again = np.array([np.count_nonzero(k[:i] == each) for i, each in enumerate(k)]) if len(set(k)) < len(k) else 0 * k
    tiles, tile = np.unique(again * inner + k % inner, return_inverse=True)
    of = tiles % inner
    pair, side = np.minimum(above, n3 - above), (2 * above > n3).astype(int)
    place = np.full((len(tiles), last.sets, last.blocks * pairs, 2), -1, np.int32)
    place[tile, pair % last.sets, pair // last.sets, side] = places
    return FactoredAxis((*levels, last), of.astype(np.int32), place)


def _points(n: int, highest: int, pairs: int, *, real: bool) -> tuple[int, int, int]:
    """Points of the three levels that cost least."""

    def cost(points: tuple[int, int, int]) -> float:
        n1, n2, n3 = points
        first, second = Level(n1, n1 // 2, pairs), Level(n2, n2 // 2, pairs)
        last = Level(n3, min(n3 // 2, highest // (n1 * n2) + 1), pairs)
        kept = n1 // 2 + 1 if real else n1
        inner = n2 * first.cost(real=real) + (kept * second.cost(turned=True) if n2 > 1 else 0.0)
        return n3 * inner + kept * n2 * last.cost(turned=True)

    return min(_factorings(n), key=cost)


def _factorings(n: int) -> Iterator[tuple[int, int, int]]:
    """All products of three factors."""
    divisors = [d for d in range(1, n + 1) if n % d == 0]
    for n1 in divisors:
        for n2 in divisors:
            if n // n1 % n2 == 0:
                yield n1, n2, n // n1 // n2
