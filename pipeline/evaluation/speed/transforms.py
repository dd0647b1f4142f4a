"""The stack's transforms by three libraries: the kernel, FFTW and scipy, each in both precisions."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.diffraction import dft_stack
from pipeline.diffraction.dft_stack import Stack
from pipeline.evaluation.plain_numpy import chebyshev_terms
from pipeline.evaluation.speed.machine import Precision
from pipeline.evaluation.speed.setting import Setting
from pipeline.evaluation.speed.timing import best_of
from pipeline.fourier.term_transforms import KeptCoefficients, transform

_REAL: dict[Precision, np.dtype[Any]] = {"single": np.dtype(np.float32), "double": np.dtype(np.float64)}


@dataclass(frozen=True)
class Transforms:
    """Seconds of one Chebyshev stack by each library, its terms included, warm.

    differences: the largest of FFTW's and of scipy's coefficients from the kernel's; that of a mirror is 1.
    """

    precision: Precision
    terms: int
    kernel_s: float
    fftw_s: float
    scipy_s: float
    fftw_difference: float
    scipy_difference: float


def measure(setting: Setting, repeats: int) -> list[Transforms]:
    """Time both precisions of the stack of a surface's polar table, each the best of `repeats`."""
    return [_measure(setting, precision, repeats) for precision in _REAL]


def _measure(setting: Setting, precision: Precision, repeats: int) -> Transforms:
    real, terms, bake, field = _REAL[precision], setting.plan.terms, setting.bake, setting.field
    window = bake.sigma_um, float(bake.radius_per_um[-1]), bake.tolerance
    kept = dft_stack.size(field.extent, *window).kept
    t = np.fft.ifftshift(field.heights_um) * dft_stack.scale_per_um(field)

    def by_kernel() -> Stack:
        return dft_stack.build(field, "chebyshev", terms, *window, dtype=real)

    def by_fftw() -> NDArray[Any]:
        out = np.empty((*kept.shape, 2, terms), real)
        transform(chebyshev_terms(t), kept, out)
        return out

    def by_scipy() -> NDArray[Any]:
        out, places = np.empty((*kept.shape, 2, terms), real), KeptCoefficients(t.shape, kept)
        for n, term in zip(range(terms), chebyshev_terms(t), strict=False):
            places.put(fft.rfft2(term.astype(real), workers=os.cpu_count()), out[..., n])
        return out

    # kernels are compiled, and plans measured or read from wisdom, once
    by_kernel()
    by_fftw()
    built, kernel_s = best_of(repeats, by_kernel)
    fftw, fftw_s = best_of(repeats, by_fftw)
    scipy, scipy_s = best_of(repeats, by_scipy)
    differences = (float(np.max(np.abs(other - built.coefficients))) for other in (fftw, scipy))
    return Transforms(precision, terms, kernel_s, fftw_s, scipy_s, *differences)
