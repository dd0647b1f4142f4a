"""Where heights come from, and how they are cleaned: a scan file or a recipe."""

from typing import Literal, Self

from pydantic import ValidationInfo, field_validator, model_validator

from pipeline.surface.recipes.parameters import Recipe
from pipeline.validated import Pair, Positive, PositivePair, Validated, existing_file

Unit = Literal["pm", "nm", "um", "mm", "m"]


class SurfaceSource(Validated):
    """Either a scan file or a recipe, and how a scan is cleaned."""

    path: str | None = None
    channel: str | None = None
    pitch_um: Positive | PositivePair | None = None
    height_unit: Unit | None = None
    height_range_um: Positive | None = None
    override_file_units: bool = False
    level: Literal["none", "plane", "quadratic", "rows"] | None = None
    clip_percentile: Pair | None = None
    recipe: Recipe | None = None

    @model_validator(mode="after")
    def one_source(self) -> Self:
        if (self.path is None) == (self.recipe is None):
            found = "neither" if self.path is None else "both"
            raise ValueError(f"expected either 'path' (a scan) or 'recipe' (a synthetic surface), got {found}")
        if self.recipe is not None:
            reading = ("channel", "pitch_um", "height_unit", "height_range_um", "clip_percentile")
            set_keys = [key for key in reading if getattr(self, key) is not None]
            if set_keys:
                raise ValueError(f"{', '.join(set_keys)}: only for a scan file; a recipe carries its own")
        return self

    @field_validator("clip_percentile")
    @classmethod
    def ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and not 0 <= value[0] < value[1] <= 100:
            raise ValueError(f"expected [low, high] with 0 <= low < high <= 100, got {list(value)}")
        return value

    @field_validator("path")
    @classmethod
    def scanexisting_file(cls, value: str | None, info: ValidationInfo) -> str | None:
        return None if value is None else existing_file(value, info)

    @property
    def levelling(self) -> str:
        """A scan is levelled by a plane unless told otherwise; a recipe is exact as it is."""
        return self.level or ("none" if self.recipe is not None else "plane")
