"""The spectral integral of E(r, phi, s) on rings, under a light, an observer and a reflectance."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kernels import spectral_operator
from pipeline.arrays import Array
from pipeline.errors import AccuracyError
from pipeline.optics.brdf import grey
from pipeline.tables.polar import line_points
from pipeline.tables.polar.quadrature import RingQuadratures

_MOST_BYTES = 2**32  # of all rings' weights over s: 10 um under the default window need 2 GiB


# R (..., L) inside the spectral integral from wavelengths in nm (L,) and cosines of half angles (...,)
Reflectance = Callable[[Array, Array], Array]


def integrate(
    power: NDArray[np.float32],
    radius_per_um: Array,
    s_max_per_um: float,
    rho: Array,
    quadratures: RingQuadratures,
    w_terms: int,
    reflectance: Reflectance = grey,
) -> NDArray[np.float32]:
    """XYZ / (C cos ti) as Chebyshev terms of |w|, (rings, 3, w terms, azimuths).

    `power` is E as `PolarPowerSpectrum` keeps it; `rho` ascends. Raises AccuracyError where the heights ask
    for more than memory holds.
    """
    s_nodes = power.shape[2]
    points = line_points.choose(radius_per_um, s_nodes, s_max_per_um, rho, quadratures)
    need = 4 * len(points.place) * s_nodes * w_terms
    if need > _MOST_BYTES:
        raise AccuracyError(
            f"the spectral integral of these heights would take {need / 2**30:.1f} GiB, more than "
            f"{_MOST_BYTES >> 30}; lower them (a scan's outliers: surface.clip_percentile), or raise accuracy.delta_e"
        )
    reflected = at_nodes(reflectance, rho, spectral_operator.group_w(rho, points, w_terms), quadratures)
    terms = spectral_operator.integrate(power, radius_per_um, s_max_per_um, rho, points, quadratures, reflected)
    return terms.reshape(len(rho), 3, w_terms, -1)


def at_nodes(reflectance: Reflectance, rho: Array, w: Array, quadratures: RingQuadratures) -> NDArray[np.float32]:
    """R (nodes of all rings' rules, w terms) at every ring's `w` (rings, w terms).

    (u, v, w) = -wi - wr, so cos(half angle) = sqrt(rho^2 + w^2) / 2.
    """
    cos_half = 0.5 * np.hypot(rho[:, None], w)
    found = np.empty((int(quadratures.count.sum()), w.shape[1]), np.float32)
    # rings that follow each other mostly share a rule
    changes = (np.diff(quadratures.first) != 0) | (np.diff(quadratures.count) != 0)
    runs, at = np.split(np.arange(len(rho)), np.flatnonzero(changes) + 1), 0
    for rings in runs:
        first, count = int(quadratures.first[rings[0]]), int(quadratures.count[rings[0]])
        lambda_nm = 1e3 * quadratures.lambda_um[first : first + count]
        rows = found[at : at + len(rings) * count].reshape(len(rings), count, -1)
        rows[...] = np.moveaxis(reflectance(lambda_nm, cos_half[rings]), -1, 1)
        at += len(rings) * count
    return found
