"""The polar layout: rings and azimuths of splines, Chebyshev polynomials in |w|."""

import math
from typing import TYPE_CHECKING

from pipeline.accuracy.convergence import CoarseMap, PolarStudy, Study
from pipeline.config.models import Config
from pipeline.stages.layout import Layout
from pipeline.stages.polar import power_spectrum, sizes, table, textures
from pipeline.stages.stage import Inputs, Summary
from pipeline.tables.evaluate import Evaluator

if TYPE_CHECKING:
    from pipeline.bundle.prepared import Prepared

_PLANNED = ("terms", "s_nodes", "w_terms", "probed_delta_e", "windows", "speckle_contrast")


def _size(config: Config) -> str:
    layout = power_spectrum.layout_of(config)
    return f"{layout.rings} rings x {layout.azimuths} azimuths"


def _study(config: Config, inputs: Inputs, evaluate: Evaluator, coarse: CoarseMap) -> Study:
    """Returns the curves of error against rings, azimuths, terms in |w| and wavelength step."""
    layout, planned = power_spectrum.layout_of(config), power_spectrum.planned(inputs["power_spectrum"])
    return PolarStudy(power_spectrum.of(inputs), planned, layout, evaluate, coarse).curves()


def _settings(power_spectrum: Summary, table: Summary) -> list[list[str]]:
    rings, azimuths, certificate = table["rings"], table["azimuths"], table["certificate"]
    return [
        ["Chebyshev terms, nodes in s", f"{power_spectrum['terms']}, {power_spectrum['s_nodes']}"],
        ["windows, speckle contrast", f"{power_spectrum['windows']}, {power_spectrum['speckle_contrast']:.2f}"],
        ["rings × azimuths", f"{rings['count']} × {azimuths['count']}"],
        ["rings evenly spaced below ρ =", f"{rings['r0']:.3g}"],
        [
            "azimuths denser by, around",
            f"{1.0 / azimuths['stretch']:.2f}, {math.degrees(azimuths['axis_rad']):.0f}°",
        ],
        ["terms in |w|", str(table["w_terms"])],
        ["wavelengths per ring", f"{table['wavelengths_mean']:.0f} on average, {table['wavelengths']} at most"],
        ["beyond the Nyquist limits", f"{100 * table['unknown_share']:.2f} %"],
        ["outside the scene", f"{100 * table['skipped_share']:.1f} %"],
        [
            f"certificate: mean ΔE at {certificate['exposure_ru']:g} RU",
            f"{certificate['measured']:.3f}"
            + ("" if certificate["delta_e"] is None else f" of {certificate['delta_e']:g} allowed"),
        ],
    ]


def _prepare(config: Config, inputs: Inputs) -> "Prepared":
    from pipeline.bundle import polar

    return polar.prepare(
        config,
        textures.of(inputs),
        inputs.summary("textures"),
        {key: inputs.summary("power_spectrum").get(key) for key in _PLANNED},
    )


LAYOUT = Layout(
    transform=power_spectrum.POWER_SPECTRUM,
    table=table.TABLE,
    textures=textures.TEXTURES,
    load=table.load,
    table_of=table.of,
    stored_of=textures.table_of,
    size=_size,
    study=_study,
    study_remark="Azimuths are thinned evenly. All rings share one step; the mean of the chosen steps is marked.",
    sizes=sizes.sizes,
    settings=_settings,
    prepare=_prepare,
)
