"""The TOML document that describes one material: its sections and their defaults.

docs/usage.md explains keys and units; an unknown key is a fault. Each section is a value of the package that reads
it. `read.load` reports all faults of a file at once, each with the path of its key. Relations between sections are
checked where every section is valid.
"""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from pipeline import layouts
from pipeline.layouts import TableSettings
from pipeline.optics.brdf import Radiometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.scene.lights import Direction, Lights
from pipeline.scene.model import Scene
from pipeline.surface.source import SurfaceSource
from pipeline.validated import Exposure, Validated

# the mean CIELAB error for which polar tables are planned where the config sets no budget
DEFAULT_DELTA_E = 0.1


class Accuracy(Validated):
    """The error budget: a config's [accuracy].

    delta_e: allowed mean CIELAB error; without it, polar tables have to keep 0.1, and the paper's have no limit.
    exposure_ru: the exposure of that error, RU.
    """

    delta_e: Annotated[float, Field(ge=1e-3, le=100)] | None = None
    exposure_ru: Exposure = 7500.0


class Render(Validated):
    """The BRDF maps: a config's [render].

    size: pixels per side. lights: one map each. exposure_ru: exposure of the pictures, RU.
    """

    size: Annotated[int, Field(ge=16, le=4096)] = 512
    lights: Lights = Field(default_factory=lambda: [Direction(theta_deg=0.0)])
    exposure_ru: Exposure = 1500.0


class Publish(Validated):
    """The bundle: a config's [publish].

    version: of the content, in its name. precision: of the textures. licence: of the scan, as a text.
    textures: how many RGBA textures hold a polar table; "auto": all in float, as few as the error budget allows in
        half; "full": all.
    """

    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")] = "1.0.0"
    precision: Literal["float", "half"] = "float"
    textures: Literal["auto", "full"] | Annotated[int, Field(ge=1)] = "auto"
    licence: str | None = None


class Config(Validated):
    """A whole config: one material. Its field `light` is the section [spectrum] of the TOML."""

    model_config = ConfigDict(serialize_by_alias=True)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    surface: SurfaceSource
    coherence: Coherence = Coherence()
    light: Light = Field(default=Light(), alias="spectrum")
    material: Material = Material()
    table: TableSettings = layouts.default()
    accuracy: Accuracy = Accuracy()
    scene: Scene | None = None
    render: Render = Render()
    publish: Publish = Publish()

    @property
    def budget_delta_e(self) -> float:
        """The mean CIELAB error for which a polar table is planned."""
        return DEFAULT_DELTA_E if self.accuracy.delta_e is None else self.accuracy.delta_e

    @property
    def radiometry(self) -> Radiometry:
        """Light, material and width of the coherence window, which turn |P|^2 into radiance."""
        return Radiometry(self.light, self.material, self.coherence.sigma_um, self.table.mean_step_nm)

    @model_validator(mode="after")
    def maps_show_the_scene(self) -> Self:
        """Takes the lights of a flat sample's scene, or their middles, for maps without lights of their own."""
        if self.scene is None or self.scene.cameras is not None or "lights" in self.render.model_fields_set:
            return self
        # a light below the horizon is a fault that is found later
        above = dict.fromkeys(light.shown for light in self.scene.lights if light.shown[0] < 90.0)
        shown = [Direction(theta_deg=theta, phi_deg=phi) for theta, phi in above] or self.render.lights
        # the model is frozen, but nobody holds it yet
        object.__setattr__(self, "render", self.render.model_copy(update={"lights": shown}))
        return self
