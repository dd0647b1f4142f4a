"""Host side of the spectral operator's kernels. Layouts as stated in opencl/spectral_operator.cl."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from kernels import device, programs
from kernels.chebyshev import chebyshev, w_max, w_nodes
from kernels.polar_power_spectrum import LANES
from kernels.programs import CHANNELS, ORDER
from kernels.windowed_dft import fourth_column

_LEAST_SPAN = 1e-9  # of |w|, where a ring has one value: T_k of the middle then


@dataclass(frozen=True)
class RingQuadratures:
    """Wavelengths and weights of every ring's integral, one after the other.

    lambda_um: (nodes,); weights: (nodes, 3); first and count: (rings,) where a ring's begin and how many they are.
    """

    lambda_um: np.ndarray
    weights: np.ndarray
    first: np.ndarray
    count: np.ndarray

    @property
    def kappa_ends_per_um(self) -> tuple[np.ndarray, np.ndarray]:
        """1 / lambda of every ring's longest wavelength, and of its shortest."""
        return 1.0 / self.lambda_um[self.first + self.count - 1], 1.0 / self.lambda_um[self.first]


@dataclass(frozen=True)
class LinePoints:
    """Where rings take E along kappa = 1 / lambda: as groups that follow each other, on a group's first ring's line.

    kappa_per_um: (points,) ascending in each group. place: (points,) the radius r = rho kappa, or the first of the
    ORDER about it, negative below the origin. first, count: (groups,) where a group's begin and how many they are.
    rings: (groups,) how many rings, at most MOST_RINGS. on_radii: (groups,) whether they lie on radii of E. on_nodes:
    (groups,) whether they are the wavelengths of the group's one ring; else they are ORDER or more. stretch: (rings,)
    rho over that of the group's first.
    """

    kappa_per_um: np.ndarray
    place: np.ndarray
    first: np.ndarray
    count: np.ndarray
    rings: np.ndarray
    on_radii: np.ndarray
    on_nodes: np.ndarray
    stretch: np.ndarray

    @property
    def group(self) -> np.ndarray:
        """The group of every ring, (rings,)."""
        return np.repeat(np.arange(len(self.rings)), self.rings)

    @property
    def first_ring(self) -> np.ndarray:
        """The first ring of every group, (groups,)."""
        return np.asarray(np.cumsum(self.rings) - self.rings)

    def scaled(self, of_group: np.ndarray) -> np.ndarray:
        """|w| of every ring (rings, ...) where its group's first ring has the |w| `of_group` (groups, ...)."""
        stretch = self.stretch.reshape(-1, *(1,) * (of_group.ndim - 1))
        return np.asarray(stretch * of_group[self.group])


@dataclass(frozen=True)
class Span:
    """The interval of |w| of the nodes of every group, as that of its first ring.

    low, high: (groups,).
    """

    low: np.ndarray
    high: np.ndarray

    def nodes(self, w_terms: int) -> np.ndarray:
        """Chebyshev's nodes w_m of every group, (groups, w_terms)."""
        return self.low[:, None] + np.outer(self.high - self.low, w_nodes(w_terms))


def whole_span(rho: np.ndarray, points: LinePoints) -> Span:
    """All |w| of the first ring `rho` (rings,) of every group."""
    high = w_max(rho)[points.first_ring]
    return Span(np.zeros_like(high), high)


def half_turns(tiles: int) -> np.ndarray:
    """Pairs (tiles / 2, 2) of all `tiles` tiles of E with those half a turn on."""
    return np.arange(tiles).reshape(2, -1).T


def integrate(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    points: LinePoints,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
    pairs: np.ndarray | None = None,
) -> np.ndarray:
    """Chebyshev coefficients over w of X, Y, Z: float32 (rings, 3 w_terms, azimuths), from E.

    `s_max_per_um` is where the Chebyshev nodes of E in s end. `rho` (rings,). `reflectance` (nodes of all rings'
    rules one after the other, w_terms) multiplies E at `group_w`; w_terms is a multiple of 4. `pairs` (pairs, 2) are
    the places in E of the tiles that are taken, None for all; the azimuths of their first column come first in the
    result. Where a ring takes radii below 0, they are half a turn apart.
    """
    to_w_terms = _to_w_terms(rho, points, reflectance.shape[1])
    of = radius_per_um, s_max_per_um, rho, points, quadratures, reflectance, whole_span(rho, points)
    return _apply(spectrum, half_turns(len(spectrum)) if pairs is None else pairs, *of, to_w_terms, None)


def integrate_at(
    spectrum: np.ndarray,
    pairs: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    points: LinePoints,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
    span: Span,
    w: np.ndarray,
) -> np.ndarray:
    """X, Y, Z at one |w| of each texel: float32 (rings, 3, azimuths), from E, at the azimuths of some of its tiles.

    `span` is the interval of the nodes in |w|, and `w` (rings, azimuths) within it for every ring; other parameters
    are as in `integrate`.
    """
    w_terms = reflectance.shape[1]
    to_terms = np.broadcast_to(chebyshev(w_terms)[0], (len(rho), w_terms, w_terms))
    low, high = points.scaled(span.low), points.scaled(span.high)
    own_x = (2.0 * (w - low[:, None]) / np.maximum(high - low, _LEAST_SPAN)[:, None] - 1.0).astype(np.float32)
    of = radius_per_um, s_max_per_um, rho, points, quadratures, reflectance
    return _apply(spectrum, pairs, *of, span, to_terms, own_x)


def _apply(
    spectrum: np.ndarray,
    pairs: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    points: LinePoints,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
    span: Span,
    to_w_terms: np.ndarray,
    own_x: np.ndarray | None,
) -> np.ndarray:
    """Runs both kernels; `own_x` is the argument of T_k of each texel, None for all terms."""
    _, radii, s_nodes, _ = spectrum.shape
    w_terms, rings = reflectance.shape[1], len(rho)
    program, operator = _operator(radius_per_um, s_nodes, s_max_per_um, rho, points, quadratures, reflectance, span)
    out = device.empty((rings, CHANNELS * (w_terms if own_x is None else 1), LANES * pairs.size), np.float32)
    power, result = device.lent(spectrum), device.shared(out)
    at = device.upload(np.zeros(1, np.float32) if own_x is None else own_x)
    program.launch(
        "apply_operator",
        (len(points.rings), len(pairs)),
        power,
        np.int32(radii),
        device.upload(pairs.astype(np.int32)),
        *operator,
        np.int32(s_nodes),
        np.int32(w_terms),
        device.upload(to_w_terms.astype(np.float32)),
        np.int32(own_x is not None),
        at,
        result,
    )
    return device.settle(result, out)


def _operator(
    radius_per_um: np.ndarray,
    s_nodes: int,
    s_max_per_um: float,
    rho: np.ndarray,
    points: LinePoints,
    quadratures: RingQuadratures,
    reflectance: np.ndarray,
    span: Span,
) -> tuple[device.Program, list[Any]]:
    """The program, and the operator of every group from E on `s_nodes`, on the device, in the kernels' order."""
    w_terms = reflectance.shape[1]
    program = programs.polar(s_nodes=s_nodes, w_terms=w_terms)
    where = [device.upload(a.astype(np.int32)) for a in (_groups(points), _rings(points, quadratures), points.place)]
    inputs = [
        device.upload(a)
        for a in (
            radius_per_um,
            rho,
            points.stretch,
            points.kappa_per_um,
            quadratures.lambda_um,
            fourth_column(quadratures.weights).astype(np.float32),
            reflectance.astype(np.float32, copy=False),
            chebyshev(s_nodes)[0].astype(np.float32),
            span.nodes(w_terms).astype(np.float32),
        )
    ]
    count, ring_points = len(points.place), int(points.rings @ points.count)
    numbers = operator_numbers(count, ring_points, len(rho), s_nodes, w_terms)
    weights = [device.result_buffer(4 * n) for n in numbers]
    sizes = np.float32(s_max_per_um), np.int32(s_nodes), np.int32(w_terms)
    program.launch("build_operator", (len(points.rings),), *where, *inputs, *sizes, *weights)
    return program, [*where, *weights]


def operator_numbers(points: int, ring_points: int, rings: int, s_nodes: int, w_terms: int) -> tuple[int, ...]:
    """Sizes of the operator's arrays: lagrange_r, cardinal_s and point_weights in float; used, two int of each ring.

    points: of all groups. ring_points: of the rings, each with all those of its group.
    """
    return points * ORDER, points * s_nodes * w_terms, ring_points * CHANNELS * w_terms, 2 * rings


def _groups(points: LinePoints) -> np.ndarray:
    """The kernels' Group of every group, int (groups, 6)."""
    where = points.first, points.count, points.on_radii, points.on_nodes, points.first_ring, points.rings
    return np.stack(where, axis=-1)


def _rings(points: LinePoints, quadratures: RingQuadratures) -> np.ndarray:
    """The kernels' Ring of every ring, int (rings, 4)."""
    weights, count = points.count[points.group], quadratures.count
    where = np.cumsum(weights) - weights, quadratures.first, count, np.cumsum(count) - count
    return np.stack(where, axis=-1)


def _to_w_terms(rho: np.ndarray, points: LinePoints, w_terms: int) -> np.ndarray:
    """Chebyshev coefficients over every ring's w from values at its group's nodes, (rings, w_terms, w_terms)."""
    to_terms, x = chebyshev(w_terms)
    reach = points.scaled(whole_span(rho, points).high)
    # at the rim all nodes are one
    share = np.divide(w_max(rho), reach, out=np.ones_like(rho), where=reach > 0.0)
    own = share[:, None] * (x + 1.0) - 1.0
    through = np.cos(np.arange(w_terms) * np.arccos(np.minimum(own, 1.0))[..., None]) @ to_terms
    return np.asarray(to_terms @ through)


def group_w(points: LinePoints, span: Span, w_terms: int) -> np.ndarray:
    """|w| of every ring where its group takes E, (rings, w_terms); beyond a ring's own w_max it goes on."""
    return points.scaled(span.nodes(w_terms))
