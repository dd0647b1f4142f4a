"""Compression of a polar table to few textures: low rank over channels and terms in |w|, for half floats.

The 3 w_terms numbers t of a texel are approximated by combinations of a few vectors that all texels share:

    t[c, k] = g(rho) sum_o texture[o] basis[o, c, k]

The basis holds the principal components of the texels: in opponent channels like those of CIELAB, normalised to unit
length because the eye sees ratios, over the distribution of |w| of random directions, with each ring weighted by the
share of random directions on it. The projection is one matrix for all texels, so textures are as smooth as the table
and the same splines interpolate them.

The envelope g(rho) = (1 + (rho / radius)^2)^-exponent removes the decay away from the mirror direction from the
textures. It multiplies after interpolation. Hence the samples are divided by it, and their spline coefficients are
computed again.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kernels import cubic_spline
from pipeline.arrays import Array
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.diffraction.tiles import Tiles
from pipeline.optics import geometry
from pipeline.optics.brdf import Radiometry
from pipeline.scene.model import Scene
from pipeline.scene.pairs import random_pairs
from pipeline.tables.polar.table import PolarTable, w_position

CHANNELS = 4  # outputs per texture: RGBA
_DIRECTIONS, _SEED = 100_000, 12
# CIELAB linearised at white
_OPPONENT = np.array([[0.0, 1.0, 0.0], [500 / 116 / 0.9505, -500 / 116, 0.0], [0.0, 200 / 116, -200 / 116 / 1.0888]])
# lower limit of a ring's weight, relative to the mean: few random directions lie in the specular lobe, which images
# show
_LEAST_RING = 0.1
# weight of |w| = w_max, where light and view have the same direction: random directions are rarely near it, lamps at
# the camera are. Two textures of the snake scans, mean dE over the map of a normal light and over random directions:
# 0.17 to 0.19 and 0.28 to 0.31 at 0.05, 0.13 to 0.16 and 0.30 to 0.33 at 0.2
_AT_W_MAX = 0.2
# regularises the Gram matrix, which a narrow range of |w| in a scene makes singular
_LEAST_GRAM = 1e-6
_ENVELOPE_RADII = 64
# relative to the brightest ring: darker rings are black at any exposure, and the envelope ignores their level
_BLACK = 1e-9


@dataclass(frozen=True)
class Envelope:
    """The envelope g(rho) = (1 + (rho / radius)^2)^-exponent.

    radius: rho at which the decay begins, dimensionless. exponent: 0 for a constant envelope.
    """

    radius: float = 1.0
    exponent: float = 0.0

    def at(self, rho: Array) -> Array:
        """Computes g (...,) at rho (...,), dimensionless."""
        return np.asarray((1.0 + (rho / self.radius) ** 2) ** -self.exponent)


@dataclass(frozen=True)
class Textures:
    """A polar table as textures of spline coefficients; look-ups are multiplied by the basis and the envelope.

    values: float32 (rings, outputs, azimuths), outputs a multiple of 4. basis: (outputs, 3, w terms).
    tiles: as those of a polar table. envelope: g(rho).
    """

    values: NDArray[np.float32]
    basis: Array
    tiles: Tiles
    envelope: Envelope = Envelope()

    @property
    def grid(self) -> PolarGrid:
        """The rings and azimuths."""
        return self.tiles.grid

    @property
    def count(self) -> int:
        """Number of RGBA textures."""
        return int(self.values.shape[1]) // CHANNELS

    @property
    def nbytes(self) -> int:
        """Bytes of the textures."""
        return self.values.nbytes

    def look_up(self, uvw: Array) -> Array:
        """Computes XYZ / (C cos ti) (directions, 3) at `uvw` (directions, 3); NaN outside the covered tiles."""
        return self.envelope.at(np.hypot(uvw[:, 0], uvw[:, 1]))[:, None] * self._reconstructed.look_up(uvw)

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (directions,) for unit vectors wi, wr (directions, 3), as a polar table does."""
        return self._reconstructed.direction_factor(radiometry, wi, wr)

    @cached_property
    def _reconstructed(self) -> PolarTable:
        return self.table()

    def table(self) -> PolarTable:
        """Reconstructs the polar table, without the envelope; multiply look-ups by `envelope.at(rho)`."""
        outputs, _, terms = self.basis.shape
        flat = self.basis.reshape(outputs, -1).T.astype(np.float32)
        rings, _, azimuths = self.values.shape
        return PolarTable(np.matmul(flat, self.values).reshape(rings, 3, terms, azimuths), self.tiles)


def most_textures(table: PolarTable) -> int:
    """Computes how many RGBA textures hold a table without compression."""
    return 3 * table.w_terms // CHANNELS


def whole(table: PolarTable) -> Textures:
    """Arranges a table as textures without compression: output o is channel o // w_terms, term o % w_terms."""
    rings, channels, terms, azimuths = table.values.shape
    outputs = channels * terms
    values = table.values.reshape(rings, outputs, azimuths)
    return Textures(values, np.eye(outputs).reshape(outputs, channels, terms), table.tiles)


def compress(table: PolarTable, textures: int, scene: Scene | None) -> Textures:
    """Compresses a table by the texel of the mirror directions and the principal components of what it leaves.

    table: the polar table. textures: number of RGBA textures.
    scene: lights and views whose directions determine the weights; None for all directions.
    Returns the textures, with a constant envelope.
    """
    full, outputs = whole(table), CHANNELS * textures
    density, gram = _weights(table, scene)
    # |metric t|^2 is the visible error: in opponent channels, mean over |w|
    metric = np.kron(_OPPONENT, np.linalg.cholesky(gram).T)
    moments = sum(
        weight * _unit_moments(metric @ ring[:, covered].astype(np.float64))
        for weight, ring, covered in zip(density, full.values, table.tiles.mask(), strict=True)
    )
    kept = _components(moments, metric @ _mirror_texel(full), outputs)
    project = (kept.T @ metric).astype(np.float32)
    basis = np.asarray(np.linalg.solve(metric, kept).T.reshape(outputs, 3, table.w_terms))
    return Textures(np.matmul(project, full.values), basis, table.tiles)


def _mirror_texel(textures: Textures) -> Array:
    """Computes the value (outputs,) of the first ring, which is one point; 0 where none of its tiles is covered."""
    around = samples(textures.values[:3])[0][:, textures.tiles.mask()[0]]
    return np.asarray(np.sum(around, axis=1) / max(around.shape[1], 1), dtype=np.float64)


def _components(moments: Array, first: Array, count: int) -> Array:
    """Finds orthonormal vectors (n, count): `first` (n,) and the principal components of `moments` (n, n) across it.

    Without light in the mirror directions `first` is zero, and all are principal components.
    """
    length = np.linalg.norm(first)
    if not length:
        return np.asarray(np.linalg.eigh(moments)[1][:, : -count - 1 : -1])
    unit = first[:, None] / length
    across = np.eye(len(first)) - unit @ unit.T
    _, vectors = np.linalg.eigh(across @ moments @ across)
    return np.asarray(np.concatenate([unit, vectors[:, :-count:-1]], axis=1))


def _unit_moments(texels: Array) -> Array:
    """Computes the sum of t t^T / |t|^2 over texels (outputs, azimuths)."""
    length = np.linalg.norm(texels, axis=0)
    unit = texels / np.where(length > 0.0, length, 1.0)
    return np.asarray(unit @ unit.T)


def _weights(table: PolarTable, scene: Scene | None) -> tuple[Array, Array]:
    """Computes the weights of the rings (rings,) and the mean of T_k T_l (w terms, w terms) by random directions."""
    uvw = geometry.uvw(*random_pairs(scene, _DIRECTIONS, _SEED))
    rho = np.hypot(uvw[:, 0], uvw[:, 1])
    rings = table.grid.rings
    nearest = np.clip(np.rint(rings.ring_from_rho(rho)).astype(int), 0, rings.count - 1)
    landed = np.bincount(nearest, minlength=rings.count).astype(np.float64)
    density = landed * (rings.count / len(rho)) + _LEAST_RING
    cosines = np.cos(np.arange(table.w_terms) * np.arccos(w_position(rho, uvw[:, 2]))[:, None])
    reached: Array = cosines.T @ cosines / len(cosines)
    # T_k(1) = 1 for every k
    gram = (1.0 - _AT_W_MAX) * reached + _AT_W_MAX
    return density, gram + _LEAST_GRAM * np.mean(np.diag(gram)) * np.eye(len(gram))


def weighting_bytes(w_terms: int) -> int:
    """Computes the memory in which the weights are found, bytes: T_k at the directions, with their angles."""
    return 3 * 8 * _DIRECTIONS * w_terms


def flattened(textures: Textures) -> Textures:
    """Divides textures by the envelope that fits them best, which narrows their range for half floats."""
    rho, nodes = textures.grid.rings.rho(), samples(textures.values)
    envelope = _fit(rho, nodes, textures.tiles.mask())
    flat = nodes / envelope.at(rho).astype(np.float32)[:, None, None]
    values = cubic_spline.coefficients(flat, textures.tiles.every_of_ring)
    return replace(textures, values=values, envelope=envelope)


def _fit(rho: Array, nodes: NDArray[np.float32], covered: NDArray[np.bool_]) -> Envelope:
    """Fits the envelope to the logarithm of the rings' root mean squares.

    rho: (rings,). nodes: (rings, outputs, azimuths), of which those that are covered (rings, azimuths) count.
    """
    power = np.mean(nodes.astype(np.float64) ** 2, axis=1)
    count = covered.sum(axis=1)
    size = np.sqrt(np.sum(power, axis=1, where=covered)[count > 0] / count[count > 0])
    if not size.any():
        return Envelope()
    level = np.log(np.maximum(size, _BLACK * size.max()))
    # the smallest radius spans the four rings of a spline, so that g varies no faster than the samples
    radii = np.geomspace(rho[4], rho[-1], _ENVELOPE_RADII)
    return min((_exponent(rho[count > 0], level, radius) for radius in radii), key=lambda found: found[0])[1]


def _exponent(rho: Array, level: Array, radius: float) -> tuple[float, Envelope]:
    """Fits the exponent to `level` (rings,) for a radius; returns the rms residual and the envelope."""
    fall = np.log1p((rho / radius) ** 2)
    exponent = -float(np.polyfit(fall, level, 1)[0])
    left = np.std(level + exponent * fall)
    return float(left), Envelope(float(radius), exponent)


def samples(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Computes the values of a B-spline at its nodes, by (1, 4, 1) / 6 along rings and azimuths.

    Rings continue below the first as the opposite half turn, and are mirrored at the last.

    values: spline coefficients, float32 (rings, outputs, azimuths). Returns samples of the same shape.
    """
    around = (np.roll(values, 1, axis=2) + 4.0 * values + np.roll(values, -1, axis=2)) / 6.0
    opposite = np.roll(around[1:2], values.shape[2] // 2, axis=2)
    lower, upper = np.concatenate([opposite, around[:-1]]), np.concatenate([around[1:], around[-2:-1]])
    return np.asarray((lower + 4.0 * around + upper) / 6.0, dtype=np.float32)
