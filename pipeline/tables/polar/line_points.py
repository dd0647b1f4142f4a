"""The points at which the spectral integral takes E, on lines that rings share.

At a ring rho and a w, wavelengths ask for E at r = rho kappa and s = 2 pi |w| kappa, kappa = 1 / lambda. E is taken
at points kappa_p, and every wavelength is interpolated from the points about it. Points on radii of E cost half as
much; the rings near the mirror direction need points between: there, a step of r is a long way in s. Where such
points would outnumber the wavelengths, as of a tall surface or a laser line, the wavelengths are the points.

Rings that follow each other have the same lines at other w, and share points as long as the line of the first, which
is the steepest in s, does not leave the s where E is known.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from kernels.chebyshev import w_max
from kernels.programs import MOST_RINGS, ORDER
from kernels.spectral_operator import LinePoints
from pipeline.arrays import Array
from pipeline.tables.polar.quadrature import RingQuadratures

# how far a step may carry s, in mean distances of E's nodes in s: E cannot turn faster than they follow
_STEP_ON_RADII, _STEP_BETWEEN = 0.5, 0.25
# distances of points between radii, in distances of radii: E there is a polynomial in pieces, not one
_STEP_IN_RADII = 0.7
# how far s / s_max may pass 1 at a line's end, and that times nodes^2 = g: the tail of E's series in s grows to
# cosh(2 sqrt(g)) times what it was, 1500. Lagrange's weight out there is at most 2.4e-3 for the one ring; others of a
# group only interpolate in w from it. A series of few nodes has a large tail: at g = 16 and a third beyond, 7 nodes
# lost 4 % of a ring
_BEYOND, _BEYOND_BY_NODES = 0.1, 16.0
# the least share of its group's line that a ring may reach: near the rim E vanishes with |w|, but not what the terms
# leave of a line that reaches further
_LEAST_SHARE = 0.5


class _Lines:
    """Every ring's line at its w_max, from its longest wavelength's kappa, `low`, to its shortest's, `high`.

    first, last: the radii of E that Lagrange's polynomials of its ends need, `first` negative below the origin.
    """

    def __init__(
        self, radius_per_um: Array, s_nodes: int, s_max_per_um: float, rho: Array, quadratures: RingQuadratures
    ) -> None:
        self.rho, self.wavelengths, self._radius = rho, quadratures.count, radius_per_um
        self.low, self.high = quadratures.kappa_ends_per_um
        self.first = _about(radius_per_um, rho * self.low)
        self.last = _about(radius_per_um, rho * self.high) + ORDER - 1
        self._spacing = np.diff(radius_per_um)
        # what a step of kappa does to s / s_max, and what one of r does to kappa
        self._share_rate = 2.0 * pi * w_max(rho) / s_max_per_um
        self.kappa_rate = 1.0 / np.maximum(rho, np.finfo(np.float32).tiny)
        self._distances = s_nodes - 1  # of nodes in s
        self._end = 1.0 + min(_BEYOND, _BEYOND_BY_NODES / s_nodes**2)
        # the rates at which E turns along r and along s add up
        self.rate = rho / (_STEP_IN_RADII * self._spacing[np.abs(self.first)])
        self.rate += self._share_rate * self._distances / _STEP_BETWEEN
        # off radii a point costs twice as much
        self.on_radii = (
            (self.first >= 0) & self._followed(self.last) & (self.last + 1 - self.first <= 2 * self.wavelengths)
        )
        self.on_nodes = ~self.on_radii & (self.wavelengths <= _steps(self.low, self.high, self.rate)[0])

    def _known(self, r: Array) -> NDArray[np.bool_]:
        """Whether E is known, or nearly, on the lines out to r."""
        return np.asarray(self._share_rate * self.kappa_rate * r <= self._end)

    def _followed(self, radius: np.ndarray) -> NDArray[np.bool_]:
        """Whether points may go along the lines from radius to radius, out to `radius`."""
        step = self._share_rate * self._distances * self.kappa_rate * self._spacing[radius - 1]
        return np.asarray((step <= _STEP_ON_RADII) & self._known(self._radius[radius]))

    def joined_by(self, ring: np.ndarray) -> NDArray[np.bool_]:
        """Whether a later `ring`, one for every ring, may take what it needs from this one's line."""
        reached = np.where(
            self.on_radii, self._followed(self.last[ring]), self._known(self.rho[ring] * self.high[ring])
        )
        far = _LEAST_SHARE * self._share_rate * self.rho[ring] <= self._share_rate[ring] * self.rho
        alike = (self.on_radii[ring] == self.on_radii) & ~self.on_nodes[ring] & ~self.on_nodes
        return np.asarray(reached & far & alike)


def choose(
    radius_per_um: Array, s_nodes: int, s_max_per_um: float, rho: Array, quadratures: RingQuadratures
) -> LinePoints:
    """Points of every ring, over all of its wavelengths: of the ways that keep E's digits, the cheapest.

    `radius_per_um` of E ascends from 0, with ORDER / 2 radii beyond the farthest wavelength of every ring; `rho`
    ascends.
    """
    lines = _Lines(radius_per_um, s_nodes, s_max_per_um, rho, quadratures)
    rings = _groups(lines)
    leader = np.cumsum(rings) - rings
    stretch = np.where(np.repeat(rings, rings) > 1, rho * np.repeat(lines.kappa_rate[leader], rings), 1.0)
    on_radii, on_nodes = lines.on_radii[leader], lines.on_nodes[leader]
    first, last = np.minimum.reduceat(lines.first, leader), np.maximum.reduceat(lines.last, leader)
    low = np.minimum.reduceat(stretch * lines.low, leader)
    high = np.maximum.reduceat(stretch * lines.high, leader)
    between, step = _steps(low, high, lines.rate[leader])
    count = np.where(on_radii, last + 1 - first, np.where(on_nodes, quadratures.count[leader], between))

    begin = np.cumsum(count) - count
    group = np.repeat(np.arange(len(rings)), count)
    i = np.arange(len(group)) - begin[group]
    up = count[group] - 1 - i
    kappa, of_rho = high[group] - up * step[group], rho[leader][group]
    nodes, on = on_nodes[group], on_radii[group]
    kappa[nodes] = 1.0 / quadratures.lambda_um[(quadratures.first[leader][group] + up)[nodes]]
    place = np.where(on, first[group] + i, _about(radius_per_um, of_rho * kappa))
    kappa[on] = radius_per_um[place[on]] / of_rho[on]
    return LinePoints(kappa, place, begin, count, rings, on_radii, on_nodes, stretch)


def _groups(lines: _Lines) -> np.ndarray:
    """How many rings every group has: as many as its first lets join, up to MOST_RINGS."""
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
    """How many points between low and high, at least ORDER, and how far apart, E asks for that turns at `rate`."""
    # the first of so many stays above 0
    step = 1.0 / (rate + ORDER / high)
    return np.maximum(ORDER, np.ceil((high - low) / step).astype(int) + 1), step


def _about(radius_per_um: Array, r: Array) -> np.ndarray:
    """The first of the ORDER radii about r, negative near the origin."""
    half = ORDER // 2
    below = np.searchsorted(radius_per_um, r, side="right") - 1
    return np.clip(below, 0, len(radius_per_um) - 1 - half) - (half - 1)
