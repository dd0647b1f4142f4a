"""Interpolation points of the spectral integral, on lines of the (r, s) plane that neighbouring rings share.

For a ring rho and a w, the wavelengths lie on a line through the origin: r = rho kappa and s = 2 pi |w| kappa, with
kappa = 1 / lambda. E is evaluated at points kappa_p of the line, and every wavelength is interpolated from the points
next to it. Points on radii of E cost half as much as others. Rings near the mirror direction need points between the
radii, because there a step in r is a large step in s. Where these would outnumber the wavelengths, as for a tall
surface or a laser line, the wavelengths themselves are the points.

Consecutive rings have the same lines for different w. They share points as long as the line of the first ring, which
is the steepest in s, remains in the range of s for which E is known. docs/spectral_operator.md derives this.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from kernels.chebyshev import w_max
from kernels.programs import MOST_RINGS, ORDER
from kernels.spectral_operator import LinePoints
from pipeline.arrays import Array
from pipeline.tables.polar.quadrature import RingQuadratures

# largest step in s, in mean distances of the Chebyshev nodes of E: they limit how fast E varies
_STEP_ON_RADII, _STEP_BETWEEN = 0.5, 0.25
# largest step in r of points between radii, in distances of radii: E is a piecewise polynomial there
_STEP_IN_RADII = 0.7
# extrapolation limit in s: at s = (1 + eps) s_max the tail of a Chebyshev series of n nodes grows by
# cosh(2 n sqrt(eps)); eps = min(0.1, 16 / n^2) allows a factor of 1500. The first ring of a group gives such points a
# Lagrange weight of at most 2.4e-3, and the other rings only interpolate in w from them. With n = 7 and eps = 0.33 a
# ring lost 4 % (measured)
_BEYOND, _BEYOND_BY_NODES = 0.1, 16.0
# smallest share of the group's line in s that a ring may use: near the rim E vanishes with |w|, but the truncation
# error of the terms of a longer line does not
_LEAST_SHARE = 0.5


class _Lines:
    """The line of every ring in the (r, s) plane, at the ring's w_max.

    low, high: kappa of the longest and the shortest wavelength (n_rings,), 1/um.
    first, last: indices of the radii that Lagrange interpolation at the two ends needs; `first` is negative if they
    include radii mirrored at the origin.
    kappa_rate: d kappa / d r (n_rings,). rate: points per unit of kappa that E requires (n_rings,), um.
    on_radii: whether the points are radii of E. on_nodes: whether the points are the wavelengths.
    """

    def __init__(
        self, radius_per_um: Array, s_nodes: int, s_max_per_um: float, rho: Array, quadratures: RingQuadratures
    ) -> None:
        self.rho, self.wavelengths, self._radius = rho, quadratures.count, radius_per_um
        self.low, self.high = quadratures.kappa_ends_per_um
        self.first = _first_radius(radius_per_um, rho * self.low)
        self.last = _first_radius(radius_per_um, rho * self.high) + ORDER - 1
        self._spacing = np.diff(radius_per_um)
        # d (s / s_max) / d kappa and d kappa / d r
        self._share_rate = 2.0 * pi * w_max(rho) / s_max_per_um
        self.kappa_rate = 1.0 / np.maximum(rho, np.finfo(np.float32).tiny)
        self._distances = s_nodes - 1  # of nodes in s
        self._end = 1.0 + min(_BEYOND, _BEYOND_BY_NODES / s_nodes**2)
        # the rates of change of E along r and along s add up
        self.rate = rho / (_STEP_IN_RADII * self._spacing[np.abs(self.first)])
        self.rate += self._share_rate * self._distances / _STEP_BETWEEN
        # a point between radii costs twice as much
        self.on_radii = (
            (self.first >= 0) & self._resolved(self.last) & (self.last + 1 - self.first <= 2 * quadratures.usual)
        )
        self.on_nodes = ~self.on_radii & (quadratures.usual <= _steps(self.low, self.high, self.rate)[0])

    def _within_limit(self, r: Array) -> NDArray[np.bool_]:
        """Whether the lines up to r remain within the extrapolation limit in s."""
        return np.asarray(self._share_rate * self.kappa_rate * r <= self._end)

    def _resolved(self, radius: np.ndarray) -> NDArray[np.bool_]:
        """Whether the radii of E up to index `radius` are close enough along the lines to be the points."""
        step = self._share_rate * self._distances * self.kappa_rate * self._spacing[radius - 1]
        return np.asarray((step <= _STEP_ON_RADII) & self._within_limit(self._radius[radius]))

    def joined_by(self, ring: np.ndarray) -> NDArray[np.bool_]:
        """Whether a later ring may share the line of each ring; ring: index of the later ring (n_rings,)."""
        reached = np.where(
            self.on_radii,
            self._resolved(self.last[ring]),
            self._within_limit(self.rho[ring] * self.high[ring]),
        )
        far = _LEAST_SHARE * self._share_rate * self.rho[ring] <= self._share_rate[ring] * self.rho
        alike = (self.on_radii[ring] == self.on_radii) & ~self.on_nodes[ring] & ~self.on_nodes
        return np.asarray(reached & far & alike)


class _Groups:
    """The groups of rings that share a line, and their numbers of points.

    rings: number of rings (groups,). leader: index of the first (groups,).
    stretch: rho over that of the group's first (n_rings,).
    first: index of the first radius. high: kappa of the last point. step: distance of points in kappa.
    count: number of points (groups,).
    """

    def __init__(self, lines: _Lines) -> None:
        self.rings = _groups(lines)
        self.leader = np.cumsum(self.rings) - self.rings
        leader, rate = self.leader, np.repeat(lines.kappa_rate[self.leader], self.rings)
        self.stretch = np.where(np.repeat(self.rings, self.rings) > 1, lines.rho * rate, 1.0)
        self.on_radii, self.on_nodes = lines.on_radii[leader], lines.on_nodes[leader]
        self.first, last = np.minimum.reduceat(lines.first, leader), np.maximum.reduceat(lines.last, leader)
        low = np.minimum.reduceat(self.stretch * lines.low, leader)
        self.high = np.maximum.reduceat(self.stretch * lines.high, leader)
        between, self.step = _steps(low, self.high, lines.rate[leader])
        on_nodes = np.where(self.on_nodes, lines.wavelengths[leader], between)
        self.count = np.where(self.on_radii, last + 1 - self.first, on_nodes)


def counts(
    radius_per_um: Array, s_nodes: int, s_max_per_um: float, rho: Array, quadratures: RingQuadratures
) -> tuple[int, int]:
    """Counts the points that `choose` would make, of all groups and of all rings; the parameters are the same."""
    groups = _Groups(_Lines(radius_per_um, s_nodes, s_max_per_um, rho, quadratures))
    return int(groups.count.sum()), int(groups.rings @ groups.count)


def choose(
    radius_per_um: Array, s_nodes: int, s_max_per_um: float, rho: Array, quadratures: RingQuadratures
) -> LinePoints:
    """Chooses the interpolation points kappa = 1 / lambda of every ring: the cheapest set that resolves E.

    radius_per_um: radii of E (n_r,), 1/um, ascending from 0; at least ORDER / 2 of them beyond max(rho) / lambda_min.
    s_nodes: number of Chebyshev nodes of E in s = 2 pi |w| / lambda. s_max_per_um: end of their interval, 1/um.
    rho: |(u, v)| of the rings (n_rings,), ascending, dimensionless. quadratures: wavelengths of every ring.
    Returns the points of every group of rings; docs/spectral_operator.md derives them.
    """
    of = _Groups(_Lines(radius_per_um, s_nodes, s_max_per_um, rho, quadratures))
    begin = np.cumsum(of.count) - of.count
    group = np.repeat(np.arange(len(of.rings)), of.count)
    i = np.arange(len(group)) - begin[group]
    up = of.count[group] - 1 - i
    kappa, of_rho = of.high[group] - up * of.step[group], rho[of.leader][group]
    nodes, on = of.on_nodes[group], of.on_radii[group]
    kappa[nodes] = 1.0 / quadratures.lambda_um[(quadratures.first[of.leader][group] + up)[nodes]]
    place = np.where(on, of.first[group] + i, _first_radius(radius_per_um, of_rho * kappa))
    kappa[on] = radius_per_um[place[on]] / of_rho[on]
    return LinePoints(kappa, place, begin, of.count, of.rings, of.on_radii, of.on_nodes, of.stretch)


def _groups(lines: _Lines) -> np.ndarray:
    """Groups consecutive rings that share the line of the first one; returns their numbers, at most MOST_RINGS."""
    rings = len(lines.rho)
    later = np.arange(rings) + np.arange(1, MOST_RINGS)[:, None]
    joined = [np.ones(rings, bool)]
    joined += [(ring < rings) & lines.joined_by(np.minimum(ring, rings - 1)) for ring in later]
    size = np.logical_and.accumulate(joined).sum(axis=0)
    found = [int(size[0])]
    while (next_ring := sum(found)) < rings:
        found.append(int(size[next_ring]))
    return np.array(found)


def _steps(low: Array, high: Array, rate: Array) -> tuple[np.ndarray, Array]:
    """Computes the number of points from low to high, at least ORDER, and their distance in kappa, for `rate`."""
    # the term ORDER / high keeps the first point above 0
    step = 1.0 / (rate + ORDER / high)
    return np.maximum(ORDER, np.ceil((high - low) / step).astype(int) + 1), step


def _first_radius(radius_per_um: Array, r: Array) -> np.ndarray:
    """Finds the first of the ORDER radii about r; negative near the origin, where radii are mirrored."""
    half = ORDER // 2
    below = np.searchsorted(radius_per_um, r, side="right") - 1
    return np.clip(below, 0, len(radius_per_um) - 1 - half) - (half - 1)
