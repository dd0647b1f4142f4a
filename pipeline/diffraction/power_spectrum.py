"""The polar power spectrum E(r, phi, s) = |P(r (cos phi, sin phi); s)|^2: what a surface does to any light.

It knows no illuminant, observer or material: |P|^2(u, v, w; lambda) = E(rho / lambda, phi, 2 pi |w| / lambda) with
(rho, phi) the polar form of (u, v). Nodes in s are Chebyshev's, so E between them is a polynomial; nodes in r serve
Lagrange interpolation; azimuths are those of the tables made from it.
"""

from dataclasses import dataclass, replace
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray
from scipy.special import jv

from kernels import polar_power_spectrum
from kernels.chebyshev import chebyshev
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.upload import upload
from pipeline.optics.coherence import sigma_f
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

# distances of radii in sigma_f. At one, interpolation on 8 nodes leaves up to a tenth of E, which an integral over
# wavelengths averages out; a laser line shows it. Near the origin the lobe's flank is seen at full contrast.
SPACING, SPACING_OF_A_LINE, _SPACING_AT_ZERO = 1.0, 0.4, 0.25
_COARSENS_OVER = 30.0  # sigma_f
_SPARE_RADII = 5
# how far E goes on in s, in |w| = 2 at the shortest wavelength: that far, rings of a table share its points, which
# saves an eighth to a quarter of the operator for one node in s
S_REACH = 1.1
_CONTRAST_AZIMUTHS = 65


@dataclass(frozen=True)
class PolarPowerSpectrum:
    """E on radii, azimuths and nodes in s.

    values: float32 (tiles, radii, s nodes, 16): azimuth 16 tile + lane; 0 beyond the scan's band.
    radius_per_um: (radii,) ascending from 0. s_max_per_um: E is known for s in [0, s_max], at Chebyshev's nodes.
    """

    values: NDArray[np.float32]
    radius_per_um: Array
    azimuths: Azimuths
    s_max_per_um: float
    sigma_um: float
    band_per_um: tuple[float, float]

    @property
    def nbytes(self) -> int:
        """Bytes of E."""
        return self.values.nbytes

    @property
    def s_per_um(self) -> Array:
        """The nodes in s = 2 pi |w| / lambda, 1/um."""
        return s_nodes(self.values.shape[2], self.s_max_per_um)

    def thinned(self, every: int) -> "PolarPowerSpectrum":
        """The same on every `every`-th azimuth; what is left must fill whole tiles of both half turns."""
        tiles, radii, nodes, lanes = self.values.shape
        flat = np.moveaxis(self.values, 3, 1).reshape(tiles * lanes, radii, nodes)[::every]
        values = np.moveaxis(flat.reshape(-1, lanes, radii, nodes), 1, 3)
        azimuths = replace(self.azimuths, count=self.azimuths.count // every)
        return replace(self, values=np.ascontiguousarray(values), azimuths=azimuths)


def speckle_contrast(power: PolarPowerSpectrum) -> float:
    """Variance of E over its squared local mean: 1 for the speckle of one window, 1 / n for the mean of n.

    Taken over azimuths, at the radii beyond the specular lobe and the middle node in s; where E is dark or smooth it
    counts as little.
    """
    tiles, radii, nodes, lanes = power.values.shape
    e = np.moveaxis(power.values[:, radii // 4 : -_SPARE_RADII, nodes // 2], 2, 1).reshape(tiles * lanes, -1)
    kernel = np.ones(min(_CONTRAST_AZIMUTHS, len(e)))
    kernel /= len(kernel)
    # around the turn: E is periodic
    local = np.fft.irfft(np.fft.rfft(e, axis=0) * np.fft.rfft(kernel, len(e))[:, None], len(e), axis=0)
    local = np.maximum(np.roll(local, -(len(kernel) // 2), axis=0), np.finfo(np.float32).tiny)
    return float(np.median(np.mean((e / local - 1.0) ** 2, axis=0)))


def s_nodes(count: int, s_max_per_um: float) -> Array:
    """Chebyshev's nodes on [0, s_max]."""
    return np.asarray(0.5 * s_max_per_um * (1.0 + chebyshev(count)[1]))


def radii(sigma_um: float, r_max_per_um: float, spacing: float = SPACING) -> Array:
    """Radii from 0 to `r_max_per_um` and a few beyond, 1/um; `spacing` in widths of the window's transform."""
    width = sigma_f(sigma_um)
    nodes = [0.0]
    while nodes[-1] < r_max_per_um:
        share = min(1.0, nodes[-1] / (_COARSENS_OVER * width))
        nodes.append(nodes[-1] + width * (_SPACING_AT_ZERO + (spacing - _SPACING_AT_ZERO) * share))
    return np.array(nodes + [nodes[-1] + width * spacing * i for i in range(1, _SPARE_RADII)])


def chebyshev_stack(
    field: HeightField,
    sigma_um: float,
    reach_per_um: float,
    terms: int,
    tolerance: float,
    progress: Progress = silent,
) -> dft_stack.Stack:
    """The float32 stack that E out to `reach_per_um` gathers from.

    It fills whole vectors: they cost the same, and are shared with the device without a copy.
    """
    filled = polar_power_spectrum.LANES * ceil(terms / polar_power_spectrum.LANES)
    built = dft_stack.build(field, "chebyshev", filled, sigma_um, reach_per_um, tolerance, progress, np.float32)
    return replace(built, terms=terms)


def s_max(lambda_min_nm: float) -> float:
    """The largest s = k |w| of E, 1/um: somewhat beyond |w| = 2 at the shortest wavelength."""
    return S_REACH * 2.0 * pi * expansion.W_MAX / (1e-3 * lambda_min_nm)


def gather(
    built: dft_stack.Stack, half_turn: Array, radius_per_um: Array, lambda_min_nm: float, nodes: int
) -> NDArray[np.float32]:
    """E (tiles, radii, nodes, 16) at azimuths of half a turn (radians, a multiple of 16), then at their opposites.

    Raises DeviceError where no device works.
    """
    n = np.arange(built.terms)[:, None]
    # w < 0 makes s negative in Jacobi-Anger, and J_n(-z) = (-1)^n J_n(z)
    phase = s_nodes(nodes, s_max(lambda_min_nm)) * built.half_range_um
    bessel = np.where(n == 0, 1.0, 2.0) * (-1.0) ** n * jv(n, phase)
    return polar_power_spectrum.gather(upload(built), radius_per_um, half_turn, bessel)


def build(
    built: dft_stack.Stack, azimuths: Azimuths, radius_per_um: Array, lambda_min_nm: float, nodes: int
) -> PolarPowerSpectrum:
    """E of a Chebyshev stack on given azimuths and radii, out to `s_max`."""
    values = gather(built, azimuths.angles()[: azimuths.count // 2], radius_per_um, lambda_min_nm, nodes)
    return PolarPowerSpectrum(
        values, radius_per_um, azimuths, s_max(lambda_min_nm), built.sigma_um, built.band_per_um
    )
