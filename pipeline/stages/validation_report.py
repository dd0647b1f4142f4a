"""The validation report: what was baked, how it looks, and how far it is from the truth."""

import math
from collections.abc import Mapping
from typing import Any

from pipeline.config.models import Config
from pipeline.report import template
from pipeline.store.store import Artifact

Rows = list[list[str]]
_STUDIED = {
    "polar": "Azimuths are thinned; the step is one for all rings, beside the mean of those chosen ring by ring.",
    "taylor": "Terms and step are varied at the views themselves, without a grid between.",
}


ERROR_COLUMNS = ("where", "RU", "mean", "99th %", "max")


def error_rows(results: dict[str, Any]) -> Rows:
    """CIELAB errors of the validate stage's summary, one row a place and exposure."""
    places = [(f"map {m['theta_deg']:g}°, {m['phi_deg']:g}°", m["colour"]) for m in results["maps"]]
    places.append(("random directions", results["random"]["colour"]))
    return [
        [place, f"{e['exposure_ru']:g}", *(f"{e[key]:.3f}" for key in ("mean", "percentile_99", "maximum"))]
        for place, errors in places
        for e in errors
    ]


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
            "band limit, beside 2/λ (1/µm)",
            "{:.3g} × {:.3g}, {:.3g}".format(*s["band_limit_per_um"], s["reach_per_um"]),
        ],
        ["reachable frequencies known", f"{100 * s['reach_covered']:.1f} %"],
        ["rms step across the seams (nm)", "{:.1f} × {:.1f}".format(*(1e3 * x for x in s["seam_step_um"]))],
        ["of the heights' energy, in the seams", f"{100 * s['seam_energy']:.2g} %"],
        ["rms step between samples (nm)", "{:.1f} × {:.1f}".format(*(1e3 * x for x in s["inner_step_um"]))],
        *_cleaning_rows(summary["conditioning"]),
    ]


def _cleaning_rows(done: dict[str, Any]) -> Rows:
    """What was done to the scan, and to how many samples."""
    rows = [
        ["holes filled", f"{done['holes']} samples"],
        ["levelled by", f"{done['level']} (rms removed {1e3 * done['removed_rms_um']:.2f} nm)"],
    ]
    if done["clip_percentile"] is not None:
        low, high = done["clip_percentile"]
        rows.append([f"clipped to {low:g}..{high:g} %", f"{done['clipped_low'] + done['clipped_high']} samples"])
    return rows


def _settings_rows(before: dict[str, Any], table: dict[str, Any]) -> Rows:
    """What the table is made of; `before` is the summary of its stack or power spectrum."""
    return _polar_rows(before, table) if table["layout"] == "polar" else _taylor_rows(before, table)


def _polar_rows(power_spectrum: dict[str, Any], table: dict[str, Any]) -> Rows:
    rings, azimuths, certificate = table["rings"], table["azimuths"], table["certificate"]
    return [
        ["Chebyshev terms, nodes in s", f"{power_spectrum['terms']}, {power_spectrum['s_nodes']}"],
        ["windows averaged, contrast left", f"{power_spectrum['windows']}, {power_spectrum['speckle_contrast']:.2f}"],
        ["rings × azimuths", f"{rings['count']} × {azimuths['count']}"],
        ["rings even below ρ =", f"{rings['r0']:.3g}"],
        [
            "azimuths crowd by, about",
            f"{1.0 / azimuths['stretch']:.2f}, {math.degrees(azimuths['axis_rad']):.0f}°",
        ],
        ["terms in |w|", str(table["w_terms"])],
        ["wavelengths a ring", f"{table['wavelengths_mean']:.0f} on average, {table['wavelengths']} at most"],
        ["beyond the scan's band", f"{100 * table['unknown_share']:.2f} %"],
        ["skipped: no view reaches it", f"{100 * table['skipped_share']:.1f} %"],
        [
            f"certificate: mean ΔE at {certificate['exposure_ru']:g} RU",
            f"{certificate['measured']:.3f} of {certificate['delta_e']:g} allowed",
        ],
    ]


def _taylor_rows(stack: dict[str, Any], table: dict[str, Any]) -> Rows:
    n = table["resolution"]
    return [
        ["Taylor order N", str(stack["order"])],
        ["tables I_p (p = 0..2N)", f"{table['powers_of_w']} of {n} × {n}, exponent a = {table['power']:g}"],
        ["wavelengths", str(table["wavelengths"])],
        ["window reach (coefficients)", "±{} × ±{}".format(*stack["window_reach"])],
        ["predicted error of |P|²", f"{stack['predicted_error']:.1e}"],
        ["beyond the scan's band", f"{100 * table['unknown_share']:.2f} %"],
        ["skipped: no view reaches it", f"{100 * table['skipped_share']:.1f} %"],
    ]


def build(
    config: Config, inputs: Mapping[str, Artifact], results: dict[str, Any], pictures: Mapping[str, bytes]
) -> str:
    """The page's text. `results` is the validate stage's summary, `pictures` its plots by name."""
    surface, table, render = (inputs[name].summary for name in ("surface", "table", "render"))
    before = next(inputs[name].summary for name in ("stack", "power_spectrum") if name in inputs)
    return template.html(
        "pipeline.report",
        "validation.html.in",
        title=config.name,
        subtitle="Diffraction BRDF: what was baked and how far it is from the exact sum.",
        warnings=surface["warnings"],
        exposure_ru=config.render.exposure_ru,
        maps=[((inputs["render"].folder / light["png"]).read_bytes(), light) for light in render["maps"]],
        surface=_surface_rows(surface),
        settings=_settings_rows(before, table),
        error_columns=ERROR_COLUMNS,
        errors=error_rows(results),
        relative_errors=_relative_error_rows(results),
        pictures=pictures,
        studied=_STUDIED[table["layout"]],
    )


def _relative_error_rows(results: dict[str, Any]) -> Rows:
    kinds = [
        ("table on random directions", results["random"]["power"]),
        ("reference against sums over samples", results["reference"]),
    ]
    return [[name, *(f"{e[key]:.1e}" for key in ("median", "percentile_99", "maximum"))] for name, e in kinds]
