"""Host side of the kernels that put cubic B-splines through a polar table's samples, and look them up.

Layouts as stated in opencl/cubic_spline.cl.
"""

import numpy as np

from kernels import device, programs
from kernels.polar_power_spectrum import LANES
from kernels.windowed_dft import fourth_column


def coefficients(table: np.ndarray, every: np.ndarray | None = None) -> np.ndarray:
    """Cubic B-spline coefficients of a table (rings, outputs, azimuths) of samples, in its place.

    `every` (rings,) is 1, 2 or 4 azimuths from knot to knot of a ring, None for 1. The coefficients are those on all
    azimuths in any case: of the same splines, with knots inserted.
    """
    rings, outputs, azimuths = table.shape
    every = np.ones(rings, np.int32) if every is None else every.astype(np.int32)
    assert not np.any(azimuths % (LANES * every))
    program = programs.polar()
    buffer = device.shared(table)
    program.launch("filter_rings", (azimuths // (2 * LANES), outputs), buffer, np.int32(rings))
    program.launch("filter_azimuths", (outputs, rings), buffer, np.int32(azimuths), device.upload(every))
    return device.settle(buffer, table)


def look_up(table: np.ndarray, ring: np.ndarray, azimuth: np.ndarray, x: np.ndarray) -> np.ndarray:
    """X, Y, Z float32 (directions, 3) of spline coefficients (rings, outputs, azimuths).

    `ring` in 0 .. rings - 1 and `azimuth` in 0 .. azimuths, fractional, in samples; `x` = 2 |w| / w_max - 1.
    """
    rings, outputs, azimuths = table.shape
    # whole and fraction apart: together they would not fit float32's digits
    below = np.stack([np.minimum(np.floor(ring), rings - 2), np.floor(azimuth)], axis=-1)
    place = fourth_column(np.stack([ring - below[:, 0], azimuth - below[:, 1], x], axis=-1))
    out = np.empty((len(ring), 4), np.float32)
    cells, places, result = (
        device.upload(below.astype(np.int32)),
        device.upload(place.astype(np.float32)),
        device.result_buffer(out.nbytes),
    )
    sizes = np.int32(rings), np.int32(azimuths), np.int32(outputs // 3)
    programs.polar().launch("look_up", (len(ring),), device.lent(table), *sizes, cells, places, result)
    return device.download(result, out)[:, :3]
