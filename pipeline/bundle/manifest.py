"""The schema of manifest.json. Grid, images and storage loss of a table have entries for each layout.

A manifest holds nothing that differs between two publications of the same content: no time, host, folder or run time.
Ranges are those that a bake can give, and keep the evaluator's numbers finite: a bundle may come from anywhere.
"""

import json
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline import layouts
from pipeline.accuracy.certificate import Certificate
from pipeline.bundle.layout import Count, Error, GridEntry, Image, Share, StorageLoss, TableImage
from pipeline.bundle.material import MaterialEntry
from pipeline.layouts import OneOf
from pipeline.validated import Finite, Positive, Validated

SCHEMA_VERSION: Literal[4] = 4
_MOST_TABLES, _MOST_MAPS = 1024, 4096

AnyImage = Annotated[TableImage, OneOf(lambda name: layouts.bundled(name).image)]
AnyGrid = Annotated[GridEntry, OneOf(lambda name: layouts.bundled(name).grid)]
AnyLoss = Annotated[StorageLoss, OneOf(lambda name: layouts.bundled(name).loss)]


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

    schema_version: Literal[4]
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")]
    licence: str
    made_by: MadeBy
    conventions: dict[str, str]
    units: dict[str, str]
    evaluation: str
    grid: AnyGrid
    colour: Colour
    material: MaterialEntry
    precision: Literal["float", "half"]
    tables: Annotated[list[AnyImage], Field(min_length=1, max_length=_MOST_TABLES)]
    maps: Annotated[list[MapImage], Field(max_length=_MOST_MAPS)]
    report: Literal["report.html"] | None
    coverage: Coverage
    domain: Domain
    plan: dict[str, Any]
    certificate: Certificate
    measured_error: dict[str, Any]
    storage_loss: AnyLoss | None
    surface: dict[str, Any]
    provenance: Provenance

    def text(self) -> str:
        """Returns the text of the file."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=True, allow_nan=False) + "\n"
