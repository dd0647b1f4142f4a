"""Host side of the polar kernels: power spectrum, spectral operator, splines. Layouts as stated in opencl/*.cl."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from kernels import device
from kernels.diffraction import DeviceStack, fourth_column

LANES = 16  # azimuths of a tile: floats in one vector
_MOST_OUTPUTS = 28  # sums that stay in the 32 vector registers beside what they read
ORDER = 8  # nodes of the interpolation over r


def polar_spectrum(
    stack: DeviceStack, radius_per_um: np.ndarray, azimuth_rad: np.ndarray, series: np.ndarray
) -> np.ndarray:
    """E float32 (tiles, radii, s nodes, 16) from a float32 Chebyshev stack; 0 beyond the scan's band.

    `radius_per_um` (radii,) ascends from 0; `azimuth_rad` is half a turn, a multiple of 16 azimuths: the other half
    follows it in E, tile by tile. `series` (terms, s nodes) holds (2 - [n = 0]) J_n(s H).
    """
    terms, nodes = series.shape
    blocks, s_blocks = stack.constants["BLOCKS"], -(-nodes // LANES)
    # i^n, n = 2 m or 2 m + 1: the kernel keeps even and odd terms apart, which leaves (-1)^m
    signs = (-1.0) ** (np.arange(terms) // 2)
    padded = np.zeros((LANES * blocks, LANES * s_blocks), np.float32)
    padded[:terms, :nodes] = signs[:, None] * series
    tiles = azimuth_rad.reshape(-1, LANES)
    directions = np.stack([np.cos(tiles), np.sin(tiles)], axis=1)
    constants = {key: stack.constants[key] for key in ("BLOCKS", "REACH_X", "REACH_Y")}
    program = device.program(("polar_spectrum.cl",), {**constants, "S_BLOCKS": s_blocks, "S_NODES": nodes})
    inputs = [device.upload(a) for a in (radius_per_um, directions, padded)]
    out = device.empty((2 * len(tiles), len(radius_per_um), nodes, LANES), np.float32)
    result = device.shared(out)
    program.launch(
        "polar_spectrum",
        (len(radius_per_um), len(tiles)),
        stack.buffer,
        stack.decay,
        stack.grid,
        *inputs,
        *(np.float64(f) for f in stack.band_per_um),
        result,
    )
    return device.settle(result, out)


@dataclass(frozen=True)
class RingQuadratures:
    """Wavelengths and weights of every ring's integral, one after the other.

    lambda_um: (nodes,); weights: (nodes, 3); first and count: (rings,) where a ring's begin and how many they are.
    """

    lambda_um: np.ndarray
    weights: np.ndarray
    first: np.ndarray
    count: np.ndarray


def integrate(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
) -> np.ndarray:
    """Chebyshev coefficients over w of X, Y, Z: float32 (rings, 3 w_terms, azimuths), from `polar_spectrum`'s E.

    `s_max_per_um` is where the Chebyshev nodes of E in s end. `rho` (rings,). `reflectance` (nodes of all rings'
    rules one after the other, w_terms) multiplies E at `w_nodes`; w_terms is a multiple of 4.
    """
    tiles, radii, nodes, _ = spectrum.shape
    operator = _operator(radius_per_um, nodes, s_max_per_um, rho, quadratures, reflectance)
    out = device.empty((len(rho), 3 * reflectance.shape[1], LANES * tiles), np.float32)
    power, result = device.lent(spectrum), device.shared(out)
    size = len(rho), tiles, operator.groups
    operator.program.launch("apply_operator", size, power, np.int32(radii), operator.places, operator.matrix, result)
    return device.settle(result, out)


@dataclass(frozen=True)
class _Operator:
    """The matrices of all rings on the device, where each stands, and in how many groups their outputs come."""

    program: device.Program
    places: Any
    matrix: Any
    groups: int


def _operator(
    radius_per_um: np.ndarray,
    nodes: int,
    s_max_per_um: float,
    rho: np.ndarray,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
) -> _Operator:
    """The operator from E on `nodes` in s to every ring, for `integrate`'s arguments."""
    w_terms, radii = reflectance.shape[1], len(radius_per_um)
    outputs = 3 * w_terms
    groups = -(-outputs // _MOST_OUTPUTS)
    # outputs come in vectors of four
    group = 4 * -(-outputs // (4 * groups))
    program = device.program(
        ("spectral_operator.cl",),
        {
            "ORDER": ORDER,
            "S_NODES": nodes,
            "W_TERMS": w_terms,
            "OUT": outputs,
            "GROUPS": groups,
            "GROUP": group,
        },
    )
    extent = extents(radius_per_um, rho, quadratures, nodes)
    values_to_terms, _ = chebyshev(nodes)
    w_values_to_terms, _ = chebyshev(w_terms)
    radius, rings, wavelengths, weights, spans, places, reflected, cardinal, cosine, w_node = (
        device.upload(a)
        for a in (
            radius_per_um,
            rho,
            quadratures.lambda_um,
            fourth_column(quadratures.weights).astype(np.float32),
            np.stack([quadratures.first, quadratures.count], axis=-1).astype(np.int32),
            extent,
            reflectance.astype(np.float32),
            values_to_terms.astype(np.float32),
            w_values_to_terms.T.astype(np.float32),
            w_nodes(w_terms).astype(np.float32),
        )
    )
    matrix = device.result_buffer(4 * groups * group * nodes * int(extent[:, 1].sum()))
    program.launch(
        "build_operator",
        (len(rho),),
        radius,
        np.int32(radii),
        rings,
        wavelengths,
        weights,
        spans,
        places,
        reflected,
        np.float32(s_max_per_um),
        cardinal,
        cosine,
        w_node,
        matrix,
    )
    return _Operator(program, places, matrix, groups)


def extents(radius_per_um: np.ndarray, rho: np.ndarray, quadratures: RingQuadratures, nodes: int) -> np.ndarray:
    """int32 (rings, 4): the first radius of a ring's matrix, how many, where it begins, and its reflectances."""
    shortest = quadratures.lambda_um[quadratures.first]
    longest = quadratures.lambda_um[quadratures.first + quadratures.count - 1]

    def first_node(r: np.ndarray) -> np.ndarray:
        below = np.clip(np.searchsorted(radius_per_um, r, side="right") - 1, 0, len(radius_per_um) - 2)
        return np.minimum(below - (ORDER // 2 - 1), len(radius_per_um) - ORDER)

    low, high = first_node(rho / longest), first_node(rho / shortest)
    count = high - low + ORDER
    begin = np.concatenate([[0], np.cumsum(count * nodes)[:-1]])
    rows = np.concatenate([[0], np.cumsum(quadratures.count)[:-1]])
    return np.stack([low, count, begin, rows], axis=-1).astype(np.int32)


def w_nodes(w_terms: int) -> np.ndarray:
    """Where E is taken over |w|, as shares of w_max: Chebyshev's nodes on [0, 1]."""
    return 0.5 * (chebyshev(w_terms)[1] + 1.0)


def chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The matrix from values at Chebyshev's nodes to coefficients of T_k, and the nodes in [-1, 1]."""
    k = np.arange(count)
    angle = np.pi * (k + 0.5) / count
    matrix = np.cos(np.outer(k, angle)) * 2.0 / count
    matrix[0] /= 2.0
    return matrix, np.cos(angle)


def spline_coefficients(table: np.ndarray) -> np.ndarray:
    """Cubic B-spline coefficients of a table (rings, outputs, azimuths) of samples, in its place."""
    rings, outputs, azimuths = table.shape
    program = _spline_program(outputs)
    between = device.result_buffer(table.nbytes)
    buffer = device.shared(table)
    program.launch("filter_azimuths", (outputs, rings), buffer, np.int32(azimuths), between)
    program.launch("filter_rings", (azimuths // LANES, outputs, rings), between, np.int32(azimuths), buffer)
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
    sizes = np.int32(rings), np.int32(azimuths)
    _spline_program(outputs).launch("look_up", (len(ring),), device.lent(table), *sizes, cells, places, result)
    return device.download(result, out)[:, :3]


def _spline_program(outputs: int) -> device.Program:
    return device.program(("cubic_spline.cl",), {"OUT": outputs, "W_TERMS": outputs // 3})
