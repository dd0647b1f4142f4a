"""The lights of a scene: a config's scene.lights, and directions of the light of a map."""

from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, field_validator

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.scene.environment import EnvironmentMap, read
from pipeline.scene.patches import SphericalPatch, cap
from pipeline.validated import Azimuth, Pair, Validated, existing_file

# far below the width of any lobe, and above the rounding of whole turns
_SAME_DEG = 1e-6
# the sun as seen from the earth
SUN_DIAMETER_DEG = 0.53
Power = Annotated[float, Field(ge=1e-12, le=1e12)]
Elevation = Annotated[float, Field(ge=0, le=180)]


class Direction(Validated):
    """A direction that points away from the surface: polar angle from the normal, azimuth from +x to +y, degrees."""

    theta_deg: Annotated[float, Field(ge=0, lt=90)]
    phi_deg: Azimuth = 0.0

    def same_as(self, other: "Direction") -> bool:
        """Says whether both are one direction; whole turns, and the azimuth of the normal, make no difference."""
        turned = 0.0 if self.theta_deg == 0 else (self.phi_deg - other.phi_deg + 180.0) % 360.0 - 180.0
        return abs(self.theta_deg - other.theta_deg) < _SAME_DEG and abs(turned) < _SAME_DEG

    @property
    def vector(self) -> Array:
        """The unit vector (3,) towards the light or the view."""
        return geometry.direction(*np.radians([self.theta_deg, self.phi_deg]))


class _Disc(Validated):
    """A light that fills a disc of the sky around a direction; angles from +z and from +x to +y, degrees.

    power: relative to the other lights'.
    """

    theta_deg: Elevation
    phi_deg: Azimuth = 0.0
    power: Power = 1.0

    @property
    def radius(self) -> float:
        """Half the angle under which the light is seen, radians; 0 for parallel light."""
        return 0.0

    @property
    def centre(self) -> Array:
        """The unit vector (3,) towards the middle."""
        return geometry.direction(*np.radians([self.theta_deg, self.phi_deg]))

    @property
    def shown(self) -> tuple[float, float]:
        """The light of a map: theta and phi, degrees."""
        return self.theta_deg, self.phi_deg

    @property
    def solid_angle(self) -> float:
        """The solid angle, sr."""
        return float(2.0 * np.pi * (1.0 - np.cos(self.radius)))

    @property
    def largest_sine(self) -> float:
        """The largest sine of the polar angle above the horizon."""
        return float(np.sin(min(np.radians(self.theta_deg) + self.radius, 0.5 * np.pi)))

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draws unit vectors (count, 3) towards the light."""
        return cap(self.centre, self.radius).draw(rng, count) if self.radius else np.tile(self.centre, (count, 1))

    def lattice(self, spacing: float) -> tuple[Array, Array]:
        """Divides the light into cells with sides of at most `spacing`, rad; middles (n, 3) and powers (n,)."""
        if not self.radius:
            return self.centre[None], np.array([self.power])
        middles, areas = cap(self.centre, self.radius).lattice(spacing)
        return middles, self.power * areas / areas.sum()

    def holds(self, direction: Array) -> bool:
        """Whether a unit vector (3,) points to the light, to a millionth of a degree."""
        chord = float(np.linalg.norm(self.centre - direction))
        return bool(chord <= 2.0 * np.sin(0.5 * min(self.radius + np.radians(_SAME_DEG), np.pi)))


class Parallel(_Disc):
    """Parallel light, as of a laser or a distant lamp."""

    kind: Literal["direction"] = "direction"


class Cone(_Disc):
    """A round lamp that is seen under an angle of `diameter_deg`, degrees, equally bright everywhere."""

    kind: Literal["cone"]
    diameter_deg: Annotated[float, Field(gt=0, le=180)]

    @property
    def radius(self) -> float:
        return float(np.radians(0.5 * self.diameter_deg))


class Sun(_Disc):
    """The sun: a disc of 0.53 degrees, without the darkening of its limb."""

    kind: Literal["sun"]

    @property
    def radius(self) -> float:
        return float(np.radians(0.5 * SUN_DIAMETER_DEG))


class Range(Validated):
    """Light from anywhere between two polar angles and two azimuths, equally bright.

    theta_deg: [from, to], from +z, degrees. phi_deg: [from, to], from +x to +y, degrees; without it, all azimuths.
    power: relative to the other lights', of the whole range.
    """

    kind: Literal["range"]
    theta_deg: Annotated[tuple[Elevation, Elevation], Field(strict=False)]
    phi_deg: Pair = (0.0, 360.0)
    power: Power = 1.0

    @field_validator("theta_deg", "phi_deg")
    @classmethod
    def _rises(cls, value: tuple[float, float]) -> tuple[float, float]:
        return interval(value)

    @property
    def patch(self) -> SphericalPatch:
        """The directions of the range."""
        return patch_of(self.theta_deg, self.phi_deg)

    @property
    def shown(self) -> tuple[float, float]:
        """The light of a map: theta and phi of the middle, degrees."""
        return 0.5 * sum(self.theta_deg), 0.5 * sum(self.phi_deg)

    @property
    def solid_angle(self) -> float:
        """The solid angle, sr."""
        return self.patch.solid_angle

    @property
    def largest_sine(self) -> float:
        """The largest sine of the polar angle above the horizon."""
        return float(np.sin(np.radians(min(self.theta_deg[1], 90.0))))

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draws unit vectors (count, 3) towards the light."""
        return self.patch.draw(rng, count)

    def lattice(self, spacing: float) -> tuple[Array, Array]:
        """Divides the light into cells with sides of at most `spacing`, rad; middles (n, 3) and powers (n,)."""
        middles, areas = self.patch.lattice(spacing)
        return middles, self.power * areas / areas.sum()

    def holds(self, direction: Array) -> bool:
        """Whether a unit vector (3,) points to the light."""
        return bool(self.patch.holds(direction[None])[0])


class Environment(Validated):
    """The light of an environment map, an EXR of latitude and longitude whose north pole is +z.

    path: relative to the config. power: relative to the other lights', of the whole sphere.
    """

    kind: Literal["environment"]
    path: str
    power: Power = 1.0

    resolve_path = field_validator("path")(existing_file)

    @property
    def map(self) -> EnvironmentMap:
        """The map. Raises ValueError where it cannot be read or is no light."""
        return _read(self.path, Path(self.path).stat().st_mtime_ns)

    @property
    def shown(self) -> tuple[float, float]:
        """The light of a map: theta and phi of the normal, because every direction above the horizon may be lit."""
        return 0.0, 0.0

    @property
    def solid_angle(self) -> float:
        """The solid angle, sr."""
        return 4.0 * np.pi

    @property
    def largest_sine(self) -> float:
        """The largest sine of the polar angle above the horizon."""
        return 1.0

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draws unit vectors (count, 3) towards the light."""
        return self.map.draw(rng, count)

    def lattice(self, spacing: float) -> tuple[Array, Array]:
        """Divides the light into cells with sides of at most `spacing`, rad; middles (n, 3) and powers (n,)."""
        middles, powers = self.map.lattice(spacing)
        return middles, self.power * powers

    def holds(self, direction: Array) -> bool:  # noqa: ARG002
        """Whether a unit vector (3,) points to the light: any may."""
        return True


@lru_cache(maxsize=4)
def _read(path: str, _changed_ns: int) -> EnvironmentMap:
    return read(Path(path))


def interval(value: tuple[float, float]) -> tuple[float, float]:
    """Checks [from, to], degrees. Raises ValueError where it falls, or is more than a turn."""
    if not 0.0 < value[1] - value[0] <= 360.0 or max(map(abs, value)) > 3600.0:
        raise ValueError(f"expected [from, to] with from < to, at most 360 apart, got [{value[0]:g}, {value[1]:g}]")
    return value


def patch_of(theta_deg: tuple[float, float], phi_deg: tuple[float, float]) -> SphericalPatch:
    """Returns the patch of two intervals about +z, degrees."""
    low, high, start, end = (float(np.radians(angle)) for angle in (*theta_deg, *phi_deg))
    return SphericalPatch((low, high), (start, end))


KINDS = ("direction", "range", "cone", "sun", "environment")


def _kind(value: Any) -> str | None:
    """Finds the kind of a light: "direction" where its table does not name one."""
    kind = value.get("kind", "direction") if isinstance(value, dict) else getattr(value, "kind", "direction")
    return kind if isinstance(kind, str) else None


SceneLight = Annotated[
    Annotated[Parallel, Tag("direction")]
    | Annotated[Range, Tag("range")]
    | Annotated[Cone, Tag("cone")]
    | Annotated[Sun, Tag("sun")]
    | Annotated[Environment, Tag("environment")],
    Discriminator(
        _kind,
        custom_error_type="kind_of_light",
        custom_error_message=f"expected a kind, one of {', '.join(KINDS)}",
    ),
]
MOST_LIGHTS = 256
SceneLights = Annotated[list[SceneLight], Field(min_length=1, max_length=MOST_LIGHTS)]
Lights = Annotated[list[Direction], Field(min_length=1)]
