"""The azimuths into which a surface scatters light, to first order in its height."""

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f

_LEAST_STRETCH = 0.3
_NOISE = 0.04  # second azimuthal harmonic of isotropic speckle, measured
_ANGLE_BINS = 1024
_TYPICAL_RADIUS_PER_UM = 1.0


class Scattering:
    """The visible scattered light of a surface by azimuth: its second harmonic, and a histogram over half a turn."""

    def __init__(self, built: Stack) -> None:
        """Sums the light over all frequencies, in one pass for all who ask.

        built: a Chebyshev stack.
        """
        phi, seen = _scattering(built)
        self._sigma_um = built.sigma_um
        self._harmonic = np.sum(seen * np.exp(2j * phi)) / max(float(seen.sum()), np.finfo(float).tiny)
        self._lit, self._edges = np.histogram(phi % np.pi, bins=_ANGLE_BINS, range=(0.0, np.pi), weights=seen)

    def anisotropy(self) -> tuple[float, float]:
        """Computes how azimuths should be stretched.

        Returns the stretch and the axis, radians, of `polar_grid.Azimuths`.
        """
        one_sided = max(0.0, abs(self._harmonic) - _NOISE)
        stretch = max(_LEAST_STRETCH, (1.0 - one_sided) / (1.0 + one_sided))
        return float(stretch), float(0.5 * np.angle(self._harmonic))

    def probing_angles(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draws azimuths of half a turn for test directions, by stratified importance sampling.

        Half of them follow the scattered light, since the orders of a grating lie on a line that evenly spaced
        azimuths would miss.

        count: number of azimuths. rng: source of random numbers.
        Returns the azimuths (count,), radians, and their weights (count,) in a mean over all azimuths, of mean 1.
        """
        # the window widens a line; a typical radius sets the angle
        width = sigma_f(self._sigma_um) / _TYPICAL_RADIUS_PER_UM * _ANGLE_BINS / np.pi
        gain = np.exp(-2.0 * (np.pi * width * np.fft.rfftfreq(_ANGLE_BINS)) ** 2)
        # rounding may leave less than nothing in the dark
        lit = np.maximum(np.fft.irfft(np.fft.rfft(self._lit) * gain, _ANGLE_BINS), 0.0)
        share = 0.5 / _ANGLE_BINS + 0.5 * lit / max(float(lit.sum()), np.finfo(float).tiny)
        share /= share.sum()
        strata = (np.arange(count) + rng.random(count)) / count
        found = np.interp(strata, np.concatenate([[0.0], np.cumsum(share)]), self._edges)
        counts = 1.0 / share[np.minimum((found / np.pi * _ANGLE_BINS).astype(int), _ANGLE_BINS - 1)]
        return found, counts / counts.mean()


def _scattering(built: Stack) -> tuple[Array, Array]:
    """Computes the azimuths of the stack's frequencies, radians, and the visible light there, both (rows, columns).

    The light is that of first order in the height, per area of (u, v); its cube root is the response of the eye. The
    specular lobe, which is isotropic, is excluded.
    """
    power = np.sum(built.coefficients[:, built.column_zero :, :, 1] ** 2, axis=2)
    fy = (np.arange(power.shape[0]) - built.row_zero)[:, None] * built.spacing_per_um[1]
    fx = np.arange(power.shape[1]) * built.spacing_per_um[0]
    r = np.hypot(fx, fy)
    seen = np.where(r > 6.0 * sigma_f(built.sigma_um), np.cbrt(power) / np.maximum(r, fx[1]), 0.0)
    return np.arctan2(fy, fx), np.asarray(seen, float)
