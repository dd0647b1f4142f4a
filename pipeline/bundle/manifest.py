"""manifest.json: its schema, and how it is filled from a config and its artifacts.

It holds nothing that differs between two publications of one content: no time, host, folder or run time.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.bundle.material import MaterialEntry
from pipeline.config import Config, Section
from pipeline.digest import of_file
from pipeline.optics.spectra import shortest_wavelength_nm
from pipeline.store import Artifact
from pipeline.tables import grid

MANIFEST = "manifest.json"
SCHEMA_VERSION: Literal[1] = 1
STAGES = ("surface", "stack", "table", "render", "validate")
_NOT_RECORDED = "not recorded"
_LIBRARIES = ("numpy", "pyopencl", "zarr", "OpenEXR")

CONVENTIONS = {
    "directions": "unit vectors pointing away from the surface; z is its normal, x grows with the column",
    "y": "up: y grows with the height field's row index",
    "azimuth": "from +x towards +y",
    "uvw": "(u, v, w) = -wi - wr, wi towards the light, wr towards the viewer; so -2 <= w < 0",
    "P": "P(f) = sum g exp(i k w h) exp(+2 pi i f.x) / sum g at f = (u, v) / lambda, k = 2 pi / lambda; by "
    "this sign a plane rising towards +x reflects towards -x",
    "window": "g = exp(-r^2 / (2 sigma^2)), centred on the middle of the patch",
    "boundary": "the patch repeats periodically under the window",
    "I_p": "sum_p w^p I_p(u, v) = sum_lambda |P|^2 S(lambda) xyzbar(lambda) / sum_lambda S ybar, with the "
    "factors of the material that vary with wavelength inside the sum",
    "RU": "reflectance unit: at 1 RU a flat mirror (|P(0)|^2 = 1) in its own reflection saturates a screen",
}

EVALUATION = (
    "XYZ = C cos(theta_i) sum_p w^p I_p(u, v); I_p = scale_p * (R, G, B) where A = 1; "
    "by Horner's rule from the highest p down"
)


class Image(Section):
    """An EXR of the bundle; row 0 is its first line."""

    file: Annotated[str, Field(pattern=r"^(tables|maps)/[A-Za-z0-9_.+-]+\.exr$")]
    width: int
    height: int
    channels: list[str]
    pixel_type: Literal["float", "half"]


class TableImage(Image):
    """I_p of one p: R, G, B hold X, Y, Z of I_p / scale, A is 1 where computed, else 0."""

    p: Annotated[int, Field(ge=0)]
    scale: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    half_subnormal_share: float | None


class MapImage(Image):
    """The BRDF map of one light: XYZ under 1 RU, and as a picture at an exposure."""

    theta_deg: float
    phi_deg: float
    png: str
    exposure_ru: float


class Grid(Section):
    """Where the texels of a table stand in (u, v)."""

    layout: Literal["taylor"]
    width: int
    height: int
    power: float
    u_max: float
    columns: str = "u grows with the column, from -u_max at column 0"
    rows: str = "v grows with the row, from -u_max at row 0 (the first line of the image)"
    node: str = "u = u_max |t|^a sign(t), a = power; v likewise"
    texel: str = "texel i of n stands at t = 2 i / (n - 1) - 1"
    texture: str = "texel i of n has its centre at texture coordinate (i + 1/2) / n"
    interpolation: str = (
        "bilinear between texels, in the index i = (t + 1) (n - 1) / 2, t = sign(u) (|u| / u_max)^(1/a)"
    )


class Colour(Section):
    """The space of all numbers."""

    space: str = "CIE XYZ, linear (not sRGB)"
    observer: str
    illuminant: dict[str, Any]
    range_nm: list[float]
    step_nm: float
    white: str = "a perfect mirror in its own reflection has Y = 1 at 1 RU ('relative'); X and Z are the illuminant's"


class Coverage(Section):
    """What the table does not know.

    unknown_share: of the (u, v) disc's light, beyond the scan's band: taken as dark. skipped_share: of the
    disc's texels, not computed because no light and view of the scene reach them (A = 0).
    known_radius: sqrt(u^2 + v^2) up to which every wavelength lies within the scan's band, at most 2.
    """

    unknown_share: float
    skipped_share: float
    known_radius: float
    band_limit_per_um: list[float]


class RelativeErrors(Section):
    """Of |value - reference| / max(reference, floor)."""

    median: float
    percentile_99: float
    maximum: float


class HalfPrecision(Section):
    """What storing the table in half floats adds, against the float table.

    relative_error_of_y: over so many "random" directions and the "mirror" directions of their lights (where a
    scene has them), with Y as a share of a mirror's and a floor. largest_delta_e: over both. subnormal_share:
    of all computed values, those that half keeps with fewer than 11 bits.
    """

    directions: int
    relative_error_of_y: dict[str, RelativeErrors]
    floor: float
    exposure_ru: float
    largest_delta_e: float
    subnormal_share: float


class MadeBy(Section):
    diffract_bake: str
    stages: dict[str, int]
    libraries: dict[str, str]
    device: str
    driver: str


class Provenance(Section):
    """The whole config, files by name and content, and the artifacts' addresses in the store."""

    config: dict[str, Any]
    artifacts: dict[str, str]


class Manifest(Section):
    """manifest.json, whole."""

    schema_version: Literal[1]
    name: str
    version: str
    licence: str
    made_by: MadeBy
    conventions: dict[str, str]
    units: dict[str, str]
    evaluation: str
    grid: Grid
    colour: Colour
    material: MaterialEntry
    precision: Literal["float", "half"]
    tables: Annotated[list[TableImage], Field(min_length=1)]
    maps: list[MapImage]
    report: str | None
    coverage: Coverage
    predicted_error: dict[str, Any]
    measured_error: dict[str, Any]
    half_precision: HalfPrecision | None
    surface: dict[str, Any]
    provenance: Provenance

    def text(self) -> str:
        """As it stands in the bundle."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=True, allow_nan=False) + "\n"


def grid_entry(config: Config) -> Grid:
    """The grid of a config's table."""
    n = config.table.resolution
    return Grid(layout=config.table.layout, width=n, height=n, power=config.table.power, u_max=grid.U_MAX)


def units(config: Config) -> dict[str, str]:
    """The unit of every kind of number in the bundle."""
    absolute = config.material.normalisation == "absolute"
    return {
        "I_p": "1/sr" if absolute else "1",
        "XYZ": "1/sr, for it is a BRDF times cos(theta_i)" if absolute else "RU",
        "u, v, w": "1",
        "lengths": "um",
        "wavelengths": "nm",
        "angles": "degrees in files, radians in formulas",
    }


def colour_entry(config: Config) -> Colour:
    """Light and observer."""
    return Colour(
        observer=config.spectrum.observer,
        illuminant=_illuminant(config),
        range_nm=list(config.spectrum.range_nm),
        step_nm=config.table.step_nm,
    )


def coverage(config: Config, inputs: Mapping[str, Artifact]) -> Coverage:
    """What the scan's band and the scene leave out."""
    table, band = inputs["table"].summary, inputs["surface"].summary["statistics"]["band_limit_per_um"]
    known = 1e-3 * shortest_wavelength_nm(config.spectrum) * min(band)
    return Coverage(
        unknown_share=table["unknown_share"],
        skipped_share=table["skipped_share"],
        known_radius=min(grid.U_MAX, known),
        band_limit_per_um=list(band),
    )


def made_by(inputs: Mapping[str, Artifact]) -> MadeBy:
    """The tool, libraries and device that made the table, as recorded with it: never this machine's own."""
    recorded = inputs["table"].record.get("provenance", {})
    return MadeBy(
        diffract_bake=str(recorded.get("diffract-bake", _NOT_RECORDED)),
        stages={name: int(inputs[name].record.get("version", 0)) for name in STAGES},
        libraries={name: str(recorded.get(name, _NOT_RECORDED)) for name in _LIBRARIES},
        device=str(recorded.get("device", _NOT_RECORDED)),
        driver=str(recorded.get("driver", _NOT_RECORDED)),
    )


def provenance(config: Config, inputs: Mapping[str, Artifact]) -> Provenance:
    """Where the bundle comes from."""
    return Provenance(config=resolved_config(config), artifacts={name: inputs[name].key for name in STAGES})


def resolved_config(config: Config) -> dict[str, Any]:
    """The whole config, files by name and content, without folders of this machine."""
    resolved = config.model_dump(mode="json")
    resolved["surface"]["path"] = None if config.surface.path is None else _named_file(config.surface.path)
    resolved["spectrum"]["illuminant"] = _illuminant(config)
    resolved["material"]["metal"] = _file_or_name(config.material.metal)
    return resolved


def _illuminant(config: Config) -> dict[str, Any]:
    illuminant = config.spectrum.illuminant
    return _file_or_name(illuminant) if isinstance(illuminant, str) else illuminant.model_dump()


def _file_or_name(name: str) -> dict[str, Any]:
    return _named_file(name) if name.lower().endswith(".csv") else {"name": name}


def _named_file(path: str) -> dict[str, Any]:
    return {"file": Path(path).name, "sha256": of_file(Path(path))}
