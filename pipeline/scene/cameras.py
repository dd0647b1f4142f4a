"""Cameras of a scene: pinholes, whose pixels are rays."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from pipeline.arrays import Array
from pipeline.validated import Validated

_Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Point = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], Field(strict=False)]
_Pixels = Annotated[int, Field(ge=1, le=16384)]


class Camera(Validated):
    """A pinhole camera.

    position, target: of the pinhole and of a point in the middle of the picture, in the mesh's unit and frame.
    up: the direction of the picture's top. fov_deg: angle of the picture's height, degrees.
    size: columns and rows of pixels.
    """

    position: Point
    target: Point = (0.0, 0.0, 0.0)
    up: Point = (0.0, 0.0, 1.0)
    fov_deg: Annotated[float, Field(ge=0.01, le=170)] = 40.0
    size: Annotated[tuple[_Pixels, _Pixels], Field(strict=False)] = (256, 256)

    @model_validator(mode="after")
    def looks_somewhere(self) -> Self:
        """Refuses a camera without a direction, or whose top is along it."""
        forward = np.subtract(self.target, self.position)
        length = np.linalg.norm(forward) * np.linalg.norm(self.up)
        if not length > 0.0 or np.linalg.norm(np.cross(forward, self.up)) <= 1e-6 * length:
            raise ValueError("expected a target beside the position, and an up that is not along the view; set up")
        return self

    @property
    def pixel_sr(self) -> float:
        """The solid angle of a pixel in the middle of the picture, sr."""
        return float((2.0 * np.tan(0.5 * np.radians(self.fov_deg)) / self.size[1]) ** 2)

    def rays(self, column: Array, row: Array) -> tuple[Array, Array]:
        """Computes the rays through points of the raster.

        column, row: their coordinates in pixels from the top left corner, (n,).
        Returns the unit vectors of the rays (n, 3), and the solid angle (n,), sr, of a pixel there.
        """
        forward = np.subtract(self.target, self.position)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right = right / np.linalg.norm(right)
        top = np.cross(right, forward)
        # a pixel's side at distance 1
        step = 2.0 * np.tan(0.5 * np.radians(self.fov_deg)) / self.size[1]
        across, upward = step * (column - 0.5 * self.size[0]), step * (0.5 * self.size[1] - row)
        ray = forward + across[:, None] * right + upward[:, None] * top
        length = np.linalg.norm(ray, axis=1)
        return ray / length[:, None], step**2 / length**3
