"""Transforms of `scipy.fft` with FFTW behind them.

Plans are FFTW_ESTIMATE's, on one thread and without wisdom. A surface asks for each transform once or a few times,
and FFTW_MEASURE takes longer to plan one than that (0.6 s for 1332 x 1332 samples, 1.5 s for 722 x 722, against 5 and
11 ms); and a plan that depends on nothing but the size gives a recipe's heights to the last bit on every run.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import pyfftw
from numpy.typing import NDArray
from pyfftw.interfaces import scipy_fft
from scipy import fft as scipy

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# the smoothing of a spectrum comes back to its plan after some tenths of a second; a plan holds its arrays as long
_KEEP_PLANS_S = 2.0


def fft(values: Real) -> Complex:
    """The transform (n,) of values (n,)."""
    with _fftw():
        return np.asarray(scipy.fft(values))


def rfft2(values: Real, shape: tuple[int, int] | None = None) -> Complex:
    """The half spectrum (ny, nx // 2 + 1) of real values (ny, nx), padded with zeros to a larger `shape` if given."""
    with _fftw():
        return np.asarray(scipy.rfft2(values, s=shape))


def irfft2(spectrum: Complex, shape: tuple[int, int]) -> Real:
    """The real values of `shape` (ny, nx) whose half spectrum (ny, nx // 2 + 1) is given."""
    with _fftw():
        return np.asarray(scipy.irfft2(spectrum, s=shape))


@contextmanager
def _fftw() -> Iterator[None]:
    _prepare()
    with scipy.set_backend(scipy_fft, only=True):
        yield


@cache
def _prepare() -> None:
    """Sets what pyFFTW's interfaces take from the process."""
    pyfftw.config.PLANNER_EFFORT = "FFTW_ESTIMATE"
    pyfftw.interfaces.cache.enable()
    pyfftw.interfaces.cache.set_keepalive_time(_KEEP_PLANS_S)
