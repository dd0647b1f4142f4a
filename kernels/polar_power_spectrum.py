"""Host side of the polar power spectrum's kernel. Layouts as stated in opencl/polar_power_spectrum.cl."""

import numpy as np

from kernels import device, programs
from kernels.windowed_dft import DeviceStack

LANES = 16  # azimuths of a tile: floats in one vector


MODES = 3  # real factors of coefficients that stand for three windows along an axis


def padded(modes: np.ndarray) -> np.ndarray:
    """Factors (n, 3) in single precision, from those (n, modes) of fewer windows along an axis."""
    return np.pad(modes, ((0, 0), (0, MODES - modes.shape[1]))).astype(np.float32)


def gather(
    stack: DeviceStack,
    radius_per_um: np.ndarray,
    azimuth_rad: np.ndarray,
    series: np.ndarray,
    modes: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """E float32 (tiles, radii, s nodes, 16) from a float32 Chebyshev stack; 0 beyond the scan's Nyquist limits.

    `radius_per_um` (radii,) ascends from 0; `azimuth_rad` is half a turn, a multiple of 16 azimuths: the other half
    follows it in E, tile by tile. `series` (terms, s nodes) holds (2 - [n = 0]) J_n(s H). `modes` are the factors
    (columns, 3), (rows, 3) whose E is the mean over several windows; None for the window in the middle.
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
    factors = [] if modes is None else [device.upload(each) for each in modes]
    program.launch(
        "polar_power_spectrum" if modes is None else "mean_power_spectrum",
        (len(radius_per_um), len(tiles)),
        stack.buffer,
        stack.decay,
        stack.grid,
        *factors,
        radius,
        np.int32(len(radius_per_um)),
        direction,
        terms_at_s,
        *(np.int32(n) for n in (terms + terms % 2, stack.blocks, nodes, *stack.reach)),
        *(np.float64(f) for f in stack.band_per_um),
        result,
    )
    return device.settle(result, out)
