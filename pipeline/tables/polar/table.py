"""The polar table: XYZ of |P|^2 on rings and azimuths, by Chebyshev polynomials in |w| and cubic B-splines.

XYZ / (C cos ti) = sum_k T_k(2 |w| / w_max - 1) table[ring, channel, k, azimuth],   w_max = sqrt(4 - rho^2)

where `table` is interpolated by bicubic B-splines. |w| <= w_max on a ring, because -(u, v, w) is the sum of two unit
vectors. Near the mirror direction a ring's spline has its knots at every second or fourth azimuth; in memory it is
refined to all of them, and a bundle stores the coefficients that it is made from.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernels import cubic_spline
from kernels.chebyshev import w_max
from pipeline.arrays import Array
from pipeline.diffraction.polar_grid import PolarGrid, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.diffraction.tiles import Tiles, thinned
from pipeline.optics.brdf import Radiometry, geometry_factor
from pipeline.optics.light import Quadrature
from pipeline.tables.polar import spectral_integral
from pipeline.tables.polar.spectral_integral import Integrand

# at the rim both |w| and w_max vanish: the divisor must exceed the rounding of 4 - rho^2 in the float32 of shaders
_LEAST_W_MAX = 1e-3
# rounding, in float32 as well, may place a direction on the rim beyond it
_RIM = 1.0 + 1e-6


@dataclass(frozen=True)
class PolarTable:
    """B-spline coefficients on a polar grid.

    values: float32 (rings, 3, w terms, azimuths): X, Y, Z and Chebyshev terms in |w|.
    tiles: of the grid, those that hold values, and the azimuths at which their splines have knots.
    """

    values: NDArray[np.float32]
    tiles: Tiles

    @property
    def grid(self) -> PolarGrid:
        """The rings and azimuths."""
        return self.tiles.grid

    @property
    def nbytes(self) -> int:
        """Bytes of the coefficients."""
        return self.values.nbytes

    @property
    def w_terms(self) -> int:
        """Number of Chebyshev terms in |w|."""
        return int(self.values.shape[2])

    def look_up(self, uvw: Array) -> Array:
        """Computes XYZ / (C cos ti) (directions, 3) at `uvw` (directions, 3); NaN outside the covered tiles."""
        rings, azimuths = self.grid.rings, self.grid.azimuths
        rho = np.hypot(uvw[:, 0], uvw[:, 1])
        ring = np.clip(rings.ring_from_rho(rho), 0.0, rings.count - 1.0)
        azimuth = azimuths.azimuth_from_uv(uvw[:, :2])
        covered = (rho <= rings.rho_max * _RIM) & self.tiles.covers(ring, azimuth)
        flat = self.values.reshape(rings.count, -1, azimuths.count)
        found = cubic_spline.look_up(flat, ring, azimuth, w_position(rho, uvw[:, 2])).astype(np.float64)
        found[~covered] = np.nan
        return found

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (directions,) for unit vectors wi, wr (directions, 3), as the function of this name."""
        return direction_factor(radiometry, wi, wr)


def direction_factor(radiometry: Radiometry, wi: Array, wr: Array) -> Array:
    """Computes the factor C cos(ti) (directions,) of look-ups for unit vectors wi, wr (directions, 3).

    For a metal, whose reflectance at every angle is part of the table, only G and w remain.
    """
    if radiometry.material.fresnel == "conductor":
        return geometry_factor(radiometry.material, wi, wr)
    return radiometry.direction_factor(wi, wr)


def build(power: PolarPowerSpectrum, rings: Rings, integrands: Sequence[Integrand], w_terms: int) -> list[PolarTable]:
    """Makes the tables of several lights from a power spectrum, in one pass over it.

    power: E. rings: those of the tables. integrands: each light's wavelengths, weights and R on every ring.
    w_terms: number of Chebyshev terms in |w|.
    Raises ResourceError if the spectral integral does not fit into memory.
    """
    of = power.values, power.radius_per_um, power.s_max_per_um, rings.rho()
    tiles, tables = thinned(PolarGrid(rings, power.azimuths)), []
    for samples in spectral_integral.integrate_all(*of, integrands, w_terms):
        values = cubic_spline.coefficients(samples.reshape(rings.count, 3 * w_terms, -1), tiles.every_of_ring)
        tables.append(PolarTable(values.reshape(samples.shape), tiles))
    return tables


def w_position(rho: Array, w: Array) -> Array:
    """Computes the argument of the Chebyshev polynomials, x = 2 |w| / w_max - 1 in [-1, 1], w_max = sqrt(4 - rho^2).

    rho, w: (...,), dimensionless. Returns x (...,).
    """
    return np.asarray(np.clip(2.0 * np.abs(w) / np.maximum(w_max(rho), _LEAST_W_MAX) - 1.0, -1.0, 1.0))


def unknown_share(grid: PolarGrid, band_per_um: tuple[float, float], light: Quadrature) -> float:
    """Computes the share of the light whose frequencies lie beyond the scan's Nyquist limits.

    grid: the rings and azimuths over whose disc the share is taken. band_per_um: the Nyquist limits (x, y), 1/um.
    light: wavelengths and weights, of which those of Y count.
    """
    rho, phi, area = grid.rings.rho(), grid.azimuths.phi(), grid.area()
    # along each azimuth the Nyquist limit is r = reach, so wavelengths shorter than rho / reach are lost
    reach = np.minimum(
        band_per_um[0] / np.maximum(np.abs(np.cos(phi)), 1e-12),
        band_per_um[1] / np.maximum(np.abs(np.sin(phi)), 1e-12),
    )
    shorter = np.concatenate([[0.0], np.cumsum(np.abs(light.weights[:, 1]))])
    lost = np.searchsorted(light.lambda_nm, 1e3 * rho[:, None] / reach, side="left")
    return float(np.sum(area * shorter[lost] / shorter[-1]) / np.sum(area))
