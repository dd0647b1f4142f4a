"""The spectral integral of E(r, phi, s) on rings, for lights, observers and reflectances.

docs/spectral_operator.md derives the operator.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernels import spectral_operator
from kernels.spectral_operator import LinePoints, Span
from pipeline import resources
from pipeline.arrays import Array
from pipeline.optics.brdf import grey
from pipeline.tables.polar import line_points
from pipeline.tables.polar.quadrature import RingQuadratures

# computes R (..., L), the factor inside the spectral integral, from wavelengths (L,), nm, and cosines of half angles
# (...,)
Reflectance = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Integrand:
    """A light with its observer and material: the wavelengths and weights of every ring, and R."""

    quadratures: RingQuadratures
    reflectance: Reflectance = grey


def integrate(
    power: NDArray[np.float32],
    radius_per_um: Array,
    s_max_per_um: float,
    rho: Array,
    quadratures: RingQuadratures,
    w_terms: int,
    reflectance: Reflectance = grey,
) -> NDArray[np.float32]:
    """Integrates the power spectrum over wavelengths for one light: XYZ / (C cos ti) = sum_l R_l |P|^2 weights.

    Returns Chebyshev coefficients (n_rings, 3, w_terms, azimuths); all else is that of `integrate_all`.
    """
    only = Integrand(quadratures, reflectance)
    return integrate_all(power, radius_per_um, s_max_per_um, rho, [only], w_terms)[0]


def integrate_all(
    power: NDArray[np.float32],
    radius_per_um: Array,
    s_max_per_um: float,
    rho: Array,
    integrands: Sequence[Integrand],
    w_terms: int,
) -> list[NDArray[np.float32]]:
    """Integrates the power spectrum over wavelengths for several lights, in one pass over E where they share points.

    power: float32 (tiles, n_r, s nodes, 16), the values of a `PolarPowerSpectrum`. radius_per_um: its radii (n_r,),
    1/um. s_max_per_um: end of the interval of its nodes in s, 1/um.
    rho: |(u, v)| of the rings (n_rings,), ascending, dimensionless. integrands: the lights.
    w_terms: number of Chebyshev terms in |w|, a multiple of 4.
    Returns each light's Chebyshev coefficients in x = 2 |w| / w_max - 1, (n_rings, 3, w_terms, azimuths), the same to
    the last bit as alone. Raises ResourceError if the weights over s do not fit into memory. See
    docs/spectral_operator.md.
    """
    s_nodes, of = power.shape[2], (radius_per_um, s_max_per_um, rho)
    points = [line_points.choose(radius_per_um, s_nodes, *of[1:], each.quadratures) for each in integrands]
    resources.require(
        "the weights of the spectral integral",
        4 * sum(len(each.place) for each in points) * s_nodes * w_terms,
        "lower the heights (a scan's outliers: surface.clip_percentile) or raise accuracy.delta_e",
    )
    spans = [spectral_operator.whole_span(rho, each) for each in points]
    lights = [on_rings(rho, *each, w_terms) for each in zip(points, spans, integrands, strict=True)]
    found, at_once = [], spectral_operator.most_lights(w_terms)
    for first in range(0, len(lights), at_once):
        found += [*spectral_operator.integrate(power, *of, lights[first : first + at_once])]
    return [terms.reshape(len(rho), 3, w_terms, -1) for terms in found]


def on_rings(
    rho: Array, points: LinePoints, span: Span, integrand: Integrand, w_terms: int
) -> spectral_operator.RingIntegrals:
    """Computes a light's reflectance where the rings take E.

    rho: |(u, v)| of the rings (n_rings,). points: of these rings. span: of the nodes in |w|. w_terms: their number.
    """
    w = spectral_operator.group_w(points, span, w_terms)
    reflected = _at_nodes(integrand.reflectance, rho, w, integrand.quadratures)
    return spectral_operator.RingIntegrals(points, span, integrand.quadratures, reflected)


@dataclass(frozen=True)
class IntegralSize:
    """The size of a spectral integral, known before its table is made.

    points, ring_points: numbers of interpolation points (`line_points.counts`). wavelengths: of all rings together.
    longest: of one ring. rings, s_nodes, w_terms, azimuths: as in `integrate`.
    """

    points: int
    ring_points: int
    wavelengths: int
    longest: int
    rings: int
    s_nodes: int
    w_terms: int
    azimuths: int

    @property
    def table_bytes(self) -> int:
        """Bytes of the result, which becomes the table."""
        return 4 * 3 * self.rings * self.w_terms * self.azimuths

    @property
    def weights_bytes(self) -> int:
        """Bytes of the operator, on the device."""
        numbers = spectral_operator.operator_numbers(
            self.points, self.ring_points, self.rings, self.s_nodes, self.w_terms
        )
        return 4 * sum(numbers)

    def arrays(self, *, metal: bool = False) -> resources.Arrays:
        """Lists the arrays of `integrate`.

        The reflectance exists here and on the device. Matrices between the nodes in |w| are made in float64 and
        copied as float32. A metal's reflectance is computed for all rings of one quadrature, in four complex arrays.
        """
        fresnel = (4 * 16 + 8) * self.w_terms * min(self.wavelengths, self.rings * self.longest) if metal else 0
        return {
            "table": self.table_bytes,
            "weights of the spectral integral": self.weights_bytes,
            "reflectance of the rings": 2 * 4 * self.wavelengths * self.w_terms + fresnel,
            "matrices in |w|": (3 * 8 + 2 * 4) * self.rings * self.w_terms**2,
        }

    @property
    def seconds(self) -> float:
        """Estimates the time of `integrate`: E over s at the points, and then the wavelengths of all rings."""
        sums = self.points * self.s_nodes + 3 * self.ring_points
        return resources.seconds(float(sums) * self.w_terms * self.azimuths)


def size(
    radius_per_um: Array,
    s_nodes: int,
    s_max_per_um: float,
    rho: Array,
    quadratures: RingQuadratures,
    w_terms: int,
    azimuths: int,
) -> IntegralSize:
    """Computes the size of a spectral integral; the parameters are those of `integrate`, with the azimuths of E."""
    counts = line_points.counts(radius_per_um, s_nodes, s_max_per_um, rho, quadratures)
    wavelengths, longest = int(quadratures.count.sum()), int(quadratures.count.max())
    return IntegralSize(*counts, wavelengths, longest, len(rho), s_nodes, w_terms, azimuths)


def _at_nodes(reflectance: Reflectance, rho: Array, w: Array, quadratures: RingQuadratures) -> NDArray[np.float32]:
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
