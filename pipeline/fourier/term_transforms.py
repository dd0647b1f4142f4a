"""Transforms of a series' terms by FFTW, pruned to the coefficients that are kept.

A real transform along x is followed by a complex one along y over the columns that are kept. Plans are made by
FFTW_MEASURE, for one thread each, and several terms are transformed at once: threads within a transform of this size
wait for each other, take up to ten times as long to plan, and tie a plan to a number of cores.
"""

import os
from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.dft_stack import Kept
from pipeline.fourier import wisdom
from pipeline.progress import Progress, silent

# limit for the arrays of all plans
_MOST_BYTES = 2**30


class KeptCoefficients:
    """The indices of the kept coefficients in the half spectrum (ny, nx // 2 + 1) of real samples (ny, nx).

    columns: number of columns of the half spectrum that are read, from column 0.
    """

    def __init__(self, shape: tuple[int, int], kept: Kept) -> None:
        ny, nx = shape
        psi = np.arange(-kept.psi_max, kept.psi_max + 1)[:, None]
        phi = np.arange(-kept.reach, kept.phi_max + 1) % nx
        # the other half consists of the conjugates at opposite frequencies
        opposite = phi > nx // 2
        self._row = np.where(opposite, -psi, psi) % ny
        self._column = np.where(opposite, nx - phi, phi)
        self._mean = 1.0 / (ny * nx)
        # FFTW and scipy transform with exp(-2 pi i f.x), [S99] with the opposite sign
        self._mean_imaginary = np.where(opposite, self._mean, -self._mean)
        self.columns = int(self._column.max()) + 1

    def put(self, spectrum: NDArray[Any], out: NDArray[Any]) -> None:
        """Extracts mean(term exp(+2 pi i f.x)) from a half spectrum.

        spectrum: (ny, `columns` or more). out: receives real and imaginary parts, (psi, phi, 2).
        """
        found = spectrum[self._row, self._column]
        out[:, :, 0] = self._mean * found.real
        out[:, :, 1] = self._mean_imaginary * found.imag


class _Workspace:
    """The plans that transform one term at a time, and their arrays."""

    def __init__(self, shape: tuple[int, int], places: KeptCoefficients, real: np.dtype[Any]) -> None:
        import pyfftw

        ny, nx = shape
        complex_ = np.result_type(real, np.complex64)
        self._places = places
        self._samples = pyfftw.empty_aligned(shape, real)
        half = pyfftw.empty_aligned((ny, nx // 2 + 1), complex_)
        self._spectrum = pyfftw.empty_aligned((ny, places.columns), complex_)
        measured = {"flags": ("FFTW_MEASURE",), "threads": 1}
        self._along_x = pyfftw.FFTW(self._samples, half, axes=(1,), **measured)
        self._along_y = pyfftw.FFTW(half[:, : places.columns], self._spectrum, axes=(0,), **measured)

    @staticmethod
    def bytes(shape: tuple[int, int], places: KeptCoefficients, real: np.dtype[Any]) -> int:
        ny, nx = shape
        return ny * real.itemsize * (nx + 2 * (nx // 2 + 1) + 2 * places.columns)

    def load(self, term: NDArray[Any]) -> None:
        np.copyto(self._samples, term, casting="same_kind")

    def transform(self, out: NDArray[Any]) -> None:
        self._along_x.execute()
        self._along_y.execute()
        self._places.put(self._spectrum, out)


def plans_bytes(shape: tuple[int, int], kept: Kept, terms: int, real: np.dtype[Any]) -> int:
    """Computes the size of the arrays of all plans, bytes; the parameters are those of `transform`."""
    places = KeptCoefficients(shape, kept)
    return _at_once(shape, places, terms, real) * _Workspace.bytes(shape, places, real)


def _at_once(shape: tuple[int, int], places: KeptCoefficients, terms: int, real: np.dtype[Any]) -> int:
    """Computes how many terms are transformed at once."""
    room = _MOST_BYTES // _Workspace.bytes(shape, places, real)
    return max(1, min(os.cpu_count() or 1, terms, room))


def transform(terms: Iterable[NDArray[Any]], kept: Kept, out: NDArray[Any], progress: Progress = silent) -> None:
    """Computes mean(term exp(+2 pi i f.x)) of every term, at the coefficients that are kept.

    terms: each (ny, nx), with the origin of x and y at its first sample (np.fft.ifftshift moves the middle sample
        there). A term is copied before the next one is requested, so that one array may hold them all in turn.
    kept: the coefficients. out: receives the result, float32 or float64 (psi, phi, 2, terms), whose precision is
        used.
    progress: called with the completed share.
    """
    count, left = out.shape[3], iter(terms)
    first = next(left)
    places = KeptCoefficients(first.shape, kept)
    with wisdom.planning():
        at_once = _at_once(first.shape, places, count, out.dtype)
        workspaces = [_Workspace(first.shape, places, out.dtype) for _ in range(at_once)]
    running: deque[Future[None]] = deque()
    with ThreadPoolExecutor(at_once) as threads:
        for n in range(count):
            if n >= at_once:
                running.popleft().result()
            workspace = workspaces[n % at_once]
            workspace.load(first if n == 0 else next(left))
            running.append(threads.submit(workspace.transform, out[..., n]))
            progress("stack", n / count)
        for each in running:
            each.result()
    progress("stack", 1.0)
