"""The points of a surface that the pixels of cameras see, each with its tangent frame."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import ceil, sqrt
from pathlib import Path

import numpy as np

from pipeline.arrays import Array
from pipeline.scene import mesh
from pipeline.scene.cameras import Camera
from pipeline.scene.model import Mesh, Scene

# rays of all cameras; larger pictures are cast in every second or third row and column
_MOST_RAYS = 2**17
# two neighbours are on one sheet where the chord between them is within 30 degrees of both surfaces
_SHEET = 0.5
# shorter vectors have lost their digits: the direction along is normal to the surface, or normals cancel
_SHORTEST = 1e-6


class UnseenError(ValueError):
    """A scene whose cameras see nothing; `key` is the one at fault."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


@dataclass(frozen=True)
class Seen:
    """What rays meet, one entry per ray.

    frame: rows x, y, z of the sample's frame in the scene's (n, 3, 3), NaN where a ray meets nothing or the surface's
    back. wr: unit vectors towards the camera in the sample's frame (n, 3). point: in the scene's frame (n, 3); finite
    also where the front has no frame.
    """

    frame: Array
    wr: Array
    point: Array

    @property
    def met(self) -> np.ndarray:
        """Which rays meet the front of the surface, bool (n,)."""
        return np.asarray(np.isfinite(self.wr[:, 2]))


@dataclass(frozen=True)
class Raster:
    """What a camera sees on a raster of rays.

    camera: it. step: distance of the rays in pixels. rows, columns: of the raster.
    seen: by row and column. weight: solid angle of each ray's part of the picture (n,), sr, 0 where nothing is met.
    """

    camera: Camera
    step: int
    rows: int
    columns: int
    seen: Seen
    weight: Array

    def cast(self, scene: Scene, index: np.ndarray, offset: Array) -> Seen:
        """Casts rays through other points of the raster's parts.

        scene: of the camera. index: of the parts (n,). offset: within them, 0 to 1 (n, 2).
        """
        column = self.step * (index % self.columns + offset[:, 0])
        row = self.step * (index // self.columns + offset[:, 1])
        rays, _ = self.camera.rays(column, row)
        return _meet(self.camera, surface_of(scene), scene.sample, rays)

    @cached_property
    def neighbours(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Pairs of adjacent rays that meet the same sheet of the surface: their indices, across and down."""
        at = np.arange(self.rows * self.columns).reshape(self.rows, self.columns)
        pairs = [(at[:, :-1].ravel(), at[:, 1:].ravel()), (at[:-1].ravel(), at[1:].ravel())]
        return [(one[same], two[same]) for one, two in pairs for same in [self._one_sheet(one, two)]]

    def _one_sheet(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        between = self.seen.point[two] - self.seen.point[one]
        length = np.linalg.norm(between, axis=1)
        out = [np.abs(np.sum(between * self.seen.frame[side][:, 2], axis=1)) for side in (one, two)]
        # NaN, where one of them meets nothing, is not below
        return np.asarray((out[0] <= _SHEET * length) & (out[1] <= _SHEET * length))


def surface_of(scene: Scene) -> mesh.Surface | None:
    """Reads the mesh of a scene, None for a flat sample. Raises ValueError and KeyError as `mesh.read` does."""
    return None if scene.mesh is None else _surface(scene.mesh.model_dump_json(), _changed(scene))


def rasters(scene: Scene) -> list[Raster]:
    """Casts the rays of all cameras of a scene, which has some.

    Raises UnseenError where a camera sees nothing, and ValueError and KeyError as `mesh.read` does.
    """
    return _rasters(scene.model_dump_json(include={"cameras", "sample", "mesh"}), _changed(scene))


def _changed(scene: Scene) -> int:
    return 0 if scene.mesh is None else Path(scene.mesh.path).stat().st_mtime_ns


@lru_cache(maxsize=2)
def _surface(key: str, _changed_ns: int) -> mesh.Surface:
    return mesh.read(Mesh.model_validate_json(key))


@lru_cache(maxsize=4)
def _rasters(key: str, _changed_ns: int) -> list[Raster]:
    scene = Scene.model_validate_json(key[:-1] + ',"lights":[{"theta_deg":0}]}')
    cameras = scene.cameras or []
    rays = sum(camera.size[0] * camera.size[1] for camera in cameras)
    step = ceil(sqrt(max(1.0, rays / _MOST_RAYS)))
    return [_raster(scene, camera, i, step) for i, camera in enumerate(cameras)]


def _raster(scene: Scene, camera: Camera, number: int, step: int) -> Raster:
    columns, rows = (ceil(size / step) for size in camera.size)
    row, column = (step * (grid.ravel() + 0.5) for grid in np.indices((rows, columns), np.float64))
    rays, solid_angle = camera.rays(column, row)
    seen = _meet(camera, surface_of(scene), scene.sample, rays)
    if scene.mesh is not None and not np.isfinite(seen.frame).any() and np.isfinite(seen.point).any():
        raise UnseenError(
            "mesh.along", "expected a direction in the surface, got one that is normal to all that is seen"
        )
    if not seen.met.any():
        what = "flat sample" if scene.mesh is None else "front of the mesh"
        raise UnseenError(f"cameras.{number}", f"expected a view of the {what}, but none of its pixels meets it")
    return Raster(camera, step, rows, columns, seen, np.where(seen.met, step**2 * solid_angle, 0.0))


def _meet(camera: Camera, surface: mesh.Surface | None, sample: tuple[float, float] | None, rays: Array) -> Seen:
    """Finds what the rays (n, 3) of a camera meet first."""
    origin = np.array(camera.position, float)
    if surface is None:
        return _meet_flat(origin, rays, sample or (0.0, 0.0))
    triangle = surface.first_hits(origin, rays)
    hit = np.flatnonzero(triangle >= 0)
    point, normal, along, flat = surface.at(origin, rays[hit], triangle[hit])
    frame = _frames(normal, along)
    back = np.sum(flat * rays[hit], axis=1) >= 0.0
    frame[back], point[back] = np.nan, np.nan
    return _spread(len(rays), hit, frame, -rays[hit], point)


def _meet_flat(origin: Array, rays: Array, sample: tuple[float, float]) -> Seen:
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(rays[:, 2] * origin[2] < 0.0, -origin[2] / rays[:, 2], np.nan)
    point = origin + distance[:, None] * rays
    inside = (np.abs(point[:, :2]) <= 0.5 * np.array(sample)).all(axis=1) & (origin[2] > 0.0)
    hit = np.flatnonzero(inside)
    return _spread(len(rays), hit, np.tile(np.eye(3), (len(hit), 1, 1)), -rays[hit], point[hit])


def _spread(count: int, hit: np.ndarray, frame: Array, towards: Array, point: Array) -> Seen:
    """Arranges what was met by ray; views below the horizon of their frame meet nothing."""
    local = np.einsum("nij,nj->ni", frame, towards)
    below = ~(np.isfinite(local).all(axis=1) & (local[:, 2] > 0.0))
    local[below], frame[below] = np.nan, np.nan
    frames, views, points = np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    frames[hit], views[hit], points[hit] = frame, local, point
    return Seen(frames, views, points)


def _frames(normal: Array, along: Array) -> Array:
    """Makes right-handed frames (n, 3, 3), rows x, y, z: z the normal, x the part of `along` across it.

    They are NaN where a normal has no length, or `along` is normal to the surface.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        z = np.where(size > _SHORTEST, normal / size, np.nan)
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        across = along - np.sum(along * z, axis=1, keepdims=True) * z
        size = np.linalg.norm(across, axis=1, keepdims=True)
        x = np.where(size > _SHORTEST, across / size, np.nan)
    return np.stack([x, np.cross(z, x), z], axis=1)
