"""Peak arithmetic and memory bandwidth of the device, measured."""

import time
from typing import Any, Literal

import numpy as np

from kernels import device
from kernels.device import Program

_TRIAD_BYTES = 2**27  # of each of three arrays: more than last caches hold
_VECTORS = 256  # of a work-item of the triad
_VECTOR_BYTES = 64
_STEPS = 20_000  # of the chains of multiply-adds
_ITEMS_A_UNIT = 64
_CHAINS = 12  # of multiply-adds: with their two factors, they fit into 16 registers


def measure_peak(precision: Literal["single", "double"], seconds: float = 0.5) -> float:
    """Return operations a second of the device, by chains of fused multiply-adds on its vector registers."""
    real, size = {"single": ("float", 4), "double": ("double", 8)}[precision]
    # OpenCL has no vectors of one lane
    lanes = max(2, 4 * device.default_device().vector_width // size)
    built = device.program(("peak.cl",), {"REAL": real, "LANES": lanes, "CHAINS": _CHAINS})
    items = _ITEMS_A_UNIT * device.default_device().compute_units
    buffer = device.result_buffer(size * items)
    best = _shortest(built, "peak", (items,), (np.int32(_STEPS), buffer), seconds)
    return 2.0 * items * _STEPS * _CHAINS * lanes / best


def measure_bandwidth(seconds: float = 0.5) -> float:
    """Return bytes a second between device and memory, by McCalpin's triad: two arrays read, one written."""
    ones = np.ones(_TRIAD_BYTES // 4, np.float32)
    a, b, out = device.upload(ones), device.upload(ones), device.result_buffer(_TRIAD_BYTES)
    built = device.program(("bandwidth.cl",), {"VECTORS": _VECTORS})
    items = _TRIAD_BYTES // (_VECTOR_BYTES * _VECTORS)
    return 3.0 * _TRIAD_BYTES / _shortest(built, "triad", (items,), (a, b, np.float32(3.0), out), seconds)


def _shortest(
    built: Program, kernel: str, size: tuple[int, ...], arguments: tuple[Any, ...], seconds: float
) -> float:
    """Return the shortest of all launches that fit into `seconds`, s."""
    # the first compiles, and touches every page
    built.launch(kernel, size, *arguments)
    best, until = float("inf"), time.perf_counter() + seconds
    while time.perf_counter() < until:
        with built.device.timing() as launches:
            built.launch(kernel, size, *arguments)
        best = min(best, launches[0].seconds)
    return best
