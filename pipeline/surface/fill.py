"""Fills holes of a height field by a solution of Laplace's equation, in time and memory linear in its samples.

Few holes are solved for directly. Many are solved for by conjugate gradients with a multigrid cycle as preconditioner
(Tatebe 1993): a direct solver would need minutes and gigabytes for them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Single = NDArray[np.float32]

# up to so many holes, a sparse direct solve takes less time than setting up a multigrid cycle
_FEW_HOLES = 20_000
# solves in float32, each of the residual in float64, and what each leaves of the error's energy norm
_REFINEMENTS, _GAIN = 8, 1e-3
# the last correction, relative to the range of the heights; what it leaves is below 1e-6 (test)
_LAST_CORRECTION = 1e-5
_STEPS = 60
# damping of Jacobi's iteration, best for the five-point Laplacian; sweeps on the coarsest grid
_DAMPING, _COARSEST_SWEEPS = 0.8, 30


def fill_holes(heights_um: Array, valid: Mask, pitch_um: tuple[float, float]) -> Array:
    """Fills holes by a solution of Laplace's equation.

    Each filled sample is the mean of its neighbours within the patch, weighted by 1 / pitch^2. A harmonic function
    has its extremes on the boundary: no filled height lies outside the range of the valid samples. Beyond
    _FEW_HOLES holes, the solution is approximated to 1e-6 of that range.

    heights_um: (ny, nx), um. valid: bool (ny, nx), at least one sample true. pitch_um: along (x, y), um.
    Returns (ny, nx), um, with unchanged valid samples.
    """
    hole = ~valid
    filled = heights_um.copy()
    if not hole.any():
        return filled
    # only the ratio of the weights matters: it is 1 along the finer axis
    finest = min(pitch_um)
    weights = (finest / pitch_um[0]) ** 2, (finest / pitch_um[1]) ** 2
    # with a margin of one sample, of which holes within the patch have valid ones
    box = tuple(_span(np.flatnonzero(hole.any(axis=axis)), hole.shape[1 - axis]) for axis in (1, 0))
    solve = _directly if np.count_nonzero(hole) <= _FEW_HOLES else _by_multigrid
    filled[box] = solve(filled[box], hole[box], weights)
    return filled


def _span(places: Index, size: int) -> slice:
    """Returns the range of `places` with one more on either side, within 0..size."""
    return slice(max(int(places[0]) - 1, 0), min(int(places[-1]) + 2, size))


# --- few holes ---------------------------------------------------------------------------------------


def _directly(heights: Array, hole: Mask, weights: tuple[float, float]) -> Array:
    """Solves for the holes by a sparse factorisation."""
    # the import takes a tenth of a second, and most scans have no holes
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    flat = heights.ravel()
    unknown = np.flatnonzero(hole)
    number = np.full(hole.size, -1)
    number[unknown] = np.arange(unknown.size)
    diagonal, known = np.zeros(unknown.size), np.zeros(unknown.size)
    # the first block is empty, because isolated holes have no links to other holes
    blocks = [sparse.csr_array((unknown.size, unknown.size))]
    for mine, there, weight in _neighbours(unknown, hole.shape, weights):
        other = number[there]
        inner = other >= 0
        np.add.at(diagonal, mine, weight)
        np.add.at(known, mine[~inner], weight * flat[there[~inner]])
        links = (np.full(np.count_nonzero(inner), -weight), (mine[inner], other[inner]))
        blocks.append(sparse.csr_array(links, shape=(unknown.size, unknown.size)))
    matrix = sum(blocks[1:], blocks[0]) + sparse.diags_array(diagonal)
    filled = flat.copy()
    filled[unknown] = spsolve(matrix.tocsc(), known)
    return filled.reshape(hole.shape)


def _neighbours(
    samples: Index, shape: tuple[int, ...], weights: tuple[float, float]
) -> Iterator[tuple[Index, Index, float]]:
    """Lists the neighbours of samples (flat indices) within the patch, for each of the four directions.

    Yields which of the samples have a neighbour there, the neighbours' flat indices, and their weight.
    """
    ny, nx = shape
    j, i = np.divmod(samples, nx)
    for dj, di in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        mine = np.flatnonzero((j + dj >= 0) & (j + dj < ny) & (i + di >= 0) & (i + di < nx))
        yield mine, samples[mine] + dj * nx + di, weights[0 if di else 1]


# --- many holes --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Grid:
    """One grid of the multigrid cycle, on which corrections are 0 outside of holes.

    hole: float32 (ny, nx), 1 in holes, else 0. diagonal: sum of the weights of a sample's links. weights: of links
    along (x, y). halved: whether the next grid has half as many samples along (x, y).
    """

    hole: Single
    diagonal: Single
    weights: tuple[float, float]
    halved: tuple[bool, bool]


def _by_multigrid(heights: Array, hole: Mask, weights: tuple[float, float]) -> Array:
    """Solves for the holes by preconditioned conjugate gradients in float32, refined by residuals in float64."""
    known = ~hole
    low = float(np.min(heights, where=known, initial=np.inf))
    scale = float(np.max(heights, where=known, initial=-np.inf)) - low
    if scale == 0:
        return np.where(hole, low, heights)
    grids = _grids(hole, weights)
    filled = np.where(hole, low + 0.5 * scale, heights)
    for _ in range(_REFINEMENTS):
        correction = _conjugate_gradients(grids, _residual(filled, hole, weights) / np.float32(scale))
        filled += scale * correction
        if float(np.max(np.abs(correction))) < _LAST_CORRECTION:
            break
    return np.where(hole, np.clip(filled, low, low + scale), heights)


def _residual(heights: Array, hole: Mask, weights: tuple[float, float]) -> Single:
    """Computes the weighted sum of differences to the neighbours in holes, in double precision; 0 elsewhere."""
    found = np.zeros_like(heights)
    for rows, sums, weight in ((heights, found, weights[1]), (heights.T, found.T, weights[0])):
        steps = np.diff(rows, axis=0)
        steps *= weight
        sums[:-1] += steps
        sums[1:] -= steps
    found *= hole
    return found.astype(np.float32)


def _grids(hole: Mask, weights: tuple[float, float]) -> list[_Grid]:
    """Makes the grids, the finest first; a coarse sample lies in a hole where all samples that it replaces do."""
    grids = []
    while True:
        ny, nx = hole.shape
        # an axis with far weaker links than the other gains nothing from fewer samples until the weights are alike
        least = 0.4 * max(weights)
        refined = bool(hole.any()) and max(ny, nx) > 4
        halved = refined and nx > 2 and weights[0] >= least, refined and ny > 2 and weights[1] >= least
        diagonal = np.full(hole.shape, 2 * sum(weights), np.float32)
        for side, weight in ((diagonal, weights[1]), (diagonal.T, weights[0])):
            side[0] -= weight
            side[-1] -= weight
        grids.append(_Grid(hole.astype(np.float32), diagonal, weights, halved))
        if not any(halved):
            return grids
        for axis in (0, 1):
            if halved[1 - axis]:
                hole = _pairs(hole, axis)
        # the equation of a coarse sample is the sum of those that it replaces, over twice the distance
        joined = 4.0 if all(halved) else 2.0
        weights = weights[0] * joined / (4 if halved[0] else 1), weights[1] * joined / (4 if halved[1] else 1)


def _pairs(hole: Mask, axis: int) -> Mask:
    """Joins pairs of rows (axis 0) or columns: true where both are; a last one without a partner counts alone."""
    rows = np.moveaxis(hole, axis, 0)
    joined = rows[0::2].copy()
    joined[: len(rows) // 2] &= rows[1::2]
    return np.ascontiguousarray(np.moveaxis(joined, 0, axis))


def _conjugate_gradients(grids: list[_Grid], right: Single) -> Single:
    """Solves for the correction whose weighted differences to its neighbours add up to `right`, to _GAIN."""
    found = np.zeros_like(right)
    rest = right.copy()
    wave, before, first = np.zeros_like(right), 1.0, 0.0
    for step in range(_STEPS):
        smoothed = _cycle(grids, rest)
        energy = float(np.vdot(rest, smoothed))
        first = first or energy
        if energy <= _GAIN**2 * first or step == _STEPS - 1:
            break
        wave *= np.float32(energy / before)
        wave += smoothed
        del smoothed
        image = _applied(grids[0], wave)
        length = np.float32(energy / float(np.vdot(wave, image)))
        image *= length
        rest -= image
        np.multiply(wave, length, out=image)
        found += image
        before = energy
    return found


def _applied(grid: _Grid, heights: Single) -> Single:
    """Applies the negative Laplacian to corrections, which are 0 outside of holes."""
    x, y = (np.float32(weight) for weight in grid.weights)
    sums = np.zeros_like(heights)
    sums[:, 1:] += heights[:, :-1]
    sums[:, :-1] += heights[:, 1:]
    if x != y:
        sums *= x / y
    sums[1:] += heights[:-1]
    sums[:-1] += heights[1:]
    if y != 1:
        sums *= y
    image = grid.diagonal * heights
    image -= sums
    image *= grid.hole
    return image


def _cycle(grids: list[_Grid], right: Single) -> Single:
    """Solves for corrections approximately, by one V-cycle. As a matrix it is symmetric and positive definite."""
    grid = grids[0]
    smoother = grid.hole / grid.diagonal
    smoother *= np.float32(_DAMPING)
    found = smoother * right
    if len(grids) == 1:
        for _ in range(_COARSEST_SWEEPS):
            found += smoother * (right - _applied(grid, found))
        return found
    rest = _applied(grid, found)
    np.subtract(right, rest, out=rest)
    for axis in (0, 1):
        if grid.halved[1 - axis]:
            rest = _restricted(rest, axis)
    correction = _cycle(grids[1:], rest * grids[1].hole)
    for axis in (1, 0):
        if grid.halved[1 - axis]:
            correction = _interpolated(correction, axis, grid.hole.shape[axis])
    correction *= grid.hole
    found += correction
    rest = _applied(grid, found)
    np.subtract(right, rest, out=rest)
    rest *= smoother
    found += rest
    return found


def _interpolated(coarse: Single, axis: int, size: int) -> Single:
    """Interpolates linearly to twice as many samples, or one fewer, along an axis."""
    shape = (size, coarse.shape[1]) if axis == 0 else (coarse.shape[0], size)
    found = np.empty(shape, np.float32)
    fine, given = np.moveaxis(found, axis, 0), np.moveaxis(coarse, axis, 0)
    quarter = np.float32(0.25) * given
    near = given - quarter
    half = size // 2
    fine[0::2] = near
    fine[2::2] += quarter[:-1]
    fine[0] += quarter[0]
    fine[1::2] = near[:half]
    last = min(half, len(given) - 1)
    fine[1 : 2 * last : 2] += quarter[1 : last + 1]
    if last < half:
        fine[-1] += quarter[-1]
    return found


def _restricted(fine: Single, axis: int) -> Single:
    """Applies the transpose of `_interpolated`."""
    rows = np.moveaxis(fine, axis, 0)
    size = len(rows)
    half, coarse = size // 2, (size + 1) // 2
    found = np.empty((coarse, fine.shape[1]) if axis == 0 else (fine.shape[0], coarse), np.float32)
    given = np.moveaxis(found, axis, 0)
    given[:] = rows[0::2]
    given[:half] += rows[1::2]
    given *= np.float32(3)
    given[:-1] += rows[2::2]
    given[0] += rows[0]
    last = min(half, coarse - 1)
    given[1 : last + 1] += rows[1 : 2 * last : 2]
    if last < half:
        given[-1] += rows[-1]
    given *= np.float32(0.25)
    return found
