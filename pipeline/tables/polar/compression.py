"""Few textures for a polar table: low rank over channels and terms in |w|, and a range that half floats hold.

A texel's 3 w_terms numbers t are nearly combinations of a few that all texels share:

    t[c, k] = g(rho) sum_o texture[o] basis[o, c, k]

The basis comes from a singular value decomposition of texels at unit length, for the eye sees ratios: in Lab-like
opponent channels, over |w| as directions reach it, each ring weighted by how many directions land on it. The
projection is one matrix for all texels, so textures are as smooth as the table and the same spline interpolates them.

g(rho) = (1 + (rho / radius)^2)^-exponent takes the fall from the mirror direction outwards out of the textures. It
multiplies after interpolation, so what is interpolated has to be the flattened samples: they are filtered anew.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kernels import cubic_spline
from pipeline.arrays import Array
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.optics import geometry
from pipeline.optics.random_directions import random_pairs
from pipeline.optics.scene import Scene
from pipeline.tables.polar.table import PolarTable, w_position

CHANNELS = 4  # outputs of one texture: RGBA
_DIRECTIONS, _SEED = 100_000, 12
# L*, a*, b* of XYZ near white, without the cube roots
_OPPONENT = np.array([[0.0, 1.0, 0.0], [500 / 116 / 0.9505, -500 / 116, 0.0], [0.0, 200 / 116, -200 / 116 / 1.0888]])
# the least weight of a ring, of their mean: few random directions see the mirror lobe, and everybody looks at it
_LEAST_RING = 0.1
# weight of |w| = w_max, light and view side by side: random directions seldom come near, lamps at the camera do
_AT_W_MAX = 0.05
# a scene may keep |w| so narrow that the terms' means cannot be told apart
_LEAST_GRAM = 1e-6
_ENVELOPE_RADII = 64
# of the brightest ring: darker ones are black at any exposure, and no envelope needs to lift them
_BLACK = 1e-9


@dataclass(frozen=True)
class Envelope:
    """g(rho) = (1 + (rho / radius)^2)^-exponent."""

    radius: float = 1.0
    exponent: float = 0.0

    def at(self, rho: Array) -> Array:
        """g (...,) at rho (...,)."""
        return np.asarray((1.0 + (rho / self.radius) ** 2) ** -self.exponent)


@dataclass(frozen=True)
class Textures:
    """A polar table as textures: spline coefficients, to be multiplied by g and a basis after interpolation.

    values: float32 (rings, outputs, azimuths), outputs a multiple of 4. basis: (outputs, 3, w terms).
    """

    values: NDArray[np.float32]
    basis: Array
    grid: PolarGrid
    envelope: Envelope = Envelope()

    @property
    def count(self) -> int:
        """RGBA textures."""
        return int(self.values.shape[1]) // CHANNELS

    def table(self) -> PolarTable:
        """The table that they stand for, over g: its look-up times g(rho) is theirs."""
        outputs, _, terms = self.basis.shape
        flat = self.basis.reshape(outputs, -1).T.astype(np.float32)
        rings, _, azimuths = self.values.shape
        return PolarTable(np.matmul(flat, self.values).reshape(rings, 3, terms, azimuths), self.grid)


def most_textures(table: PolarTable) -> int:
    """RGBA textures that hold a table as it is."""
    return 3 * table.w_terms // CHANNELS


def whole(table: PolarTable) -> Textures:
    """A table as it is: output o is channel o // w_terms, term o % w_terms."""
    rings, channels, terms, azimuths = table.values.shape
    outputs = channels * terms
    values = table.values.reshape(rings, outputs, azimuths)
    return Textures(values, np.eye(outputs).reshape(outputs, channels, terms), table.grid)


def compress(table: PolarTable, textures: int, scene: Scene | None) -> Textures:
    """The best `textures` RGBA textures for a table under the lights and views of a scene, or under all."""
    full, outputs = whole(table), CHANNELS * textures
    density, gram = _landings(table, scene)
    # |metric t|^2 is the error seen: opponent channels, mean over |w|
    metric = np.kron(_OPPONENT, np.linalg.cholesky(gram).T)
    moments = sum(
        weight * _unit_moments(metric @ ring.astype(np.float64))
        for weight, ring in zip(density, full.values, strict=True)
    )
    _, vectors = np.linalg.eigh(moments)
    kept = vectors[:, : -outputs - 1 : -1]
    project = (kept.T @ metric).astype(np.float32)
    basis = np.linalg.solve(metric, kept).T.reshape(outputs, 3, table.w_terms)
    return Textures(np.matmul(project, full.values), basis, table.grid)


def _unit_moments(texels: Array) -> Array:
    """sum of t t^T / |t|^2 over texels (outputs, azimuths)."""
    length = np.linalg.norm(texels, axis=0)
    unit = texels / np.where(length > 0.0, length, 1.0)
    return np.asarray(unit @ unit.T)


def _landings(table: PolarTable, scene: Scene | None) -> tuple[Array, Array]:
    """Weight of each ring (rings,) and mean of T_k T_l (w terms, w terms), by where random directions land."""
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


def flattened(textures: Textures) -> Textures:
    """The same over the envelope that fits them best, for a range that half floats hold."""
    rho, nodes = textures.grid.rings.rho(), samples(textures.values)
    envelope = _fit(rho, nodes)
    values = cubic_spline.coefficients(nodes / envelope.at(rho).astype(np.float32)[:, None, None])
    return replace(textures, values=values, envelope=envelope)


def _fit(rho: Array, nodes: NDArray[np.float32]) -> Envelope:
    """The envelope nearest, in ratio, to the root mean squares of rings of samples (rings, outputs, azimuths)."""
    size = np.sqrt(np.mean(nodes.astype(np.float64) ** 2, axis=(1, 2)))
    if not size.any():
        return Envelope()
    level = np.log(np.maximum(size, _BLACK * size.max()))
    # over the four rings of a spline g shall vary no faster than what it flattens
    radii = np.geomspace(rho[4], rho[-1], _ENVELOPE_RADII)
    return min((_exponent(rho, level, radius) for radius in radii), key=lambda found: found[0])[1]


def _exponent(rho: Array, level: Array, radius: float) -> tuple[float, Envelope]:
    """What is left of `level` (rings,) under the best exponent for a radius, root mean square, and that envelope."""
    fall = np.log1p((rho / radius) ** 2)
    exponent = -float(np.polyfit(fall, level, 1)[0])
    left = np.std(level + exponent * fall)
    return float(left), Envelope(float(radius), exponent)


def samples(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """What spline coefficients (rings, outputs, azimuths) stand for at their nodes: (1, 4, 1) / 6 along both.

    Rings go on below the first as the opposite half turn, and are mirrored beyond the last.
    """
    around = (np.roll(values, 1, axis=2) + 4.0 * values + np.roll(values, -1, axis=2)) / 6.0
    opposite = np.roll(around[1:2], values.shape[2] // 2, axis=2)
    lower, upper = np.concatenate([opposite, around[:-1]]), np.concatenate([around[1:], around[-2:-1]])
    return np.asarray((lower + 4.0 * around + upper) / 6.0, dtype=np.float32)
