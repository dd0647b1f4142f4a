"""Transforms of `scipy.fft` with FFTW as its backend.

Plans are made by FFTW_ESTIMATE, without wisdom. A surface needs each transform once or a few times, and planning by
FFTW_MEASURE would take longer (0.6 s for 1332 x 1332 samples and 1.5 s for 722 x 722, against 5 and 11 ms). A plan
that depends only on the size also reproduces the heights of a recipe to the last bit in every run: hence large
transforms take two threads on every machine, and small ones one.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# the smoothing of a spectrum uses its plan again after some tenths of a second; until then, the plan occupies memory.
# That of a large transform would hold as much as a height field or two, and is made in a fifth of the time of its use
_KEEP_PLANS_S, _LARGE = 2.0, 2**22


def fft(values: Real) -> Complex:
    """Transforms values (n,) to (n,)."""
    with _fftw(values.size) as transforms:
        return np.asarray(transforms.fft(values))


def rfft2(values: Real, shape: tuple[int, int] | None = None) -> Complex:
    """Transforms real values (ny, nx), padded with zeros to `shape`, to half of a spectrum (ny, nx // 2 + 1)."""
    samples = values.size if shape is None else shape[0] * shape[1]
    with _fftw(samples) as transforms:
        return np.asarray(transforms.rfft2(values, s=shape, workers=_threads(samples)))


def irfft2(spectrum: Complex, shape: tuple[int, int]) -> Real:
    """Transforms half of a spectrum, (ny, nx // 2 + 1), to real values of `shape` (ny, nx)."""
    samples = shape[0] * shape[1]
    with _fftw(samples) as transforms:
        return np.asarray(transforms.irfft2(spectrum, s=shape, workers=_threads(samples)))


def _threads(samples: int) -> int:
    return 2 if samples > _LARGE else 1


@contextmanager
def _fftw(samples: int) -> Iterator[ModuleType]:
    """Gives `scipy.fft`, which transforms by FFTW inside the context, and keeps the plans of few samples."""
    from scipy import fft

    interface = _interface()
    _keep_plans(keep=samples <= _LARGE)
    with fft.set_backend(interface, only=True):
        yield fft


def _keep_plans(*, keep: bool) -> None:
    """Keeps plans from now on, or drops those that were kept."""
    from pyfftw.interfaces import cache as plans

    if keep == plans.is_enabled():
        return
    if not keep:
        plans.disable()
        return
    plans.enable()
    plans.set_keepalive_time(_KEEP_PLANS_S)


@cache
def _interface() -> ModuleType:
    """Configures pyFFTW's interfaces for this process, and returns that of `scipy.fft`."""
    import pyfftw
    from pyfftw.interfaces import scipy_fft

    pyfftw.config.PLANNER_EFFORT = "FFTW_ESTIMATE"
    interface: ModuleType = scipy_fft
    return interface
