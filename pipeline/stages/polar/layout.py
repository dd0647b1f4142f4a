"""The polar layout: rings and azimuths of splines, Chebyshev polynomials in |w|."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pipeline.accuracy.convergence import CoarseMap, Study
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.optics.light import Light
from pipeline.stages.foreseen import WayOut
from pipeline.stages.layout import Layout
from pipeline.stages.polar import power_spectrum, sizes, table, textures
from pipeline.stages.polar.study import PolarStudy
from pipeline.stages.stage import Inputs, Summary
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import Evaluator
from pipeline.tables.polar import spectral
from pipeline.tables.polar.planning import plan

if TYPE_CHECKING:
    from pipeline.bundle.layout import Prepared

_PLANNED = ("terms", "s_nodes", "w_terms", "probed_delta_e", "windows", "speckle_contrast")


def _studied(config: Config) -> Config:
    """Returns the config whose light and material the curves have: those of the planner, whatever a config's are."""
    light = config.light if config.light.is_line else Light(illuminant="E", range_nm=config.light.range_nm)
    return config.model_copy(update={"light": light, "material": plan.MATERIAL})


def _study(config: Config, inputs: Inputs, _evaluate: Evaluator, coarse: CoarseMap) -> Study:
    """Returns the curves of error against rings, azimuths, terms in |w| and wavelength step."""
    layout, planned = power_spectrum.layout_of(config), power_spectrum.planned(inputs["power_spectrum"])
    return PolarStudy(power_spectrum.of(inputs), planned, layout, coarse).curves()


def _settings(power_spectrum: Summary, table: Summary) -> list[list[str]]:
    rings, azimuths, certificate = table["rings"], table["azimuths"], table["certificate"]
    return [
        ["Chebyshev terms, nodes in s", f"{power_spectrum['terms']}, {power_spectrum['s_nodes']}"],
        ["windows, speckle contrast", f"{power_spectrum['windows']}, {power_spectrum['speckle_contrast']:.2f}"],
        ["rings × azimuths, texels kept", f"{rings['count']} × {azimuths['count']}, {table['texels']}"],
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


def _stored(config: Config, loss: dict[str, Any]) -> list[list[str]]:
    rows = [
        ["stored in", f"{config.publish.precision}, {loss['textures']} of {loss['most_textures']} textures"],
        ["mean ΔE that this adds", f"{loss['added']['mean']:.3g} at {loss['added']['exposure_ru']:g} RU"],
    ]
    mirror = loss["mirror"]
    if mirror is not None:
        verdict = "kept" if mirror["kept"] else "visibly changed"
        rows += [
            ["mean ΔE in mirror directions at 1 RU", f"{mirror['added']['mean']:.3g}: the highlight is {verdict}"],
            ["largest error of Y there", f"{100.0 * mirror['y']['maximum']:.2g} %"],
        ]
    return rows


def _at_wavelengths(artifact: Artifact) -> Callable[[Array, Array], Array]:
    table = spectral.build(power_spectrum.load(artifact))
    return lambda uvw, lambda_nm: spectral.look_up(table, uvw, lambda_nm)


def _prepare(config: Config, inputs: Inputs) -> "Prepared":
    from pipeline.bundle.polar import prepare

    return prepare.prepare(
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
    study=_study,
    studied=_studied,
    study_remark=(
        "Curves are those of the planner: equal-energy light or the laser line, observer of 1931, index 1.5. "
        "Azimuths are thinned evenly. All rings share one step; the mean of the chosen steps is marked."
    ),
    sizes=sizes.sizes,
    ways_out=(
        WayOut("table.azimuths", 32, multiple=32),
        WayOut("table.rings", 8, multiple=1),
        WayOut("table.w_terms", 4, multiple=4),
        WayOut("table.terms", 2, multiple=1),
    ),
    settings=_settings,
    stored=_stored,
    prepare=_prepare,
    tiles_of=table.tiles_of,
    at_wavelengths=_at_wavelengths,
)
