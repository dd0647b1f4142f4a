"""The parameters of synthetic surfaces, as a config gives them: one class per recipe."""

from typing import Annotated, Literal

from pydantic import Field

from pipeline.validated import Length, LengthPair, Validated

Seed = Annotated[int, Field(ge=0)]
# um, within the range that scans may have; a recipe whose range is a multiple of its key has narrower limits
LEAST_RANGE_UM, LARGEST_RANGE_UM = 1e-6, 100.0
Height = Annotated[float, Field(ge=LEAST_RANGE_UM, le=LARGEST_RANGE_UM)]


class RecipeBase(Validated):
    """The parameters of all synthetic surfaces. `size_um` is rounded to a whole number of periods."""

    size_um: Length | LengthPair = 65.0
    # its Nyquist limit is above 2 / 380 nm, the highest frequency that visible light can reach
    pitch_um: Length | LengthPair = 0.09


class Mirror(RecipeBase):
    """A plane at height 0."""

    kind: Literal["mirror"]


class TiltedMirror(RecipeBase):
    """A plane that rises along x and y by the given angles."""

    kind: Literal["tilted_mirror"]
    tilt_x_deg: Annotated[float, Field(gt=-80, lt=80)] = 2.0
    tilt_y_deg: Annotated[float, Field(gt=-80, lt=80)] = 0.0


class Sinusoid(RecipeBase):
    """h = amplitude cos(2 pi x / period)."""

    kind: Literal["sinusoid"]
    period_um: Length = 2.5
    amplitude_um: Annotated[float, Field(ge=LEAST_RANGE_UM, le=LARGEST_RANGE_UM / 2)] = 0.1
    axis: Literal["x", "y"] = "x"


class Rectangular(RecipeBase):
    """Height `height_um` over the share `duty` of each period, 0 elsewhere."""

    kind: Literal["rectangular"]
    period_um: Length = 2.5
    height_um: Height = 0.15
    duty: Annotated[float, Field(gt=0, lt=1)] = 0.5
    axis: Literal["x", "y"] = "x"


class Blazed(RecipeBase):
    """A sawtooth that rises along the axis from 0 to `height_um` in each period."""

    kind: Literal["blazed"]
    period_um: Length = 2.5
    height_um: Height = 0.25
    axis: Literal["x", "y"] = "x"


class CompactDisc(RecipeBase):
    """Tracks along x, `track_um` apart, with pits and lands of random lengths, 3 to 11 channel bits."""

    kind: Literal["cd"]
    track_um: Length = 1.6
    bit_um: Length = 0.2777
    pit_width_um: Length = 0.5
    depth_um: Height = 0.12
    seed: Seed = 1


class GaussianRandom(RecipeBase):
    """A Gaussian random surface of rms `sigma_h_um` and autocorrelation exp(-x^2/lx^2 - y^2/ly^2)."""

    kind: Literal["gaussian"]
    sigma_h_um: Annotated[float, Field(ge=LEAST_RANGE_UM, le=LARGEST_RANGE_UM / 10)] = 0.05
    correlation_um: Length | LengthPair = 1.0
    seed: Seed = 1


class Elaphe(RecipeBase):
    """Overlapping fingers along y, `across_um` apart, without a fixed period along their length."""

    kind: Literal["elaphe"]
    across_um: Length = 1.144
    height_um: Height = 0.37
    seed: Seed = 1


class Xenopeltis(RecipeBase):
    """Rows of fingers, `across_um` apart along x and `along_um` apart along y; the rows meander."""

    kind: Literal["xenopeltis"]
    across_um: Length = 0.55
    along_um: Length = 1.55
    height_um: Height = 0.3
    seed: Seed = 1


Recipe = Annotated[
    Mirror | TiltedMirror | Sinusoid | Rectangular | Blazed | CompactDisc | GaussianRandom | Elaphe | Xenopeltis,
    Field(discriminator="kind"),
]
