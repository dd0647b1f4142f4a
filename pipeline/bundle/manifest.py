"""The schema of manifest.json. Grid, images and storage loss of a table have entries for each layout.

A manifest holds nothing that differs between two publications of the same content: no time, host, folder or run time.
Ranges are those that a bake can give, and keep the evaluator's numbers finite: a bundle may come from anywhere.
"""

import json
import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from pipeline.accuracy.certificate import Certificate
from pipeline.accuracy.checks import RelativeError
from pipeline.bundle.material import MaterialEntry
from pipeline.optics.colour import ColourError
from pipeline.validated import Finite, Positive, Validated

SCHEMA_VERSION: Literal[3] = 3
Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1, le=2**31)]
# a power of two that fits values into half floats, at most a float32's largest number
Scale = Annotated[float, Field(ge=1e-60, le=1e60)]
Length = Annotated[float, Field(ge=1e-9, le=1e9)]
Error = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Coefficient = Annotated[float, Field(ge=-1e30, le=1e30)]
_MOST_TABLES, _MOST_MAPS, _MOST_TERMS = 1024, 4096, 1024
_MOST_SIDE = 32768
_MOST_LOG_ENVELOPE = 230.0

# --- images --------------------------------------------------------------------------------------------


class Image(Validated):
    """An EXR of the bundle; row 0 is its first line."""

    file: Annotated[str, Field(pattern=r"^(tables|maps)/[A-Za-z0-9_.+-]+\.exr$")]
    width: Annotated[int, Field(ge=1, le=_MOST_SIDE)]
    height: Annotated[int, Field(ge=1, le=_MOST_SIDE)]
    channels: Annotated[list[str], Field(min_length=1, max_length=4)]
    pixel_type: Literal["float", "half"]


class TaylorImage(Image):
    """The image of I_p for p = `index`: R, G, B hold X, Y, Z of I_p / scale; A is 1 where computed, else 0."""

    layout: Literal["taylor"]
    index: Annotated[int, Field(ge=0)]
    scale: Scale
    half_subnormal_share: Share | None


class PolarImage(Image):
    """The image of outputs 4 index ... 4 index + 3 in R, G, B, A, each divided by its scale."""

    layout: Literal["polar"]
    index: Annotated[int, Field(ge=0)]
    scale: Annotated[list[Scale], Field(min_length=4, max_length=4)]
    half_subnormal_share: Share | None


TableImage = Annotated[TaylorImage | PolarImage, Field(discriminator="layout")]


class MapImage(Image):
    """The BRDF map of one light: XYZ, and an sRGB picture at an exposure, RU.

    negative_share: of the views, those with a negative channel, which was set to 0.
    clipped_share: of the views, those whose colour at the exposure is outside the gamut of sRGB or above its white.
    """

    theta_deg: Annotated[float, Field(ge=0, lt=90)]
    phi_deg: Finite
    png: Annotated[str, Field(pattern=r"^maps/[A-Za-z0-9_.+-]+\.png$")]
    exposure_ru: Positive
    negative_share: Share
    clipped_share: Share


# --- grids ---------------------------------------------------------------------------------------------


class TaylorGridEntry(Validated):
    """Positions of the texels of a Taylor table in (u, v)."""

    layout: Literal["taylor"]
    width: Annotated[int, Field(ge=3, le=4001)]
    height: Annotated[int, Field(ge=3, le=4001)]
    power: Annotated[float, Field(ge=1, le=9)]
    u_max: Annotated[float, Field(ge=2, le=2)]
    columns: str = "u grows with the column, from -u_max at column 0"
    rows: str = "v grows with the row, from -u_max at row 0 (the first line of the image)"
    node: str = "u = u_max |t|^a sign(t), a = power; v likewise"
    texel: str = "texel i of n lies at t = 2 i / (n - 1) - 1"
    texture: str = "texel i of n has its centre at texture coordinate (i + 1/2) / n"
    interpolation: str = (
        "bilinear between texels, in the index i = (t + 1) (n - 1) / 2, t = sign(u) (|u| / u_max)^(1/a)"
    )


class PolarGridEntry(Validated):
    """Positions of the texels of a polar table in (u, v), and the formula of the look-up.

    basis: (outputs, 3, w_terms); None where every output is one term.
    """

    layout: Literal["polar"]
    width: Annotated[int, Field(ge=4, le=_MOST_SIDE, multiple_of=2)]
    height: Annotated[int, Field(ge=2, le=4096)]
    r0: Length
    step: Length
    rho_max: Annotated[float, Field(ge=1e-9, le=2)]
    stretch: Length
    axis_rad: Annotated[float, Field(ge=-7, le=7)]
    w_terms: Annotated[int, Field(ge=1, le=_MOST_TERMS)]
    envelope_radius: Length
    envelope_exponent: Finite
    basis: list[list[list[Coefficient]]] | None
    rows: str = (
        "row i (row 0 is the first line of the image) is the ring rho = r0 sinh(i step), rho = sqrt(u^2 + v^2), "
        "step = asinh(rho_max / r0) / (height - 1); so i = asinh(rho / r0) / step"
    )
    columns: str = (
        "column j is the azimuth with atan2(v', stretch u') = 2 pi j / width, (u', v') = (u, v) turned by -axis_rad: "
        "u' = cos(axis_rad) u + sin(axis_rad) v, v' = cos(axis_rad) v - sin(axis_rad) u"
    )
    texture: str = "texel (i, j) has its centre at texture coordinate ((j + 1/2) / width, (i + 1/2) / height)"
    interpolation: str = (
        "cubic B-spline along both indices; texels are its coefficients, not values. At t = i - floor(i) the texels "
        "floor(i) - 1, + 0, + 1, + 2 have the weights (1 - t)^3 / 6, (4 - 3 t^2 (2 - t)) / 6, "
        "(4 - 3 (1 - t)^2 (1 + t)) / 6, t^3 / 6"
    )
    border: str = (
        "columns are periodic; row -i is row i after half a turn, (-i, j) = (i, j + width / 2), since the first ring "
        "is one point; beyond the last row they are mirrored, (height - 1 + i, j) = (height - 1 - i, j)"
    )
    outputs: str = "output o, interpolated, is channel o mod 4 (R, G, B, A) of table image o div 4, times its scale"
    terms: str = (
        "c[channel][k] = g(rho) sum_o output_o basis[o][channel][k], channels X, Y, Z; without a basis output o is "
        "channel o div w_terms, k = o mod w_terms. g(rho) = (1 + (rho / envelope_radius)^2)^-envelope_exponent"
    )
    w_basis: str = (
        "value[channel] = sum_k c[channel][k] T_k(x), Chebyshev's polynomials of x = 2 |w| / w_max - 1, "
        "w_max = sqrt(max(4 - rho^2, 1e-6)), x clamped to [-1, 1]"
    )

    @model_validator(mode="after")
    def is_a_grid(self) -> Self:
        """Checks that the step leads to the last ring, and that the envelope fits a double.

        Raises ValueError, which pydantic reports.
        """
        expected = math.asinh(self.rho_max / self.r0) / (self.height - 1)
        if not math.isclose(self.step, expected, rel_tol=1e-9):
            raise ValueError(f"step is {self.step:g}, but r0, rho_max and height give {expected:g}")
        if abs(self.envelope_exponent) * math.log1p((2.0 / self.envelope_radius) ** 2) > _MOST_LOG_ENVELOPE:
            raise ValueError("envelope_radius and envelope_exponent give an envelope beyond 1e100 or below 1e-100")
        return self


Grid = Annotated[TaylorGridEntry | PolarGridEntry, Field(discriminator="layout")]

# --- errors --------------------------------------------------------------------------------------------


class TaylorLoss(Validated):
    """The error that half floats add to a Taylor table, against the table in float32.

    directions: number of random directions. relative_error_of_y: on the "random" directions and on the "mirror"
    directions of their lights (where a scene has them), of Y over that of a mirror, relative to at least `floor`.
    largest_delta_e: CIELAB error on both. subnormal_share: of the computed values, those with fewer than 11 bits.
    """

    layout: Literal["taylor"]
    directions: Count
    relative_error_of_y: dict[str, RelativeError]
    floor: Positive
    exposure_ru: Positive
    largest_delta_e: Error
    subnormal_share: Share


class PolarLoss(Validated):
    """The error of a polar table in few textures or half floats, on random directions.

    textures: number of RGBA textures; `most_textures` would hold the whole table. error: of the stored textures
    against the exact sum. added: against the table as baked. added_in_mirror: the same in the mirror directions of
    the lights, at 1 RU. y_in_mirror: relative errors of Y there. mirror_kept: whether `added_in_mirror` is on average
    below the just noticeable difference, 2.3. subnormal_share: of all values, those that half floats store with fewer
    than 11 bits; None for float.
    """

    layout: Literal["polar"]
    directions: Count
    textures: Count
    most_textures: Count
    error: ColourError
    added: ColourError
    added_in_mirror: ColourError
    y_in_mirror: RelativeError
    mirror_kept: bool
    subnormal_share: Share | None


StorageLoss = Annotated[TaylorLoss | PolarLoss, Field(discriminator="layout")]

# --- the whole -----------------------------------------------------------------------------------------


class Colour(Validated):
    """The colour space of all numbers.

    wavelengths: number in the spectral integral, the largest of all rings. step_nm: None where each ring has its own.
    mirror_y: Y of 1 RU, of a flat sample of the material along its normal, in its own reflection.
    """

    space: str = "CIE XYZ, linear (not sRGB)"
    observer: str
    illuminant: dict[str, Any]
    range_nm: Annotated[list[Positive], Field(min_length=2, max_length=2)]
    step_nm: Positive | None
    wavelengths: Count
    normalisation: Literal["relative", "absolute"]
    white: str
    mirror_y: Positive
    exposure: str = "a picture at an exposure of E RU shows XYZ E / mirror_y in sRGB, clipped to its gamut"


class Coverage(Validated):
    """Directions without data.

    unknown_share: share of the light in the (u, v) disc beyond the scan's Nyquist limits, which counts as dark.
    skipped_share: share of the disc that is not computed, because no light and view of the scene reach it.
    known_radius: sqrt(u^2 + v^2) up to which the table was computed and every wavelength lies within the Nyquist
    limits.
    band_limit_per_um: the Nyquist limits along x and y, 1/um.
    """

    unknown_share: Share
    skipped_share: Share
    known_radius: Annotated[float, Field(ge=0, le=2)]
    band_limit_per_um: Annotated[list[Positive], Field(min_length=2, max_length=2)]


class Domain(Validated):
    """The largest errors of the scalar model for this surface, against rigorous coupled waves.

    They are errors of an order's efficiency, as shares of what the flat surface reflects, of a sinusoid
    (error_of_smooth) and of a blaze (error_of_edged) with the surface's finest significant period and rms height, at
    lambda_nm. None for periods too fine or depths too large for the comparison; all None without a period.
    """

    model: str = "scalar: one reflection, no polarisation, no shadows but the V-cavity's"
    meaning: str = (
        "errors are of an order's efficiency, shares of what the flat surface reflects, for smooth slopes and for "
        "edges; within: both are at most `tolerated`; null: beyond what was compared, or a surface without a period"
    )
    lambda_nm: Positive
    period_over_lambda: Positive | None
    error_of_smooth: Error | None
    error_of_edged: Error | None
    tolerated: Error
    within: bool | None


class MadeBy(Validated):
    """The versions and the device that made the table, and the versions of all stages."""

    diffract_bake: str
    stages: dict[str, int]
    libraries: dict[str, str]
    device: str
    driver: str


class Provenance(Validated):
    """The whole config, files by name and SHA-256, and the artifacts' addresses in the store."""

    config: dict[str, Any]
    artifacts: dict[str, str]


class Manifest(Validated):
    """The content of manifest.json."""

    schema_version: Literal[3]
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")]
    licence: str
    made_by: MadeBy
    conventions: dict[str, str]
    units: dict[str, str]
    evaluation: str
    grid: Grid
    colour: Colour
    material: MaterialEntry
    precision: Literal["float", "half"]
    tables: Annotated[list[TableImage], Field(min_length=1, max_length=_MOST_TABLES)]
    maps: Annotated[list[MapImage], Field(max_length=_MOST_MAPS)]
    report: Literal["report.html"] | None
    coverage: Coverage
    domain: Domain
    plan: dict[str, Any]
    certificate: Certificate
    measured_error: dict[str, Any]
    storage_loss: StorageLoss | None
    surface: dict[str, Any]
    provenance: Provenance

    def text(self) -> str:
        """Returns the text of the file."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=True, allow_nan=False) + "\n"
