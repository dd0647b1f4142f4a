"""The directions of light and view for which a table is made."""

from typing import Annotated

from pydantic import Field

from pipeline.validated import Azimuth, Validated

# far below the width of any lobe, and above the rounding of whole turns
_SAME_DEG = 1e-6


class Direction(Validated):
    """A direction that points away from the surface: polar angle from the normal, azimuth from +x to +y, degrees."""

    theta_deg: Annotated[float, Field(ge=0, lt=90)]
    phi_deg: Azimuth = 0.0

    def same_as(self, other: "Direction") -> bool:
        """Whether both are one direction; whole turns, and the azimuth of the normal, make no difference."""
        turned = 0.0 if self.theta_deg == 0 else (self.phi_deg - other.phi_deg + 180.0) % 360.0 - 180.0
        return abs(self.theta_deg - other.theta_deg) < _SAME_DEG and abs(turned) < _SAME_DEG


class Views(Validated):
    """The cone of views up to a polar angle, degrees: a tenth of a degree is a fifth of the pupil at 30 cm."""

    theta_max_deg: Annotated[float, Field(ge=0.1, le=90)] = 90.0


Lights = Annotated[list[Direction], Field(min_length=1)]


class Scene(Validated):
    """The lights and views of a flat sample, a config's [scene]: other directions are not computed."""

    lights: Lights
    views: Views = Views()
