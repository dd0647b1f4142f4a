"""The spectral integral of E(r, phi, s) on rings, for a light, an observer and a reflectance.

docs/spectral_operator.md derives the operator.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kernels import spectral_operator
from pipeline.arrays import Array
from pipeline.errors import AccuracyError
from pipeline.optics.brdf import grey
from pipeline.tables.polar import line_points
from pipeline.tables.polar.quadrature import RingQuadratures

_MOST_BYTES = 2**32  # size of the weights over s of all rings: heights of 10 um need 2 GiB for the default window


# computes R (..., L), the factor inside the spectral integral, from wavelengths (L,), nm, and cosines of half angles
# (...,)
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
    """Integrates the power spectrum over wavelengths: XYZ / (C cos ti) = sum_l R_l |P|^2 weights.

    power: float32 (tiles, n_r, s nodes, 16), the values of a `PolarPowerSpectrum`. radius_per_um: its radii (n_r,),
    1/um. s_max_per_um: end of the interval of its nodes in s, 1/um.
    rho: |(u, v)| of the rings (n_rings,), ascending, dimensionless. quadratures: their wavelengths and weights.
    w_terms: number of Chebyshev terms in |w|, a multiple of 4. reflectance: R.
    Returns Chebyshev coefficients in x = 2 |w| / w_max - 1, (n_rings, 3, w_terms, azimuths). Raises AccuracyError if
    the weights over s do not fit into memory. See docs/spectral_operator.md.
    """
    s_nodes = power.shape[2]
    points = line_points.choose(radius_per_um, s_nodes, s_max_per_um, rho, quadratures)
    need = 4 * len(points.place) * s_nodes * w_terms
    if need > _MOST_BYTES:
        raise AccuracyError(
            f"the spectral integral of these heights needs {need / 2**30:.1f} GiB, more than the "
            f"{_MOST_BYTES >> 30} GiB allowed. Lower the heights (a scan's outliers: surface.clip_percentile) or "
            "raise accuracy.delta_e."
        )
    reflected = at_nodes(reflectance, rho, spectral_operator.group_w(rho, points, w_terms), quadratures)
    terms = spectral_operator.integrate(power, radius_per_um, s_max_per_um, rho, points, quadratures, reflected)
    return terms.reshape(len(rho), 3, w_terms, -1)


def at_nodes(reflectance: Reflectance, rho: Array, w: Array, quadratures: RingQuadratures) -> NDArray[np.float32]:
    """Computes the reflectance at the wavelengths and the nodes in w of every ring.

    (u, v, w) = -wi - wr, so cos(half angle) = sqrt(rho^2 + w^2) / 2.

    rho: (n_rings,), dimensionless. w: |w| of the nodes (n_rings, w terms). quadratures: wavelengths of the rings.
    Returns R (wavelengths of all rings, w terms), ring by ring.
    """
    cos_half = 0.5 * np.hypot(rho[:, None], w)
    found = np.empty((int(quadratures.count.sum()), w.shape[1]), np.float32)
    # consecutive rings mostly have the same quadrature
    changes = (np.diff(quadratures.first) != 0) | (np.diff(quadratures.count) != 0)
    runs, at = np.split(np.arange(len(rho)), np.flatnonzero(changes) + 1), 0
    for rings in runs:
        first, count = int(quadratures.first[rings[0]]), int(quadratures.count[rings[0]])
        lambda_nm = 1e3 * quadratures.lambda_um[first : first + count]
        rows = found[at : at + len(rings) * count].reshape(len(rings), count, -1)
        rows[...] = np.moveaxis(reflectance(lambda_nm, cos_half[rings]), -1, 1)
        at += len(rings) * count
    return found
