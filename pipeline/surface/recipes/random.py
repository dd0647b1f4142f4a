"""Periodic random surfaces by spectral synthesis."""

import numpy as np
from numpy.typing import NDArray

from pipeline.fourier import backend as fourier
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import GaussianRandom
from pipeline.surface.recipes.patch import Axis, generator, patch_of
from pipeline.validated import as_pair


def gaussian(recipe: GaussianRandom) -> HeightField:
    """Makes a periodic Gaussian random surface with mean 0 and a standard deviation of exactly `sigma_h_um`.

    The mean of its autocorrelation over seeds is sigma^2 exp(-x^2/lx^2 - y^2/ly^2). Raises ConfigError where the
    pitch exceeds half a correlation length, or a correlation length the patch.
    """
    patch = patch_of(recipe)
    noise = smooth_noise(generator(recipe.seed), patch.y, patch.x, as_pair(recipe.correlation_um))
    noise *= recipe.sigma_h_um
    return HeightField(noise, patch.pitch_um)


def smooth_noise(
    rng: np.random.Generator, y: Axis, x: Axis, correlation_um: tuple[float, float]
) -> NDArray[np.float64]:
    """Makes periodic Gaussian noise with mean 0, rms exactly 1 and autocorrelation exp(-x^2/lx^2 - y^2/ly^2).

    White noise is filtered by the root of the power spectrum, exp(-pi^2 (lx^2 fx^2 + ly^2 fy^2) / 2). Correlation
    lengths are limited to half of the axis, so that small patches vary, too.

    y, x: the axes. correlation_um: (lx, ly), um.
    Returns (ny, nx).
    """
    lx, ly = (min(length, 0.5 * axis.size_um) for length, axis in zip(correlation_um, (x, y), strict=True))
    white = fourier.rfft2(rng.standard_normal((y.samples, x.samples)))
    white[0, 0] = 0.0
    noise = lowpass(white, y, x, (lx / np.sqrt(2), ly / np.sqrt(2)))
    rms = float(np.sqrt(np.mean(noise**2)))
    if rms > 0:
        noise /= rms
    return noise


def lowpass(
    spectrum: NDArray[np.complex128], y: Axis, x: Axis, length_um: tuple[float, float]
) -> NDArray[np.float64]:
    """Multiplies a spectrum in place by exp(-pi^2 (lx^2 fx^2 + ly^2 fy^2)) and transforms it back.

    That is a periodic convolution with a Gaussian of standard deviation length / sqrt(2).

    spectrum: rfft2 of a field, (ny, nx // 2 + 1). y, x: the axes. length_um: (lx, ly), um.
    Returns (ny, nx).
    """
    fx = np.fft.rfftfreq(x.samples, x.pitch_um)
    fy = np.fft.fftfreq(y.samples, y.pitch_um)
    spectrum *= np.exp(-((np.pi * length_um[1] * fy[:, None]) ** 2)) * np.exp(-((np.pi * length_um[0] * fx) ** 2))
    return fourier.irfft2(spectrum, (y.samples, x.samples))
