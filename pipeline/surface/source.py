"""The source of the heights, a scan file or a recipe, and the conditioning of a scan."""

from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from pipeline.surface.recipes.parameters import Recipe
from pipeline.validated import Finite, Magnitude, MagnitudePair, Pair, Validated, existing_file

Unit = Literal["pm", "nm", "um", "mm", "m"]


class SurfaceSource(Validated):
    """Either a scan file or a recipe: a config's [surface].

    path: of the scan. channel: its name in the file; by default the height channel.
    pitch_um: sample distance, um, one number or (x, y). height_unit: unit of the stored heights.
    height_range_um: height, um, of an image's largest code above 0.
    override_file_units: whether these three keys win over units that the file states.
    level: the background that is subtracted; by default a plane from scans and nothing from recipes.
    clip_percentile: (low, high) percentiles, %, to which heights are limited.
    mask: whether samples under a mask in the file become holes ("holes"), all others do ("keep"), or it counts for
        nothing ("ignore"; by default likewise, with a warning).
    no_data: stored numbers that mean no data; by default these, and rows that were not scanned, are recognised.
    max_hole_share: the largest share of holes that are filled; a scan with more is refused.
    recipe: kind and parameters of a synthetic surface.
    """

    path: str | None = None
    channel: str | None = None
    pitch_um: Magnitude | MagnitudePair | None = None
    height_unit: Unit | None = None
    height_range_um: Magnitude | None = None
    override_file_units: bool = False
    level: Literal["none", "plane", "quadratic", "rows"] | None = None
    clip_percentile: Pair | None = None
    mask: Literal["holes", "ignore", "keep"] | None = None
    no_data: Annotated[tuple[Finite, ...], Field(strict=False)] | None = None
    # what is filled scatters nothing: at 0.3, half of the diffracted power is left, (1 - 0.3)^2
    max_hole_share: Annotated[float, Field(ge=0, lt=1)] = 0.3
    recipe: Recipe | None = None

    @model_validator(mode="after")
    def one_source(self) -> Self:
        """Requires either a path or a recipe, and with a recipe no key that only a scan has."""
        if (self.path is None) == (self.recipe is None):
            found = "neither" if self.path is None else "both"
            raise ValueError(f"expected either 'path' (a scan) or 'recipe' (a synthetic surface), got {found}")
        if self.recipe is not None:
            reading = ("channel", "pitch_um", "height_unit", "height_range_um", "clip_percentile", "mask", "no_data")
            set_keys = [key for key in reading if getattr(self, key) is not None]
            if self.max_hole_share != type(self).model_fields["max_hole_share"].default:
                set_keys.append("max_hole_share")
            if set_keys:
                raise ValueError(f"{', '.join(set_keys)}: only for a scan file, got a recipe; remove these keys")
        return self

    @field_validator("clip_percentile")
    @classmethod
    def ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        """Requires 0 <= low < high <= 100."""
        if value is not None and not 0 <= value[0] < value[1] <= 100:
            raise ValueError(f"expected [low, high] with 0 <= low < high <= 100, got {list(value)}")
        return value

    @field_validator("path")
    @classmethod
    def existing_scan(cls, value: str | None, info: ValidationInfo) -> str | None:
        """Requires an existing file."""
        return None if value is None else existing_file(value, info)

    @property
    def levelling(self) -> str:
        """The background to subtract: `level`, by default a plane from a scan and nothing from a recipe."""
        return self.level or ("none" if self.recipe is not None else "plane")
