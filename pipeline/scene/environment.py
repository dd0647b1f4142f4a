"""Environment maps: light from all directions, in an EXR of latitude and longitude.

As in OpenEXR's ENVMAP_LATLONG, rows go from the north pole down, and the longitude falls with the column from 180
degrees at the left edge to -180 at the right. The north pole is +z, longitude 0 is +x.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.arrays import Array
from pipeline.errors import DamagedError
from pipeline.optics import geometry
from pipeline.report import exr, images
from pipeline.scene.patches import SphericalPatch, cap

# pixels of the largest map: 0.09 degrees, a sixth of the sun
MOST_PIXELS = 4096 * 2048
# luminance of linear sRGB, ITU-R BT.709
_LUMINANCE = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
# a bright direction is a group of adjacent pixels, each of at least _BRIGHT times the mean radiance; a map has at
# most _MOST_BRIGHT of them
_BRIGHT, _MOST_BRIGHT = 16.0, 32


@dataclass(frozen=True)
class Bright:
    """A bright part of a map: the cap that holds its pixels, and its share of the map's power."""

    patch: SphericalPatch
    centre: Array
    power: float


@dataclass(frozen=True)
class EnvironmentMap:
    """The light of an environment map.

    power: luminance times solid angle of each pixel (rows, columns), of sum 1. bright: its bright directions, the
    brightest first. remainder: the power of all other pixels, (rows, columns).
    """

    power: Array
    bright: tuple[Bright, ...]
    remainder: Array

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draws unit vectors (count, 3) with the density of the map's radiance."""
        rows, columns = self.power.shape
        pixel = np.searchsorted(np.cumsum(self.power), rng.random(count), side="right")
        row, column = np.divmod(np.minimum(pixel, self.power.size - 1), columns)
        top, bottom = np.cos(np.pi * row / rows), np.cos(np.pi * (row + 1) / rows)
        cosine = bottom + (top - bottom) * rng.random(count)
        return geometry.direction(np.arccos(cosine), np.pi - 2.0 * np.pi * (column + rng.random(count)) / columns)

    def lattice(self, spacing: float) -> tuple[Array, Array]:
        """Reduces the map to cells of its bright directions and of the rest, with sides of at most `spacing`, rad.

        Returns the middles of the cells that hold power, as unit vectors (n, 3), and their powers (n,).
        """
        parts = []
        for part in self.bright:
            middles, areas = part.patch.lattice(spacing)
            parts.append((middles, part.power * areas / areas.sum()))
        middles, _ = (whole := SphericalPatch((0.0, np.pi), (-np.pi, np.pi))).lattice(spacing)
        lit = np.bincount(_cells(whole, spacing, self.remainder.shape), self.remainder.ravel(), len(middles))
        parts.append((middles[lit > 0.0], lit[lit > 0.0]))
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _cells(whole: SphericalPatch, spacing: float, shape: tuple[int, ...]) -> np.ndarray:
    """Finds the cell of the sphere's lattice in which the middle of each pixel lies, (pixels,)."""
    middles, _ = whole.lattice(spacing)
    theta = np.arccos(np.clip(middles[:, 2], -1.0, 1.0))
    rings, first, counts = np.unique(np.round(theta, 9), return_index=True, return_counts=True)
    rows, columns = shape
    ring = np.minimum((np.arange(rows) + 0.5) / rows * len(rings), len(rings) - 1).astype(int)
    around = 1.0 - (np.arange(columns) + 0.5) / columns
    within = np.minimum(around[None, :] * counts[ring, None], counts[ring, None] - 1).astype(int)
    return np.asarray(first[ring, None] + within).ravel()


def read(path: Path) -> EnvironmentMap:
    """Reads and reduces an environment map. Its header is checked before its pixels are decoded.

    Raises ValueError, in one line, where it cannot be read or is no light.
    """
    try:
        found = exr.structure(path)
        if found.width * found.height > MOST_PIXELS or found.width != 2 * found.height:
            raise ValueError(
                f"expected twice as many columns as rows, at most 4096 x 2048, got {found.width} x {found.height}; "
                "scale it down"
            )
        if not {*_LUMINANCE} <= {*found.channels} and "Y" not in found.channels:
            raise ValueError(f"expected the channels R, G, B, or Y, got {', '.join(found.channels)}")
        channels = images.decode(path)
    except DamagedError as error:
        raise ValueError(str(error)) from None
    names = _LUMINANCE if {*_LUMINANCE} <= channels.keys() else {"Y": 1.0}
    planes = {name: channels[name].astype(np.float64) for name in names}
    bad = ~np.all([np.isfinite(plane) & (plane >= 0.0) for plane in planes.values()], axis=0)
    if bad.any():
        raise ValueError(f"expected finite radiances of 0 or more, got others in {bad.sum()} of {bad.size} pixels")
    radiance = sum(factor * planes[name] for name, factor in names.items())
    if not np.any(radiance):
        raise ValueError("expected light, got an image that is black everywhere")
    return reduced(np.asarray(radiance))


def reduced(radiance: Array) -> EnvironmentMap:
    """Finds the bright directions of a map of luminances (rows, columns), of any unit."""
    from scipy import ndimage

    rows, columns = radiance.shape
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    power = radiance / radiance.max() * (edges[:-1] - edges[1:])[:, None]
    power = power / power.sum()
    # the mean of a radiance over the sphere's 4 pi; both sides in power of a pixel
    label, count = ndimage.label(power > _BRIGHT * 0.5 * (edges[:-1] - edges[1:])[:, None] / columns, np.ones((3, 3)))
    # the map's left edge touches its right one
    for left, right in zip(label[:, 0], label[:, -1], strict=True):
        if left and right and left != right:
            label[label == right] = left
    sums = np.bincount(label.ravel(), power.ravel(), count + 1)
    sums[0] = 0.0
    brightest = [int(one) for one in np.argsort(sums)[::-1][:_MOST_BRIGHT] if sums[one] > 0.0]
    bright = tuple(_part(label == one, power) for one in brightest)
    return EnvironmentMap(power, bright, np.where(np.isin(label, brightest), 0.0, power))


def _part(inside: np.ndarray, power: Array) -> Bright:
    """Returns the cap of some pixels, bool (rows, columns), around the middle of their power."""
    rows, columns = power.shape
    row, column = np.nonzero(inside)
    at = geometry.direction(np.pi * (row + 0.5) / rows, np.pi - 2.0 * np.pi * (column + 0.5) / columns)
    weight = power[inside]
    centre = weight @ at
    centre /= np.linalg.norm(centre)
    # half the diagonal of a pixel lies beyond the middle of the last
    radius = float(np.arccos(np.clip((at @ centre).min(), -1.0, 1.0))) + np.pi / (np.sqrt(2.0) * rows)
    return Bright(cap(centre, radius), centre, float(weight.sum()))
