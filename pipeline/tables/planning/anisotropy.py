"""Where a surface sends its light, of first order in its height: azimuths crowd there, and probes go there."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Array
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f

_LEAST_STRETCH = 0.3
_CHANCE = 0.04  # the harmonic that speckle of no direction has
_ANGLE_BINS = 1024
_MIDDLING_PER_UM = 1.0


def anisotropy(built: Stack) -> tuple[float, float]:
    """How azimuths should crowd, (stretch, axis in radians), from where the surface scatters light.

    The second harmonic over azimuth of what is seen of it.
    """
    phi, seen = _scattering(built)
    harmonic = np.sum(seen * np.exp(2j * phi)) / max(float(seen.sum()), np.finfo(float).tiny)
    one_sided = max(0.0, abs(harmonic) - _CHANCE)
    stretch = max(_LEAST_STRETCH, (1.0 - one_sided) / (1.0 + one_sided))
    return float(stretch), float(0.5 * np.angle(harmonic))


def _scattering(built: Stack) -> tuple[Array, Array]:
    """Azimuths of the stack's frequencies, and how much of their light is seen: its cube root, as the eye does.

    Of first order in the height, and per area of (u, v); without the specular lobe, which is round and says nothing.
    """
    power = np.sum(built.coefficients[:, built.column_zero :, :, 1] ** 2, axis=2)
    fy = (np.arange(power.shape[0]) - built.row_zero)[:, None] * built.spacing_per_um[1]
    fx = np.arange(power.shape[1]) * built.spacing_per_um[0]
    r = np.hypot(fx, fy)
    seen = np.where(r > 6.0 * sigma_f(built.sigma_um), np.cbrt(power) / np.maximum(r, fx[1]), 0.0)
    return np.arctan2(fy, fx), np.asarray(seen, float)


def probing_angles(built: Stack, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Azimuths of half a turn to probe, and what each counts for in a mean over all.

    Half of them go where light goes: a grating's orders lie on one line that even angles would miss.
    """
    phi, seen = _scattering(built)
    lit, edges = np.histogram(phi % np.pi, bins=_ANGLE_BINS, range=(0.0, np.pi), weights=seen)
    # the window gives a line flanks, as wide as its transform is at a middling radius
    width = sigma_f(built.sigma_um) / _MIDDLING_PER_UM * _ANGLE_BINS / np.pi
    lit = gaussian_filter1d(lit, width, mode="wrap")
    share = 0.5 / _ANGLE_BINS + 0.5 * lit / max(float(lit.sum()), np.finfo(float).tiny)
    share /= share.sum()
    strata = (np.arange(count) + rng.random(count)) / count
    found = np.interp(strata, np.concatenate([[0.0], np.cumsum(share)]), edges)
    counts = 1.0 / share[np.minimum((found / np.pi * _ANGLE_BINS).astype(int), _ANGLE_BINS - 1)]
    return found, counts / counts.mean()
