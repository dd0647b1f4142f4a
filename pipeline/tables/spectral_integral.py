"""The spectral integral of E(r, phi, s) on rings, and the points on each ring's line at which it takes E.

At a ring rho and a w, wavelengths ask for E at r = rho kappa and s = 2 pi |w| kappa, kappa = 1 / lambda. E is taken
at points kappa_p, and every wavelength is interpolated from the points about it. Points on radii of E cost half as
much; the rings near the mirror direction need points between: there, a step of r is a long way in s. Where such
points would outnumber the wavelengths, as of a tall surface or a laser line, the wavelengths are the points.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from kernels import spectral_operator
from kernels.spectral_operator import ORDER, LinePoints
from pipeline.errors import AccuracyError
from pipeline.optics.geometry import Array
from pipeline.tables.quadrature import RingQuadratures

# how far a step may carry s, in mean distances of E's nodes in s: E cannot turn faster than they follow
_STEP_ON_RADII, _STEP_BETWEEN = 0.5, 0.25
# distances of points between radii, in distances of radii: E there is a polynomial in pieces, not one
_STEP_IN_RADII = 0.7
# how far s / s_max may pass 1 at the last radius, beyond the shortest wavelength, and that times nodes^2 = g: the
# tail of E's series in s grows to cosh(2 sqrt(g)) times what it was, 1500; Lagrange's weight out there is at most
# 2.4e-3. A series of few nodes has a large tail: at g = 16 and a third beyond, 7 nodes lost 4 % of a ring
_BEYOND, _BEYOND_BY_NODES = 0.1, 16.0
_MOST_BYTES = 2**32  # of all rings' weights over s: 10 um under the default window need 2 GiB


def integrate(
    spectrum: NDArray[np.float32],
    radius_per_um: Array,
    s_max_per_um: float,
    rho: Array,
    quadratures: RingQuadratures,
    reflectance: Array,
) -> NDArray[np.float32]:
    """XYZ / (C cos ti) as Chebyshev terms of |w|, (rings, 3, w terms, azimuths).

    `spectrum` is E as `PolarSpectrum` keeps it, `reflectance` R (nodes of all rings' rules, w terms) at `w_nodes`.
    Raises AccuracyError where the heights ask for more than memory holds.
    """
    s_nodes, w_terms = spectrum.shape[2], reflectance.shape[1]
    points = line_points(radius_per_um, s_nodes, s_max_per_um, rho, quadratures)
    need = 4 * len(points.place) * s_nodes * w_terms
    if need > _MOST_BYTES:
        raise AccuracyError(
            f"the spectral integral of these heights would take {need / 2**30:.1f} GiB, more than "
            f"{_MOST_BYTES >> 30}; lower them (a scan's outliers: surface.clip_percentile), or raise accuracy.delta_e"
        )
    terms = spectral_operator.integrate(spectrum, radius_per_um, s_max_per_um, rho, points, quadratures, reflectance)
    return terms.reshape(len(rho), 3, w_terms, -1)


def line_points(
    radius_per_um: Array, s_nodes: int, s_max_per_um: float, rho: Array, quadratures: RingQuadratures
) -> LinePoints:
    """Points of every ring, over all of its wavelengths: of the ways that keep E's digits, the cheapest.

    `radius_per_um` of E ascends from 0, with ORDER / 2 radii beyond the farthest wavelength of every ring.
    """
    low, high = (
        1.0 / quadratures.lambda_um[i] for i in (quadratures.first + quadratures.count - 1, quadratures.first)
    )
    first, last = _about(radius_per_um, rho * low), _about(radius_per_um, rho * high) + ORDER - 1
    spacing = np.diff(radius_per_um)
    # what a step of kappa does to s: as a share of s_max, and in distances of its nodes; a step of r to kappa
    share_rate = 2.0 * pi * np.sqrt(np.maximum(4.0 - rho**2, 0.0)) / s_max_per_um
    s_rate = share_rate * (s_nodes - 1)
    kappa_rate = 1.0 / np.maximum(rho, np.finfo(np.float32).tiny)
    beyond = share_rate * kappa_rate * radius_per_um[last] - 1.0
    on_radii = (
        (first >= 0)
        & (s_rate * kappa_rate * spacing[last - 1] <= _STEP_ON_RADII)
        & (beyond <= min(_BEYOND, _BEYOND_BY_NODES / s_nodes**2))
    )
    # of points between radii: the rates at which E turns along r and along s add up; a line's points stay above 0
    step = 1.0 / (rho / (_STEP_IN_RADII * spacing[np.abs(first)]) + s_rate / _STEP_BETWEEN + ORDER / high)
    between = np.maximum(ORDER, np.ceil((high - low) / step).astype(int) + 1)
    radii, own = last + 1 - first, quadratures.count
    # off radii a point costs twice as much
    on_radii &= radii <= 2 * own
    on_nodes = ~on_radii & (own <= between)
    count = np.where(on_radii, radii, np.minimum(own, between))

    begin = np.cumsum(count) - count
    ring = np.repeat(np.arange(len(rho)), count)
    i = np.arange(len(ring)) - begin[ring]
    up = count[ring] - 1 - i
    kappa = high[ring] - up * step[ring]
    nodes = on_nodes[ring]
    kappa[nodes] = 1.0 / quadratures.lambda_um[(quadratures.first[ring] + up)[nodes]]
    place = np.where(on_radii[ring], first[ring] + i, _about(radius_per_um, rho[ring] * kappa))
    on = on_radii[ring]
    kappa[on] = radius_per_um[place[on]] / rho[ring[on]]
    return LinePoints(kappa, place, begin, count, on_radii, on_nodes)


def _about(radius_per_um: Array, r: Array) -> np.ndarray:
    """The first of the ORDER radii about r, negative near the origin."""
    half = ORDER // 2
    below = np.searchsorted(radius_per_um, r, side="right") - 1
    return np.clip(below, 0, len(radius_per_um) - 1 - half) - (half - 1)
