"""Host side of the spectral operator's kernels. Layouts as stated in opencl/spectral_operator.cl."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from kernels import device
from kernels.diffraction import fourth_column
from kernels.polar_spectrum import LANES

ORDER = 8  # nodes of every interpolation, over r and along kappa


@dataclass(frozen=True)
class RingQuadratures:
    """Wavelengths and weights of every ring's integral, one after the other.

    lambda_um: (nodes,); weights: (nodes, 3); first and count: (rings,) where a ring's begin and how many they are.
    """

    lambda_um: np.ndarray
    weights: np.ndarray
    first: np.ndarray
    count: np.ndarray


@dataclass(frozen=True)
class LinePoints:
    """Where along kappa = 1 / lambda every ring takes E, one ring after the other.

    kappa_per_um: (points,) ascending in each ring. place: (points,) the radius r = rho kappa, or the first of the
    ORDER about it, negative below the origin. first, count: (rings,) where a ring's begin and how many they are.
    on_radii: (rings,) whether they lie on radii of E. on_nodes: (rings,) whether they are the ring's wavelengths;
    else they are ORDER or more.
    """

    kappa_per_um: np.ndarray
    place: np.ndarray
    first: np.ndarray
    count: np.ndarray
    on_radii: np.ndarray
    on_nodes: np.ndarray


def integrate(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    points: LinePoints,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
) -> np.ndarray:
    """Chebyshev coefficients over w of X, Y, Z: float32 (rings, 3 w_terms, azimuths), from `polar_spectrum`'s E.

    `s_max_per_um` is where the Chebyshev nodes of E in s end. `rho` (rings,). `reflectance` (nodes of all rings'
    rules one after the other, w_terms) multiplies E at `w_nodes`; w_terms is a multiple of 4.
    """
    tiles, radii, s_nodes, _ = spectrum.shape
    w_terms, rings = reflectance.shape[1], len(rho)
    program, operator = _operator(radius_per_um, s_nodes, s_max_per_um, rho, points, quadratures, reflectance)
    to_w_terms = device.upload(chebyshev(w_terms)[0].astype(np.float32))
    out = device.empty((rings, 3 * w_terms, LANES * tiles), np.float32)
    power, result = device.lent(spectrum), device.shared(out)
    program.launch("apply_operator", (rings, tiles // 2), power, np.int32(radii), *operator, to_w_terms, result)
    return device.settle(result, out)


def _operator(
    radius_per_um: np.ndarray,
    s_nodes: int,
    s_max_per_um: float,
    rho: np.ndarray,
    points: LinePoints,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
) -> tuple[device.Program, list[Any]]:
    """The program, and the operator of every ring from E on `s_nodes`: rings, places and weights on the device."""
    w_terms = reflectance.shape[1]
    constants = {"ORDER": ORDER, "S_NODES": s_nodes, "W_TERMS": w_terms, "W_BLOCK": 4 if w_terms % 8 else 8}
    program = device.program(("spectral_operator.cl",), constants)
    where = [device.upload(a) for a in (_rings(points, quadratures), points.place.astype(np.int32))]
    inputs = [
        device.upload(a)
        for a in (
            radius_per_um,
            rho,
            points.kappa_per_um,
            quadratures.lambda_um,
            fourth_column(quadratures.weights).astype(np.float32),
            reflectance.astype(np.float32),
            chebyshev(s_nodes)[0].astype(np.float32),
            w_nodes(w_terms).astype(np.float32),
        )
    ]
    floats = ORDER, s_nodes * w_terms, 3 * w_terms
    weights = [device.result_buffer(4 * len(points.place) * n) for n in floats]
    program.launch("build_operator", (len(rho),), *where, *inputs, np.float32(s_max_per_um), *weights)
    return program, [*where, *weights]


def _rings(points: LinePoints, quadratures: RingQuadratures) -> np.ndarray:
    """The kernels' Ring of every ring, int32 (rings, 7)."""
    reflected = np.concatenate([[0], np.cumsum(quadratures.count)[:-1]])
    where = points.first, points.count, points.on_radii, points.on_nodes
    return np.stack([*where, quadratures.first, quadratures.count, reflected], axis=-1).astype(np.int32)


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
