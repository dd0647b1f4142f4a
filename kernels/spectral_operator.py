"""Host side of the spectral operator's kernels. Layouts as stated in opencl/spectral_operator.cl."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

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
    usual: (rings,) how many another light of the same range may need; by these, lights choose the same points.
    """

    lambda_um: np.ndarray
    weights: np.ndarray
    first: np.ndarray
    count: np.ndarray
    usual: np.ndarray

    @property
    def kappa_ends_per_um(self) -> tuple[np.ndarray, np.ndarray]:
        """1 / lambda of every ring's longest wavelength, and of its shortest."""
        return 1.0 / self.lambda_um[self.first + self.count - 1], 1.0 / self.lambda_um[self.first]


class GroupKey(NamedTuple):
    """The properties of a group that two lights with the same points share: rings, kind, kappa and span in |w|."""

    ring: int
    rings: int
    on_radii: bool
    on_nodes: bool
    low: float
    high: float
    kappa_per_um: bytes


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


@dataclass(frozen=True)
class RingIntegrals:
    """The integrals of one light on all rings.

    points: where its rings take E. span: of its nodes in |w|. quadratures: its wavelengths and weights. reflectance:
    (nodes of all rings' rules one after the other, w_terms), which multiplies E at `group_w`.
    """

    points: LinePoints
    span: Span
    quadratures: RingQuadratures
    reflectance: np.ndarray

    def groups(self) -> dict[GroupKey, slice]:
        """The points of every group, by its key."""
        of, found = self.points, {}
        kinds = zip(of.first_ring, of.rings, of.on_radii, of.on_nodes, strict=True)
        spans = zip(self.span.low, self.span.high, strict=True)
        for kind, ends, first, count in zip(kinds, spans, of.first, of.count, strict=True):
            own = slice(first, first + count)
            found[GroupKey(*kind, *ends, of.kappa_per_um[own].tobytes())] = own
        return found


def most_lights(w_terms: int) -> int:
    """How many lights one pass can serve: their sums share what a work-item keeps."""
    return max(1, programs.MOST_W_TERMS // w_terms)


def half_turns(tiles: int) -> np.ndarray:
    """Pairs (tiles / 2, 2) of all `tiles` tiles of E with those half a turn on."""
    return np.arange(tiles).reshape(2, -1).T


def integrate(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    lights: Sequence[RingIntegrals],
    pairs: np.ndarray | None = None,
) -> np.ndarray:
    """Chebyshev coefficients over w of X, Y, Z of every light: float32 (lights, rings, 3 w_terms, azimuths), from E.

    `s_max_per_um` is where the Chebyshev nodes of E in s end. `rho` (rings,). `lights`: at most `most_lights`, each
    over its `whole_span`; all have as many w_terms, a multiple of 4. Groups of rings with equal points take E once
    for all of them. `pairs` (pairs, 2) are the places in E of the tiles that are taken, None for all; the azimuths of
    their first column come first in the result. Where a ring takes radii below 0, they are half a turn apart.
    """
    w_terms = lights[0].reflectance.shape[1]
    to_w_terms = np.stack([_to_w_terms(rho, each.points, w_terms) for each in lights])
    taken = half_turns(len(spectrum)) if pairs is None else pairs
    return _apply(spectrum, radius_per_um, s_max_per_um, rho, lights, taken, to_w_terms, None)


def integrate_at(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    light: RingIntegrals,
    pairs: np.ndarray,
    w: np.ndarray,
) -> np.ndarray:
    """X, Y, Z at one |w| of each texel: float32 (rings, 3, azimuths), from E, at the azimuths of some of its tiles.

    `w` (rings, azimuths) is within the span of `light` for every ring; other parameters are as in `integrate`.
    """
    w_terms = light.reflectance.shape[1]
    to_terms = np.broadcast_to(chebyshev(w_terms)[0], (len(rho), w_terms, w_terms))
    low, high = light.points.scaled(light.span.low), light.points.scaled(light.span.high)
    own_x = (2.0 * (w - low[:, None]) / np.maximum(high - low, _LEAST_SPAN)[:, None] - 1.0).astype(np.float32)
    found = _apply(spectrum, radius_per_um, s_max_per_um, rho, [light], pairs, to_terms, own_x)
    return np.asarray(found[0])


def _apply(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    lights: Sequence[RingIntegrals],
    pairs: np.ndarray,
    to_w_terms: np.ndarray,
    own_x: np.ndarray | None,
) -> np.ndarray:
    """Runs both kernels; `own_x` is the argument of T_k of each texel, None for all terms."""
    _, radii, s_nodes, _ = spectrum.shape
    w_terms, rings = lights[0].reflectance.shape[1], len(rho)
    program, groups, operator = _operator(radius_per_um, s_nodes, s_max_per_um, rho, lights)
    outputs = CHANNELS * (w_terms if own_x is None else 1)
    out = device.empty((len(lights), rings, outputs, LANES * pairs.size), np.float32)
    power, result = device.lent(spectrum), device.shared(out)
    program.launch(
        "apply_operator",
        (groups, len(pairs)),
        power,
        np.int32(radii),
        device.upload(pairs.astype(np.int32)),
        *operator,
        np.int32(rings),
        np.int32(s_nodes),
        np.int32(w_terms),
        device.upload(to_w_terms.astype(np.float32)),
        np.int32(own_x is not None),
        device.upload(np.zeros(1, np.float32) if own_x is None else own_x),
        result,
    )
    return device.settle(result, out)


def _operator(
    radius_per_um: np.ndarray,
    s_nodes: int,
    s_max_per_um: float,
    rho: np.ndarray,
    lights: Sequence[RingIntegrals],
) -> tuple[device.Program, int, list[Any]]:
    """The program, how many groups there are, and their operator from E on `s_nodes`, in the kernels' order."""
    w_terms = lights[0].reflectance.shape[1]
    program = programs.polar(s_nodes=s_nodes, w_terms=w_terms)
    groups, span, kappa_per_um, place = _groups(lights)
    where = [device.upload(a.astype(np.int32)) for a in (groups, _rings(lights), place)]
    inputs = [
        device.upload(a)
        for a in (
            radius_per_um,
            rho,
            np.concatenate([each.points.stretch for each in lights]),
            kappa_per_um,
            np.concatenate([each.quadratures.lambda_um for each in lights]),
            fourth_column(np.concatenate([each.quadratures.weights for each in lights])).astype(np.float32),
            np.concatenate([each.reflectance for each in lights]).astype(np.float32, copy=False),
            chebyshev(s_nodes)[0].astype(np.float32),
            span.nodes(w_terms).astype(np.float32),
        )
    ]
    ring_points = sum(int(each.points.rings @ each.points.count) for each in lights)
    numbers = operator_numbers(len(place), ring_points, len(lights) * len(rho), s_nodes, w_terms)
    weights = [device.result_buffer(4 * n) for n in numbers]
    sizes = np.float32(s_max_per_um), np.int32(len(rho)), np.int32(s_nodes), np.int32(w_terms)
    program.launch("build_operator", (len(groups),), *where, *inputs, *sizes, *weights)
    return program, len(groups), [*where, *weights]


def operator_numbers(points: int, ring_points: int, rings: int, s_nodes: int, w_terms: int) -> tuple[int, ...]:
    """Sizes of the operator's arrays: lagrange_r, cardinal_s and point_weights in float; used, two int of each ring.

    points: of all groups. ring_points: of the rings, each with all those of its group; as rings, every light's count.
    """
    return points * ORDER, points * s_nodes * w_terms, ring_points * CHANNELS * w_terms, 2 * rings


def _groups(lights: Sequence[RingIntegrals]) -> tuple[np.ndarray, Span, np.ndarray, np.ndarray]:
    """The kernels' Group of every group, int (groups, 8), their spans, and the kappa and places of their points."""
    each = [light.groups() for light in lights]
    common = [key for key in each[0] if all(key in other for other in each[1:])]
    served = [(key, 0, len(lights)) for key in common]
    served += [(key, at, 1) for at, groups in enumerate(each) for key in groups if key not in common]
    groups, kappa, place, first = [], [], [], 0
    for key, light, count in served:
        of, points = each[light][key], lights[light].points
        kappa.append(points.kappa_per_um[of])
        place.append(points.place[of])
        groups.append((first, len(kappa[-1]), key.on_radii, key.on_nodes, key.ring, key.rings, light, count))
        first += len(kappa[-1])
    span = Span(np.array([key.low for key, _, _ in served]), np.array([key.high for key, _, _ in served]))
    return np.array(groups), span, np.concatenate(kappa), np.concatenate(place)


def _rings(lights: Sequence[RingIntegrals]) -> np.ndarray:
    """The kernels' Ring of every light's rings, int (lights rings, 4)."""
    points = np.concatenate([each.points.count[each.points.group] for each in lights])
    count = np.concatenate([each.quadratures.count for each in lights])
    nodes = np.cumsum([0] + [len(each.quadratures.lambda_um) for each in lights])
    first = np.concatenate([each.quadratures.first + begin for each, begin in zip(lights, nodes, strict=False)])
    return np.stack((np.cumsum(points) - points, first, count, np.cumsum(count) - count), axis=-1)


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
