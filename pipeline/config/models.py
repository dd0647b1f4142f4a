"""The TOML that describes one material: its models, its defaults and its faults.

Keys and units are those of docs/usage.md; an unknown key is a fault. `load` collects every
fault of a file before it raises, each with its key path; what ties sections together is looked at once
each of them is sound.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

# lax only where TOML has no tuple: arrays become tuples, everything else keeps its type
Pair = Annotated[tuple[float, float], Field(strict=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
PositivePair = Annotated[tuple[Positive, Positive], Field(strict=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0)]
Unit = Literal["pm", "nm", "um", "mm", "m"]

# names colour-science certainly has; any other is looked up there, which costs its import
_COMMON_ILLUMINANTS = frozenset({"A", "C", "D50", "D55", "D65", "D75", "E"})
_COMMON_OBSERVERS = frozenset({"CIE 1931 2 Degree Standard Observer", "CIE 1964 10 Degree Standard Observer"})


class Section(BaseModel):
    """Base of all sections: unknown keys, wrong types and later changes are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def as_pair(value: float | tuple[float, float]) -> tuple[float, float]:
    """One number stands for both axes; two are (x, y)."""
    return value if isinstance(value, tuple) else (value, value)


def _is_csv(text: str) -> bool:
    return text.lower().endswith(".csv")


def _file(name: str, info: ValidationInfo) -> str:
    """The absolute name of a file that is there; names are relative to the config's folder.

    Outside `parse` no folder is known, and a name stays as it is.
    """
    if info.context is None:
        return name
    try:
        path = (info.context["folder"] / name).resolve()
        found = path.is_file()
    # a loop of links is a RuntimeError before Python 3.13
    except (OSError, RuntimeError) as error:
        raise ValueError(f"cannot be read: {error}") from None
    if not found:
        raise ValueError(f"no such file: {path} (paths are relative to the config)")
    return str(path)


# --- [surface] ---------------------------------------------------------------------------------------


class RecipeBase(Section):
    """What every synthetic surface has. `size_um` is rounded to a whole number of periods."""

    size_um: Positive | PositivePair = 65.0
    # 1 / (2 pitch) covers 2 / 380 nm, the highest frequency that visible light reaches
    pitch_um: Positive | PositivePair = 0.09


class Mirror(RecipeBase):
    kind: Literal["mirror"]


class TiltedMirror(RecipeBase):
    """A plane rising along x and y by the given angles."""

    kind: Literal["tilted_mirror"]
    tilt_x_deg: Annotated[float, Field(gt=-80, lt=80)] = 2.0
    tilt_y_deg: Annotated[float, Field(gt=-80, lt=80)] = 0.0


class Sinusoid(RecipeBase):
    """h = amplitude cos(2 pi x / period)."""

    kind: Literal["sinusoid"]
    period_um: Positive = 2.5
    amplitude_um: Positive = 0.1
    axis: Literal["x", "y"] = "x"


class Rectangular(RecipeBase):
    """Height `height_um` over the share `duty` of each period, else 0."""

    kind: Literal["rectangular"]
    period_um: Positive = 2.5
    height_um: Positive = 0.15
    duty: Annotated[float, Field(gt=0, lt=1)] = 0.5
    axis: Literal["x", "y"] = "x"


class Blazed(RecipeBase):
    """A sawtooth rising along the axis from 0 to `height_um` in each period."""

    kind: Literal["blazed"]
    period_um: Positive = 2.5
    height_um: Positive = 0.25
    axis: Literal["x", "y"] = "x"


class CompactDisc(RecipeBase):
    """Tracks along x, `track_um` apart; pits and lands of 3 to 11 channel bits at random."""

    kind: Literal["cd"]
    track_um: Positive = 1.6
    bit_um: Positive = 0.2777
    pit_width_um: Positive = 0.5
    depth_um: Positive = 0.12
    seed: Seed = 1


class GaussianRandom(RecipeBase):
    """A Gaussian random surface of rms `sigma_h_um` and autocorrelation exp(-x^2/lx^2 - y^2/ly^2)."""

    kind: Literal["gaussian"]
    sigma_h_um: Positive = 0.05
    correlation_um: Positive | PositivePair = 1.0
    seed: Seed = 1


class Elaphe(RecipeBase):
    """Overlapping fingers along y, `across_um` apart, without a firm period along their length."""

    kind: Literal["elaphe"]
    across_um: Positive = 1.144
    height_um: Positive = 0.37
    seed: Seed = 1


class Xenopeltis(RecipeBase):
    """Rows of fingers: `across_um` apart along x, `along_um` along y, the rows wandering."""

    kind: Literal["xenopeltis"]
    across_um: Positive = 0.55
    along_um: Positive = 1.55
    height_um: Positive = 0.3
    seed: Seed = 1


Recipe = Annotated[
    Mirror | TiltedMirror | Sinusoid | Rectangular | Blazed | CompactDisc | GaussianRandom | Elaphe | Xenopeltis,
    Field(discriminator="kind"),
]


class Surface(Section):
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
    def scan_file(cls, value: str | None, info: ValidationInfo) -> str | None:
        return None if value is None else _file(value, info)

    @property
    def levelling(self) -> str:
        """A scan is levelled by a plane unless told otherwise; a recipe is exact as it is."""
        return self.level or ("none" if self.recipe is not None else "plane")


# --- the other sections ------------------------------------------------------------------------------


class Coherence(Section):
    """The Gaussian window exp(-r^2 / (2 sigma^2)) of coherent light; 65 um = 4 sigma in [D14] 4.2.

    windows: "auto" averages |P|^2 over the windows that a larger scan holds (polar tables), "centre" takes one.
    """

    sigma_um: Annotated[float, Field(ge=1e-3, le=1e4)] = 16.25
    boundary: Literal["periodic"] = "periodic"
    windows: Literal["auto", "centre"] = "auto"


class LaserLine(Section):
    lambda_nm: Annotated[float, Field(ge=360, le=830)]


class Spectrum(Section):
    illuminant: str | LaserLine = "D65"
    observer: str = "CIE 1931 2 Degree Standard Observer"
    range_nm: Pair = (380.0, 780.0)

    @field_validator("range_nm")
    @classmethod
    def visible(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not 360 <= value[0] < value[1] <= 830:
            raise ValueError(f"expected [from, to] within the observer's 360..830 nm, got {list(value)}")
        return value

    @model_validator(mode="after")
    def a_line_has_no_range(self) -> Self:
        if isinstance(self.illuminant, LaserLine) and "range_nm" in self.model_fields_set:
            raise ValueError("range_nm has no meaning with a laser line; leave it out")
        return self

    @field_validator("illuminant")
    @classmethod
    def known_illuminant(cls, value: str | LaserLine, info: ValidationInfo) -> str | LaserLine:
        if isinstance(value, LaserLine) or value in _COMMON_ILLUMINANTS:
            return value
        if _is_csv(value):
            return _file(value, info)
        import colour

        if value not in colour.SDS_ILLUMINANTS:
            some = ", ".join(sorted(_COMMON_ILLUMINANTS))
            raise ValueError(f"unknown illuminant {value!r}; known: {some}, a .csv")
        return value

    @field_validator("observer")
    @classmethod
    def known_observer(cls, value: str) -> str:
        if value not in _COMMON_OBSERVERS:
            from colour.colorimetry import MSDS_CMFS_STANDARD_OBSERVER

            # colour's other matching functions are of cones or RGB primaries and give no XYZ
            if value not in MSDS_CMFS_STANDARD_OBSERVER:
                some = ", ".join(sorted(_COMMON_OBSERVERS))
                raise ValueError(f"unknown observer {value!r}; known: {some}")
        return value


class Material(Section):
    fresnel: Literal["none", "schlick", "dielectric", "conductor"] = "schlick"
    ior: Annotated[float, Field(gt=1, le=5)] = 1.5
    metal: str = "Au"
    shadowing: bool = True
    normalisation: Literal["relative", "absolute"] = "relative"

    @field_validator("metal")
    @classmethod
    def known_metal(cls, value: str, info: ValidationInfo) -> str:
        if _is_csv(value):
            return _file(value, info)
        if value != "Au":
            raise ValueError(f"expected 'Au' or a .csv of lambda_nm,n,k, got {value!r}")
        return value


FINE_STEP_NM = 1.0
# an error of a tenth is no digit at all
LARGEST_TOLERANCE = 0.1


class PolarLayout(Section):
    """Rings and azimuths of splines, Chebyshev polynomials in |w|; what is "auto" follows from [accuracy].

    form: "spectral" makes the power spectrum fine enough to answer single wavelengths, beside the XYZ of "xyz".
    """

    layout: Literal["polar"] = "polar"
    terms: Literal["auto"] | Annotated[int, Field(ge=2, le=1000)] = "auto"
    rings: Literal["auto"] | Annotated[int, Field(ge=8, le=4096)] = "auto"
    azimuths: Literal["auto"] | Annotated[int, Field(ge=32, le=32768, multiple_of=32)] = "auto"
    w_terms: Literal["auto"] | Annotated[int, Field(ge=4, le=128, multiple_of=4)] = "auto"
    form: Literal["xyz", "spectral"] = "xyz"


class TaylorLayout(Section):
    """The paper's table: I_p on `resolution` x `resolution` nodes 2 |t|^power sign(t)."""

    layout: Literal["taylor"]
    resolution: Annotated[int, Field(ge=3, le=4001)] = 501
    power: Annotated[float, Field(ge=1, le=9)] = 5.0
    terms: Literal["auto"] | Annotated[int, Field(ge=1, le=200)] = "auto"
    step_nm: Annotated[float, Field(ge=0.1, le=50)] = 5.0
    tolerance: Annotated[float, Field(ge=1e-7, le=LARGEST_TOLERANCE)] = 1e-4

    @field_validator("resolution")
    @classmethod
    def odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"expected an odd number, so that (u, v) = (0, 0) is a node, got {value}")
        return value


def _default_layout(table: Any) -> Any:
    """A [table] that names no layout is polar."""
    return {"layout": "polar", **table} if isinstance(table, dict) else table


Table = Annotated[
    Annotated[PolarLayout | TaylorLayout, Field(discriminator="layout")], BeforeValidator(_default_layout)
]


# what a polar table is planned for where no budget is set
DEFAULT_DELTA_E = 0.1


class Accuracy(Section):
    """The error budget: mean CIELAB error at one exposure. Polar tables are planned for it, and for 0.1 without."""

    delta_e: Annotated[float, Field(ge=1e-3, le=100)] | None = None
    exposure_ru: Positive = 7500.0


# a millionth of a degree is far below any lobe's width, and above the rounding of whole turns
_SAME_DEG = 1e-6


class Direction(Section):
    """A direction away from the surface: polar angle from the normal, azimuth from +x."""

    theta_deg: Annotated[float, Field(ge=0, lt=90)]
    phi_deg: Finite = 0.0

    def same_as(self, other: "Direction") -> bool:
        """Whether both point the same way, whole turns and the azimuth of the normal aside."""
        turned = 0.0 if self.theta_deg == 0 else (self.phi_deg - other.phi_deg + 180.0) % 360.0 - 180.0
        return abs(self.theta_deg - other.theta_deg) < _SAME_DEG and abs(turned) < _SAME_DEG


class Views(Section):
    theta_max_deg: Annotated[float, Field(gt=0, le=90)] = 90.0


Lights = Annotated[list[Direction], Field(min_length=1)]


class Scene(Section):
    """What will be looked at on a flat sample; what it cannot reach is not computed."""

    lights: Lights
    views: Views = Views()


class Render(Section):
    size: Annotated[int, Field(ge=16, le=4096)] = 512
    lights: Lights = [Direction(theta_deg=0.0)]
    exposure_ru: Positive = 1500.0


class Publish(Section):
    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")] = "1.0.0"
    precision: Literal["float", "half"] = "float"
    # RGBA textures of a polar table; "auto": all in float, as few as the error budget allows in half
    textures: Literal["auto", "full"] | Annotated[int, Field(ge=1)] = "auto"
    licence: str | None = None


class Config(Section):
    """One material, whole."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    surface: Surface
    coherence: Coherence = Coherence()
    spectrum: Spectrum = Spectrum()
    material: Material = Material()
    table: Table = PolarLayout()
    accuracy: Accuracy = Accuracy()
    scene: Scene | None = None
    render: Render = Render()
    publish: Publish = Publish()

    @property
    def budget_delta_e(self) -> float:
        """The mean CIELAB error that a polar table is planned for."""
        return DEFAULT_DELTA_E if self.accuracy.delta_e is None else self.accuracy.delta_e

    @property
    def mean_step_nm(self) -> float:
        """The wavelength step of means that stand outside the spectral integral, such as a metal's luminous mean."""
        return self.table.step_nm if isinstance(self.table, TaylorLayout) else FINE_STEP_NM

    @model_validator(mode="after")
    def maps_show_the_scene(self) -> Self:
        """Without lights of their own, maps take the scene's."""
        if self.scene is None or "lights" in self.render.model_fields_set:
            return self
        # frozen, but not yet handed out
        object.__setattr__(self, "render", self.render.model_copy(update={"lights": self.scene.lights}))
        return self
