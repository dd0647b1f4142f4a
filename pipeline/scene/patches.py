"""Parts of the sphere of directions between two polar angles and two azimuths about any pole."""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import geometry


@dataclass(frozen=True)
class SphericalPatch:
    """The directions whose polar angle and azimuth about a pole lie in two intervals.

    theta, phi: the intervals, radians. turned: rotation (3, 3) from the frame of the pole to that of the directions;
    None where they are one.
    """

    theta: tuple[float, float]
    phi: tuple[float, float] = (0.0, 2.0 * np.pi)
    turned: Array | None = None

    @property
    def solid_angle(self) -> float:
        """The solid angle, sr."""
        return float((self.phi[1] - self.phi[0]) * (np.cos(self.theta[0]) - np.cos(self.theta[1])))

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draws unit vectors (count, 3), uniform over the solid angle."""
        cosine = rng.uniform(np.cos(self.theta[1]), np.cos(self.theta[0]), count)
        return self._placed(np.arccos(cosine), rng.uniform(*self.phi, count))

    def lattice(self, spacing: float) -> tuple[Array, Array]:
        """Divides the patch into cells whose sides are at most `spacing`, radians.

        The chord between two directions is sqrt(dtheta^2 + sin(theta_1) sin(theta_2) dphi^2) or less, so every
        direction of the patch is within spacing / sqrt(2) of the middle of its cell.

        Returns the middles as unit vectors (n, 3), and the cells' solid angles (n,), sr.
        """
        edges = np.linspace(*self.theta, max(1, ceil((self.theta[1] - self.theta[0]) / spacing)) + 1)
        width, middles, areas = self.phi[1] - self.phi[0], [], []
        for low, high in pairwise(edges):
            widest = np.sin(np.clip(0.5 * np.pi, low, high))
            cells = max(1, ceil(width * widest / spacing))
            azimuths = self.phi[0] + width * (np.arange(cells) + 0.5) / cells
            middles.append(self._placed(np.full(cells, 0.5 * (low + high)), azimuths))
            areas.append(np.full(cells, (np.cos(low) - np.cos(high)) * width / cells))
        return np.concatenate(middles), np.concatenate(areas)

    def holds(self, directions: Array) -> np.ndarray:
        """Says which unit vectors (n, 3) lie in the patch, to 1e-8 rad; bool (n,)."""
        local = directions if self.turned is None else directions @ self.turned
        theta, phi = np.arccos(np.clip(local[:, 2], -1.0, 1.0)), np.arctan2(local[:, 1], local[:, 0])
        slack = 1e-8 / np.maximum(np.sin(theta), 1e-8)
        beyond = np.mod(phi - self.phi[0] + slack, 2.0 * np.pi)
        around = beyond <= self.phi[1] - self.phi[0] + 2.0 * slack
        return np.asarray((theta >= self.theta[0] - 1e-7) & (theta <= self.theta[1] + 1e-7) & around)

    def _placed(self, theta: Array, phi: Array) -> Array:
        local = geometry.direction(theta, phi)
        return local if self.turned is None else local @ self.turned.T


def cap(centre: Array, radius: float) -> SphericalPatch:
    """Returns the directions within an angle, radians, of a unit vector (3,)."""
    return SphericalPatch((0.0, radius), turned=towards(centre))


def towards(pole: Array) -> Array:
    """Returns a rotation (3, 3) that turns z into a unit vector (3,)."""
    theta, phi = np.arccos(np.clip(pole[2], -1.0, 1.0)), np.arctan2(pole[1], pole[0])
    (ct, st), (cp, sp) = (np.cos(theta), np.sin(theta)), (np.cos(phi), np.sin(phi))
    return np.array([[ct * cp, -sp, st * cp], [ct * sp, cp, st * sp], [-st, 0.0, ct]])
