"""The polar power spectrum E(r, phi, s) = |P(r (cos phi, sin phi); s)|^2 of a surface, with s = k |w|.

It depends on no illuminant, observer or material: |P|^2(u, v, w; lambda) = E(rho / lambda, phi, 2 pi |w| / lambda),
where (rho, phi) are the polar coordinates of (u, v). E is interpolated between Chebyshev nodes in s and, by Lagrange
polynomials, between radii; its azimuths are those of the tables made from it.
"""

from dataclasses import dataclass, replace
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from kernels import polar_power_spectrum
from kernels.chebyshev import chebyshev
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.diffraction.upload import upload
from pipeline.optics.coherence import sigma_f
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import MIDDLE, Places

# distances of radii in sigma_f. At a distance of 1, interpolation on 8 radii errs by up to a tenth of E, which an
# integral over wavelengths averages out and a laser line does not. Over the specular lobe and its flank, which is
# steep, nothing averages.
SPACING, SPACING_OF_A_LINE, _SPACING_AT_ZERO = 1.0, 0.4, 0.25
_LOBE, _COARSENS_UNTIL = 6.0, 30.0  # sigma_f
_SPARE_RADII = 5
# s_max in units of 4 pi / lambda_min. The margin lets neighbouring rings share interpolation points: the spectral
# integral takes 12 to 25 % less work for one more Chebyshev node
S_REACH = 1.1
_CONTRAST_AZIMUTHS = 65


@dataclass(frozen=True)
class PolarPowerSpectrum:
    """The power spectrum E on radii, azimuths and Chebyshev nodes in s.

    values: float32 (tiles, radii, s nodes, 16), azimuth 16 tile + lane; 0 beyond the scan's Nyquist limits.
    radius_per_um: radii (n_r,), 1/um, ascending from 0. azimuths: those of the tables.
    s_max_per_um: end of the interval [0, s_max] of the Chebyshev nodes, 1/um.
    sigma_um: standard deviation of the coherence window, um. band_per_um: the scan's Nyquist limits (x, y), 1/um.
    """

    values: NDArray[np.float32]
    radius_per_um: Array
    azimuths: Azimuths
    s_max_per_um: float
    sigma_um: float
    band_per_um: tuple[float, float]

    @property
    def nbytes(self) -> int:
        """Size of E in bytes."""
        return self.values.nbytes

    @property
    def s_per_um(self) -> Array:
        """Nodes (n_s,) in s = 2 pi |w| / lambda, 1/um."""
        return s_nodes(self.values.shape[2], self.s_max_per_um)

    def thinned(self, every: int) -> "PolarPowerSpectrum":
        """Keeps every `every`-th azimuth; the number that remains must be a multiple of `polar_grid.TILE`."""
        tiles, radii, nodes, lanes = self.values.shape
        flat = np.moveaxis(self.values, 3, 1).reshape(tiles * lanes, radii, nodes)[::every]
        values = np.moveaxis(flat.reshape(-1, lanes, radii, nodes), 1, 3)
        azimuths = replace(self.azimuths, count=self.azimuths.count // every)
        return replace(self, values=np.ascontiguousarray(values), azimuths=azimuths)


def speckle_contrast(power: PolarPowerSpectrum) -> float:
    """Computes the variance of E relative to its squared local mean.

    It is 1 for fully developed speckle, and 1 / n for the mean over n independent windows. It is taken over azimuths
    at the middle node in s, and is the median over the radii beyond the specular lobe; 0 where a narrow cone of views
    has none.
    """
    tiles, radii, nodes, lanes = power.values.shape
    if radii - _SPARE_RADII <= radii // 4:
        return 0.0
    e = np.moveaxis(power.values[:, radii // 4 : -_SPARE_RADII, nodes // 2], 2, 1).reshape(tiles * lanes, -1)
    kernel = np.ones(min(_CONTRAST_AZIMUTHS, len(e)))
    kernel /= len(kernel)
    # E is periodic in the azimuth
    local = np.fft.irfft(np.fft.rfft(e, axis=0) * np.fft.rfft(kernel, len(e))[:, None], len(e), axis=0)
    local = np.maximum(np.roll(local, -(len(kernel) // 2), axis=0), np.finfo(np.float32).tiny)
    return float(np.median(np.mean((e / local - 1.0) ** 2, axis=0)))


def power_spectrum_bytes(azimuths: int, radii: int, nodes: int) -> int:
    """Computes the size of E, bytes."""
    return 4 * azimuths * radii * nodes


def contrast_bytes(azimuths: int, radii: int) -> int:
    """Computes the memory in which `speckle_contrast` works, bytes: E of one node, and its transforms and means."""
    return (3 * 8 + 3 * 4) * azimuths * (radii - radii // 4)


def s_nodes(count: int, s_max_per_um: float) -> Array:
    """Computes `count` Chebyshev nodes (count,) on [0, s_max], 1/um."""
    return np.asarray(0.5 * s_max_per_um * (1.0 + chebyshev(count)[1]))


def radii(sigma_um: float, r_max_per_um: float, spacing: float = SPACING) -> Array:
    """Chooses the radii of E: from 0 to `r_max_per_um`, and a few beyond it for interpolation.

    sigma_um: standard deviation of the coherence window, um. r_max_per_um: the largest |f| of a table, 1/um.
    spacing: distance of the radii away from the origin, in widths sigma_f of the window's transform.
    Returns the radii (n_r,), 1/um, ascending from 0.
    """
    width = sigma_f(sigma_um)
    nodes = [0.0]
    while nodes[-1] < r_max_per_um:
        share = min(1.0, max(0.0, nodes[-1] / width - _LOBE) / (_COARSENS_UNTIL - _LOBE))
        nodes.append(nodes[-1] + width * (_SPACING_AT_ZERO + (spacing - _SPACING_AT_ZERO) * share))
    return np.array(nodes + [nodes[-1] + width * spacing * i for i in range(1, _SPARE_RADII)])


def chebyshev_stack(
    field: HeightField,
    sigma_um: float,
    reach_per_um: float,
    terms: int,
    tolerance: float,
    progress: Progress = silent,
    *,
    whole: bool = False,
) -> dft_stack.Stack:
    """Builds the float32 Chebyshev stack from which E is gathered.

    Its last axis is filled to whole vectors: they cost the same, and the device uses them without a copy.

    field: heights. sigma_um: standard deviation of the coherence window, um.
    reach_per_um: the largest radius of E, 1/um. terms: number of Chebyshev terms.
    tolerance: amplitude, relative to its peak, at which the window and its transform are cut.
    whole: whether the stack is for windows anywhere on the patch, not for the one in the middle alone.
    Returns the stack. Raises AccuracyError and DeviceError as `dft_stack.build` does.
    """
    filled = filled_terms(terms)
    built = dft_stack.build(
        field, "chebyshev", filled, sigma_um, reach_per_um, tolerance, progress, np.float32, whole=whole
    )
    return replace(built, terms=terms)


def filled_terms(terms: int) -> int:
    """Computes the length of the last axis of such a stack."""
    return polar_power_spectrum.LANES * ceil(terms / polar_power_spectrum.LANES)


def s_max(lambda_min_nm: float) -> float:
    """Computes the largest s = k |w| of E, 1/um: S_REACH times that of |w| = 2 at the shortest wavelength, nm."""
    return S_REACH * 2.0 * pi * expansion.W_MAX / (1e-3 * lambda_min_nm)


def gather(
    built: dft_stack.Stack,
    half_turn: Array,
    radius_per_um: Array,
    lambda_min_nm: float,
    nodes: int,
    places: Places = MIDDLE,
) -> NDArray[np.float32]:
    """Computes E at azimuths of half a turn and at their opposites, by the Jacobi-Anger expansion.

    built: a Chebyshev stack. half_turn: azimuths (a,), radians, a multiple of 16. radius_per_um: radii (n_r,), 1/um.
    lambda_min_nm: shortest wavelength, nm, which sets s_max. nodes: number of Chebyshev nodes in s.
    places: positions of the window; for several, E is the mean over them, and the stack is one of the whole patch.
    Returns E (2 a / 16, n_r, nodes, 16), first the given azimuths, then their opposites. Raises DeviceError if no
    device works.
    """
    n = np.arange(built.terms)[:, None]
    # w < 0 makes the argument of the Jacobi-Anger expansion negative, and J_n(-z) = (-1)^n J_n(z)
    phase = s_nodes(nodes, s_max(lambda_min_nm)) * built.half_range_um
    bessel = np.where(n == 0, 1.0, 2.0) * (-1.0) ** n * expansion.bessel(built.terms, phase)
    modes = None
    if places != MIDDLE:
        x, y = dft_stack.modes(built, places)
        modes = polar_power_spectrum.padded(x), polar_power_spectrum.padded(y)
    return polar_power_spectrum.gather(upload(built), radius_per_um, half_turn, bessel, modes)


def build(
    built: dft_stack.Stack,
    azimuths: Azimuths,
    radius_per_um: Array,
    lambda_min_nm: float,
    nodes: int,
    places: Places = MIDDLE,
) -> PolarPowerSpectrum:
    """Computes the power spectrum of a Chebyshev stack for s up to `s_max`.

    built: the stack. azimuths: those of the tables. radius_per_um: radii (n_r,), 1/um, ascending from 0.
    lambda_min_nm: shortest wavelength, nm. nodes: number of Chebyshev nodes in s. places: as in `gather`.
    Raises DeviceError if no device works.
    """
    values = gather(built, azimuths.phi()[: azimuths.count // 2], radius_per_um, lambda_min_nm, nodes, places)
    return PolarPowerSpectrum(
        values, radius_per_um, azimuths, s_max(lambda_min_nm), built.sigma_um, built.band_per_um
    )
