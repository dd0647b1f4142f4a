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
    """What tells whether the groups of two lights have the same points: their rings, their kind and their kappa."""

    ring: int
    rings: int
    on_radii: bool
    on_nodes: bool
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

    def groups(self) -> dict[GroupKey, slice]:
        """The points of every group, by its key."""
        found, kinds = {}, zip(self.first_ring, self.rings, self.on_radii, self.on_nodes, strict=True)
        for kind, first, count in zip(kinds, self.first, self.count, strict=True):
            of = slice(first, first + count)
            found[GroupKey(*kind, self.kappa_per_um[of].tobytes())] = of
        return found

    def reach(self, rho: np.ndarray) -> np.ndarray:
        """|w| of every ring where its group's line ends, (rings,): at the first ring's w_max."""
        return np.asarray(self.stretch * w_max(rho)[self.first_ring][self.group])


@dataclass(frozen=True)
class RingIntegrals:
    """The integrals of one light on all rings.

    points: where its rings take E. quadratures: its wavelengths and weights. reflectance: (nodes of all rings' rules
    one after the other, w_terms), which multiplies E at `group_w`.
    """

    points: LinePoints
    quadratures: RingQuadratures
    reflectance: np.ndarray


def most_lights(w_terms: int) -> int:
    """How many lights one pass can serve: their sums share what a work-item keeps."""
    return max(1, programs.MOST_W_TERMS // w_terms)


def integrate(
    spectrum: np.ndarray,
    radius_per_um: np.ndarray,
    s_max_per_um: float,
    rho: np.ndarray,
    lights: Sequence[RingIntegrals],
) -> np.ndarray:
    """Chebyshev coefficients over w of X, Y, Z of every light: float32 (lights, rings, 3 w_terms, azimuths), from E.

    `s_max_per_um` is where the Chebyshev nodes of E in s end. `rho` (rings,). `lights`: at most `most_lights`; all
    have as many w_terms, a multiple of 4. Groups of rings with equal points take E once for all of them.
    """
    tiles, radii, s_nodes, _ = spectrum.shape
    w_terms, rings = lights[0].reflectance.shape[1], len(rho)
    program, groups, operator = _operator(radius_per_um, s_nodes, s_max_per_um, rho, lights)
    to_w_terms = device.upload(
        np.stack([_to_w_terms(rho, each.points, w_terms) for each in lights]).astype(np.float32)
    )
    out = device.empty((len(lights), rings, CHANNELS * w_terms, LANES * tiles), np.float32)
    power, result = device.lent(spectrum), device.shared(out)
    size, sizes = (groups, tiles // 2), (np.int32(rings), np.int32(s_nodes), np.int32(w_terms))
    program.launch("apply_operator", size, power, np.int32(radii), *operator, *sizes, to_w_terms, result)
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
    groups, kappa_per_um, place = _groups(lights)
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
            w_nodes(w_terms).astype(np.float32),
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


def _groups(lights: Sequence[RingIntegrals]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The kernels' Group of every group, int (groups, 8), and the kappa and the places of their points."""
    each = [light.points.groups() for light in lights]
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
    return np.array(groups), np.concatenate(kappa), np.concatenate(place)


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
    reach = points.reach(rho)
    # at the rim all nodes are one
    share = np.divide(w_max(rho), reach, out=np.ones_like(rho), where=reach > 0.0)
    own = share[:, None] * (x + 1.0) - 1.0
    through = np.cos(np.arange(w_terms) * np.arccos(np.minimum(own, 1.0))[..., None]) @ to_terms
    return np.asarray(to_terms @ through)


def group_w(rho: np.ndarray, points: LinePoints, w_terms: int) -> np.ndarray:
    """|w| of every ring where its group takes E, (rings, w_terms); beyond a ring's own w_max it goes on."""
    return np.outer(points.reach(rho), w_nodes(w_terms))
