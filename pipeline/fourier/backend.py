"""Transforms of `scipy.fft` with FFTW as its backend.

Plans are made by FFTW_ESTIMATE, without wisdom. A surface needs each transform once or a few times, and planning by
FFTW_MEASURE would take longer (0.6 s for 1332 x 1332 samples and 1.5 s for 722 x 722, against 5 and 11 ms). A plan
that depends only on the size also reproduces the heights of a recipe to the last bit in every run: hence large
transforms take two threads on every machine, and small ones one.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from math import prod
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# samples above which a transform takes two threads
_LARGE = 2**22


def rfft2(values: Real, shape: tuple[int, int] | None = None) -> Complex:
    """Transforms real values (ny, nx), padded with zeros to `shape`, to half of a spectrum (ny, nx // 2 + 1)."""
    threads = _threads(values.shape if shape is None else shape)
    with _fftw() as transforms:
        return np.asarray(transforms.rfft2(values, s=shape, workers=threads))


def irfft2(spectrum: Complex, shape: tuple[int, int]) -> Real:
    """Transforms half of a spectrum, (ny, nx // 2 + 1), to real values of `shape` (ny, nx)."""
    with _fftw() as transforms:
        return np.asarray(transforms.irfft2(spectrum, s=shape, workers=_threads(shape)))


def _threads(shape: tuple[int, ...]) -> int:
    return 2 if prod(shape) > _LARGE else 1


@contextmanager
def _fftw() -> Iterator[ModuleType]:
    """Gives `scipy.fft`, which transforms by FFTW inside the context."""
    from scipy import fft

    with fft.set_backend(_interface(), only=True):
        yield fft


@cache
def _interface() -> ModuleType:
    """Configures pyFFTW's interfaces for this process, and returns that of `scipy.fft`.

    Their cache of plans stays off: a plan holds its input and its output, as much memory as the transform took.
    """
    import pyfftw
    from pyfftw.interfaces import scipy_fft

    pyfftw.config.PLANNER_EFFORT = "FFTW_ESTIMATE"
    interface: ModuleType = scipy_fft
    return interface
