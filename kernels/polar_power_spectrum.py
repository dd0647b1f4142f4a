"""Host side of the polar power spectrum's kernel. Layouts as stated in opencl/polar_power_spectrum.cl."""

import numpy as np

from kernels import device, programs
from kernels.windowed_dft import DeviceStack

LANES = 16  # azimuths of a tile: floats in one vector


def gather(stack: DeviceStack, radius_per_um: np.ndarray, azimuth_rad: np.ndarray, series: np.ndarray) -> np.ndarray:
    """E float32 (tiles, radii, s nodes, 16) from a float32 Chebyshev stack; 0 beyond the scan's Nyquist limits.

    `radius_per_um` (radii,) ascends from 0; `azimuth_rad` is half a turn, a multiple of 16 azimuths: the other half
    follows it in E, tile by tile. `series` (terms, s nodes) holds (2 - [n = 0]) J_n(s H).
    """
    terms, nodes = series.shape
    # i^n, n = 2 m or 2 m + 1: the kernel keeps even and odd terms apart, which leaves (-1)^m
    signs = (-1.0) ** (np.arange(terms) // 2)
    padded = np.zeros((LANES * stack.blocks, nodes), np.float32)
    padded[:terms] = signs[:, None] * series
    tiles = azimuth_rad.reshape(-1, LANES)
    directions = np.stack([np.cos(tiles), np.sin(tiles)], axis=1)
    program = programs.polar(term_blocks=stack.blocks)
    radius, direction, terms_at_s = (device.upload(a) for a in (radius_per_um, directions, padded))
    out = device.empty((2 * len(tiles), len(radius_per_um), nodes, LANES), np.float32)
    result = device.shared(out)
    program.launch(
        "polar_power_spectrum",
        (len(radius_per_um), len(tiles)),
        stack.buffer,
        stack.decay,
        stack.grid,
        radius,
        np.int32(len(radius_per_um)),
        direction,
        terms_at_s,
        *(np.int32(n) for n in (terms + terms % 2, stack.blocks, nodes, *stack.reach)),
        *(np.float64(f) for f in stack.band_per_um),
        result,
    )
    return device.settle(result, out)
