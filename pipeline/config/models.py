"""The TOML that describes one material: its sections, its defaults and its faults.

Keys and units are those of docs/usage.md; an unknown key is a fault. Each section is a value of the room that reads
it. `read.load` collects every fault of a file before it raises, each with its key path; faults between sections are
looked for once each of them is sound.
"""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from pipeline.layouts import TableSettings
from pipeline.optics.brdf import Radiometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.optics.scene import Direction, Lights, Scene
from pipeline.surface.source import SurfaceSource
from pipeline.tables.polar.layout import PolarLayout
from pipeline.validated import Positive, Validated

# what a polar table is planned for where no budget is set
DEFAULT_DELTA_E = 0.1


class Accuracy(Validated):
    """The error budget: mean CIELAB error at one exposure. Polar tables are planned for it, and for 0.1 without."""

    delta_e: Annotated[float, Field(ge=1e-3, le=100)] | None = None
    exposure_ru: Positive = 7500.0


class Render(Validated):
    size: Annotated[int, Field(ge=16, le=4096)] = 512
    lights: Lights = Field(default_factory=lambda: [Direction(theta_deg=0.0)])
    exposure_ru: Positive = 1500.0


class Publish(Validated):
    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")] = "1.0.0"
    precision: Literal["float", "half"] = "float"
    # RGBA textures of a polar table; "auto": all in float, as few as the error budget allows in half
    textures: Literal["auto", "full"] | Annotated[int, Field(ge=1)] = "auto"
    licence: str | None = None


class Config(Validated):
    """One material, whole; the light is the TOML's [spectrum]."""

    model_config = ConfigDict(serialize_by_alias=True)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    surface: SurfaceSource
    coherence: Coherence = Coherence()
    light: Light = Field(default=Light(), alias="spectrum")
    material: Material = Material()
    table: TableSettings = PolarLayout()
    accuracy: Accuracy = Accuracy()
    scene: Scene | None = None
    render: Render = Render()
    publish: Publish = Publish()

    @property
    def budget_delta_e(self) -> float:
        """The mean CIELAB error that a polar table is planned for."""
        return DEFAULT_DELTA_E if self.accuracy.delta_e is None else self.accuracy.delta_e

    @property
    def radiometry(self) -> Radiometry:
        """Light, material and window: all that turns |P|^2 into radiance."""
        return Radiometry(self.light, self.material, self.coherence.sigma_um, self.table.mean_step_nm)

    @model_validator(mode="after")
    def maps_show_the_scene(self) -> Self:
        """Without lights of their own, maps take the scene's."""
        if self.scene is None or "lights" in self.render.model_fields_set:
            return self
        # frozen, but not yet handed out
        object.__setattr__(self, "render", self.render.model_copy(update={"lights": self.scene.lights}))
        return self
