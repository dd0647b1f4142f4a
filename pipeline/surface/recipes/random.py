"""Periodic random surfaces by spectral synthesis."""

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.fourier import backend as fourier
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import GaussianRandom
from pipeline.surface.recipes.patch import Axis, generator, patch_of
from pipeline.validated import as_pair


def gaussian(recipe: GaussianRandom) -> HeightField:
    """A Gaussian random surface, periodic, of mean 0 and standard deviation exactly `sigma_h_um`.

    Its autocorrelation is sigma^2 exp(-x^2/lx^2 - y^2/ly^2) in the mean over seeds. Raises ConfigError where
    the pitch is above half a correlation length or the patch is shorter than one.
    """
    patch = patch_of(recipe)
    noise = smooth_noise(generator(recipe.seed), patch.y, patch.x, as_pair(recipe.correlation_um))
    return HeightField(recipe.sigma_h_um * noise, patch.pitch_um)


def smooth_noise(
    rng: np.random.Generator, y: Axis, x: Axis, correlation_um: tuple[float, float]
) -> NDArray[np.float64]:
    """Periodic Gaussian noise (ny, nx), mean 0, rms exactly 1, autocorrelation exp(-x^2/lx^2 - y^2/ly^2).

    White noise is filtered by the root of the power spectrum, exp(-pi^2 (lx^2 fx^2 + ly^2 fy^2) / 2).
    Correlation lengths above half an axis are cut to it, so that a small patch still varies.
    """
    lx, ly = (min(length, 0.5 * axis.size_um) for length, axis in zip(correlation_um, (x, y), strict=True))
    white = fourier.rfft2(rng.standard_normal((y.samples, x.samples)))
    white[0, 0] = 0.0
    noise = lowpass(white, y, x, (lx / np.sqrt(2), ly / np.sqrt(2)))
    rms = float(np.sqrt(np.mean(noise**2)))
    return noise / rms if rms > 0 else noise


def lowpass(
    spectrum: NDArray[np.complex128], y: Axis, x: Axis, length_um: tuple[float, float]
) -> NDArray[np.float64]:
    """The real field (ny, nx) of a half spectrum `rfft2`, times exp(-pi^2 (lx^2 fx^2 + ly^2 fy^2)).

    That is convolution with a Gaussian of standard deviation length / sqrt(2), periodic across the seams.
    """
    fx = fft.rfftfreq(x.samples, x.pitch_um)
    fy = fft.fftfreq(y.samples, y.pitch_um)
    gain = np.exp(-((np.pi * length_um[1] * fy[:, None]) ** 2)) * np.exp(-((np.pi * length_um[0] * fx) ** 2))
    return fourier.irfft2(spectrum * gain, (y.samples, x.samples))
