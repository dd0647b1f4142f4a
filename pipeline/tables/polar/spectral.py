"""The spectral form of a table, for spectral renderers: |P|^2 of single wavelengths, without integration.

I_lambda(u, v, w) = E(rho / lambda, phi, 2 pi |w| / lambda), interpolated by cubic B-splines over azimuths, Lagrange
polynomials over radii and Chebyshev polynomials over s. It holds for all wavelengths from the shortest one of E on.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernels.chebyshev import chebyshev
from pipeline.arrays import Array
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum

_ORDER = 8  # radii per interpolation; with four the error is ten times as large
_AT_ONCE = 2048


@dataclass(frozen=True)
class SpectralTable:
    """The power spectrum as spline coefficients over azimuths.

    values: float32 (azimuths, radii, s terms): Chebyshev coefficients over s of the spline coefficients of E.
    source: the power spectrum.
    """

    values: NDArray[np.float32]
    source: PolarPowerSpectrum


def build(power: PolarPowerSpectrum) -> SpectralTable:
    """Makes the spectral table of a power spectrum."""
    tiles, radii, nodes, lanes = power.values.shape
    e = np.moveaxis(power.values, 3, 1).reshape(tiles * lanes, radii, nodes)
    terms, _ = chebyshev(nodes)
    in_s = e @ terms.T.astype(np.float32)
    # samples of a periodic B-spline are its coefficients convolved with (1, 4, 1) / 6
    through = (4.0 + 2.0 * np.cos(2.0 * np.pi * np.fft.rfftfreq(len(e)))) / 6.0
    values = np.fft.irfft(np.fft.rfft(in_s, axis=0) / through[:, None, None], len(e), axis=0)
    return SpectralTable(values.astype(np.float32), power)


def building_bytes(power_spectrum_bytes: int) -> int:
    """Computes the memory in which `build` works, bytes, from the size of E.

    E in another order, its terms in s, their transform and its quotient (complex), and the way back in float64.
    """
    return 8 * power_spectrum_bytes


def look_up(table: SpectralTable, uvw: Array, lambda_nm: Array) -> Array:
    """Computes I_lambda of directions and wavelengths.

    uvw: (directions, 3). lambda_nm: wavelengths (L,), nm.
    Returns (directions, L): NaN outside the radii and the s of E, 0 beyond the scan's Nyquist limits.
    """
    lambda_um = 1e-3 * np.asarray(lambda_nm, float)
    shape = len(uvw), len(lambda_um)
    r = np.hypot(uvw[:, 0], uvw[:, 1])[:, None] / lambda_um
    s = 2.0 * np.pi * np.abs(uvw[:, 2])[:, None] / lambda_um
    azimuth = np.broadcast_to(table.source.azimuths.azimuth_from_uv(uvw[:, :2])[:, None], shape)
    flat = [np.ascontiguousarray(a).ravel() for a in (r, s, azimuth)]
    parts = [_at(table, *(a[first : first + _AT_ONCE] for a in flat)) for first in range(0, len(flat[0]), _AT_ONCE)]
    return np.concatenate(parts).reshape(shape)


def _at(table: SpectralTable, r: Array, s: Array, azimuth: Array) -> Array:
    source = table.source
    count, radii, terms = table.values.shape
    first, along_r = _lagrange(source.radius_per_um, r)
    cell = np.floor(azimuth).astype(int)
    along_phi = _spline(azimuth - cell)
    x = 2.0 * s / source.s_max_per_um - 1.0
    along_s = np.cos(np.arange(terms) * np.arccos(np.clip(x, -1.0, 1.0))[:, None])
    total = np.zeros(len(r))
    for i in range(_ORDER):
        # E(-r, phi) = E(r, phi + pi)
        ring = first + i
        turned = np.where(ring < 0, count // 2, 0)
        for j in range(4):
            picked = table.values[(cell - 1 + j + turned) % count, np.abs(ring)]
            total += along_r[:, i] * along_phi[:, j] * np.einsum("dk,dk->d", picked, along_s)
    reached = (r <= source.radius_per_um[radii - _ORDER // 2]) & (x <= 1.0 + 1e-9)
    return np.where(reached, total, np.nan)


def _lagrange(nodes: Array, r: Array) -> tuple[NDArray[np.intp], Array]:
    """Finds the first node about each r, negative if nodes are mirrored at 0, and the weights (len(r), _ORDER)."""
    below = np.clip(np.searchsorted(nodes, r, side="right") - 1, 0, len(nodes) - 2)
    first = np.minimum(below - (_ORDER // 2 - 1), len(nodes) - _ORDER)
    index = first[:, None] + np.arange(_ORDER)
    places = np.sign(index + 0.5) * nodes[np.abs(index)]
    weights = np.ones_like(places)
    for a in range(_ORDER):
        for b in range(_ORDER):
            if a != b:
                weights[:, a] *= (r - places[:, b]) / (places[:, a] - places[:, b])
    return first, weights


def _spline(t: Array) -> Array:
    """Computes the four weights (..., 4) of the cubic B-spline at fractions t (...,)."""
    u = 1.0 - t
    return np.stack([u**3, 4.0 - 3.0 * t * t * (2.0 - t), 4.0 - 3.0 * u * u * (2.0 - u), t**3], axis=-1) / 6.0
