"""A config's [scene]: the lights and views for which a table is made. Other directions are not computed."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from pipeline.scene.cameras import Camera, Point
from pipeline.scene.lights import Environment, SceneLights, interval, patch_of
from pipeline.scene.patches import SphericalPatch
from pipeline.validated import Pair, Positive, Validated, existing_file

# errors are not measured closer to the horizon, where G grows like 1 / cos
WIDEST_DEG = 88.0
# the least range of polar angles of views
LEAST_DEG = 0.1


class Views(Validated):
    """The views of a flat sample between two polar angles and two azimuths, degrees.

    A tenth of a degree is a fifth of the pupil at 30 cm.
    """

    theta_min_deg: Annotated[float, Field(ge=0, lt=WIDEST_DEG)] = 0.0
    theta_max_deg: Annotated[float, Field(ge=LEAST_DEG, le=90)] = 90.0
    phi_deg: Pair = (0.0, 360.0)

    @field_validator("phi_deg")
    @classmethod
    def _rises(cls, value: tuple[float, float]) -> tuple[float, float]:
        return interval(value)

    @model_validator(mode="after")
    def has_views(self) -> Self:
        """Refuses an empty range."""
        if self.theta_max_deg < self.theta_min_deg + LEAST_DEG:
            raise ValueError(
                f"expected theta_max_deg at least {LEAST_DEG:g} above theta_min_deg, got {self.theta_max_deg:g} "
                f"and {self.theta_min_deg:g}"
            )
        return self

    @property
    def patch(self) -> SphericalPatch:
        """The directions of the views."""
        return patch_of((self.theta_min_deg, self.theta_max_deg), self.phi_deg)


class Mesh(Validated):
    """The surface that carries the scan's structure: an OBJ, .glb or .gltf, in the frame and unit of its file.

    path: relative to the config. along: where the scan's +x lies on it: "tangents" of the file (glTF's TANGENT, else
    from its texture coordinates), or a direction [x, y, z], of which the part in the surface counts.
    """

    path: str
    along: Literal["tangents"] | Point = "tangents"

    resolve_path = field_validator("path")(existing_file)

    @field_validator("along")
    @classmethod
    def _has_a_length(cls, value: str | tuple[float, float, float]) -> str | tuple[float, float, float]:
        if not isinstance(value, str) and not any(value):
            raise ValueError('expected "tangents" or a direction [x, y, z], got [0, 0, 0]')
        return value


class Scene(Validated):
    """What will be looked at: a flat sample in the plane z = 0 under its views or cameras, or a mesh under cameras.

    lights: all of them, in the frame of the sample or mesh. views: of a flat sample that is seen from afar.
    cameras: instead of views. sample: width (x) and height (y) of the flat sample that cameras see, about the origin.
    mesh: instead of a flat sample.
    """

    lights: SceneLights
    views: Views = Views()
    cameras: Annotated[list[Camera], Field(min_length=1, max_length=16)] | None = None
    sample: Annotated[tuple[Positive, Positive], Field(strict=False)] | None = None
    mesh: Mesh | None = None

    @model_validator(mode="after")
    def says_what_is_seen(self) -> Self:
        """Refuses keys that contradict each other."""
        if self.cameras is None and (self.mesh is not None or self.sample is not None):
            raise ValueError("expected cameras, which mesh and sample need; or views of a flat sample alone")
        if self.cameras is not None and "views" in self.model_fields_set:
            raise ValueError("expected views or cameras, got both")
        if self.cameras is not None and (self.mesh is None) == (self.sample is None):
            raise ValueError("expected cameras with a mesh, or with the size of a flat sample as sample = [x, y]")
        return self

    @property
    def is_portable(self) -> bool:
        """Whether the config alone says which directions are reached, without its files and without casting rays."""
        return self.cameras is None and not any(isinstance(light, Environment) for light in self.lights)

    @property
    def shares(self) -> np.ndarray:
        """The share of each light in the power of all, (lights,)."""
        power = np.array([light.power for light in self.lights])
        return np.asarray(power / power.sum())
