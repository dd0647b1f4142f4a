"""The validation report: a page with the maps, the surface, the settings and the measured errors."""

from collections.abc import Mapping
from typing import Any

from pipeline import layouts
from pipeline.config.models import Config
from pipeline.report import template
from pipeline.stages.layout import Layout
from pipeline.stages.stage import Inputs

Rows = list[list[str]]


ERROR_COLUMNS = ("where", "RU", "mean", "99th %", "max", "place of max")


def error_rows(results: dict[str, Any]) -> Rows:
    """Lists the CIELAB errors of a validation, one row of texts for each set of directions and exposure.

    results: the summary of the stage "validate".
    Returns rows with the columns ERROR_COLUMNS.
    """
    sets = [
        (f"map {m['theta_deg']:g}°, {m['phi_deg']:g}°", e, _place(one))
        for m in results["maps"]
        for e, one in zip(m["colour"], m["largest"], strict=True)
    ]
    sets += [("random directions", e, "") for e in results["random"]["colour"]]
    if (flank := results["flank"]) is not None:
        name = f"within {flank['lobe_widths']:g} widths of mirrors"
        sets.append((name, flank["colour"], _place(flank["largest"])))
    if results["border"] is not None:
        sets += [("border of the scene", e, "") for e in results["border"]["colour"]]
    return [
        [name, f"{e['exposure_ru']:g}", *(f"{e[key]:.3f}" for key in ("mean", "percentile_99", "maximum")), place]
        for name, e, place in sets
    ]


def _place(largest: dict[str, Any]) -> str:
    """Says where an error is the largest: on what, and how many widths of the specular lobe from the mirror."""
    if not largest["delta_e"]:
        return ""
    on = largest["reason"].partition(" ")[0]
    return f"{on}, {largest['lobe_widths']:.1f} widths"


def _surface_rows(summary: dict[str, Any]) -> Rows:
    s = summary["statistics"]
    periods = ", ".join(f"{p['period_um']:.3f} µm at {round(p['direction_deg'])}°" for p in s["periods"])
    return [
        ["samples (x × y)", f"{s['shape'][1]} × {s['shape'][0]}"],
        ["size (µm)", f"{s['size_um'][0]:.4g} × {s['size_um'][1]:.4g}"],
        ["pitch (µm)", f"{s['pitch_um'][0]:.4g} × {s['pitch_um'][1]:.4g}"],
        ["rms height σ_h (µm)", f"{s['sigma_h_um']:.4f}"],
        ["height range (µm)", f"{s['range_um']:.4f}"],
        ["g = (2π σ_h / 500 nm)²", f"{s['g']:.3f}"],
        ["dominant periods", periods or "none"],
        [
            "Nyquist limits; 2/λ (1/µm)",
            "{:.3g} × {:.3g}, {:.3g}".format(*s["band_limit_per_um"], s["reach_per_um"]),
        ],
        ["visible frequencies below them", f"{100 * s['reach_covered']:.1f} %"],
        ["rms step across the seams (nm)", "{:.1f} × {:.1f}".format(*(1e3 * x for x in s["seam_step_um"]))],
        ["heights' energy in the seams", f"{100 * s['seam_energy']:.2g} %"],
        ["rms step between samples (nm)", "{:.1f} × {:.1f}".format(*(1e3 * x for x in s["inner_step_um"]))],
        *_measured_rows(summary["scan"]),
        *_cleaning_rows(summary["conditioning"]),
    ]


def _measured_rows(scan: dict[str, Any] | None) -> Rows:
    """The samples of a scan that were not measured, and the rows and columns that were cropped for it."""
    if scan is None:
        return []
    found = "; ".join(f"{entry['found']} {100 * entry['share']:.2g} %" for entry in scan["unmeasured"])
    cropped = ", ".join(
        f"{n} at the {edge}" for n, edge in zip(scan["cropped"], ("bottom", "top", "left", "right"), strict=True) if n
    )
    rows = [["not measured", f"{100 * scan['unmeasured_share']:.2g} %" + (f" ({found})" if found else "")]]
    if cropped:
        rows.append(["rows and columns cropped", cropped])
    if scan["masked_share"]:
        rows.append(["covered by the file's mask", f"{100 * scan['masked_share']:.2g} %"])
    return rows


def _cleaning_rows(done: dict[str, Any]) -> Rows:
    """Lists the steps of conditioning, and the number of samples that each changed."""
    rows = [
        ["holes filled", f"{done['holes']} samples, {100 * done['hole_share']:.2g} %"],
        ["levelled by", f"{done['level']} (rms removed {1e3 * done['removed_rms_um']:.2f} nm)"],
    ]
    if done["clip_percentile"] is not None:
        low, high = done["clip_percentile"]
        rows.append([f"clipped to {low:g}..{high:g} %", f"{done['clipped_low'] + done['clipped_high']} samples"])
    return rows


def build(config: Config, inputs: Inputs, results: dict[str, Any], pictures: Mapping[str, bytes]) -> str:
    """Writes the page.

    config: the config. inputs: those of the stage "validate". results: the stage's summary.
    pictures: its plots, PNG, by name.
    Returns HTML.
    """
    surface, table, render = (inputs.summary(name) for name in ("surface", "table", "render"))
    # errors are those of the textures that a bundle holds
    textures = inputs.summary("textures")
    table = {**table, "certificate": textures["certificate"]}
    layout = layouts.of(config.table)
    return template.html(
        "pipeline.report",
        "validation.html.in",
        title=config.name,
        subtitle="Diffraction BRDF: what was baked and how far it is from the exact sum.",
        warnings=surface["warnings"],
        exposure_ru=config.render.exposure_ru,
        colours=[*_colour_rows(config), *_stored_rows(config, layout, textures["loss"])],
        clamped=table["certificate"]["random"]["clamped"],
        maps=[((inputs["render"].folder / light["png"]).read_bytes(), light) for light in render["maps"]],
        surface=_surface_rows(surface),
        settings=layout.settings(inputs.summary(layout.transform.name), table),
        error_columns=ERROR_COLUMNS,
        errors=error_rows(results),
        certifies=table["certificate"]["certifies"],
        relative_errors=_relative_error_rows(results),
        pictures=pictures,
        studied=layout.study_remark,
    )


def _colour_rows(config: Config) -> Rows:
    """The meaning of the colours: normalisation, unit, light and material."""
    absolute, unit = config.material.normalisation == "absolute", config.radiometry.unit
    illuminant = config.light.illuminant
    return [
        ["normalisation", config.material.normalisation],
        ["X, Y, Z of the maps (EXR)", "a BRDF times cos θi, in 1/sr" if absolute else "in RU"],
        [
            "1 RU, a flat sample in its own reflection",
            f"Y = {unit:.5g}" + (" /sr" if absolute else ""),
        ],
        ["pictures (PNG)", "sRGB of X, Y, Z × exposure / (Y of 1 RU), clipped to its gamut"],
        ["light", illuminant if isinstance(illuminant, str) else f"{illuminant.lambda_nm:g} nm"],
        ["reflectance", config.material.fresnel],
        ["licence of the scan", config.publish.licence or "not stated"],
    ]


def _stored_rows(config: Config, layout: Layout, loss: dict[str, Any] | None) -> Rows:
    """The precision and number of the textures, and what they change of the table as baked."""
    if loss is None:
        return [["stored in", f"{config.publish.precision}, without loss"]]
    return layout.stored(config, loss)


def _relative_error_rows(results: dict[str, Any]) -> Rows:
    kinds = [
        ("table on random directions", results["random"]["power"]),
        ("reference against sums over samples", results["reference"]),
    ]
    return [[name, *(f"{e[key]:.1e}" for key in ("median", "percentile_99", "maximum"))] for name, e in kinds]
