"""Validate: the table against the exact reference, as numbers, plots and one page."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipeline import validation
from pipeline.config import Config
from pipeline.device_stack import kernel_digest
from pipeline.evaluate import table_evaluator
from pipeline.optics.spectra import shortest_wavelength_nm
from pipeline.progress import Progress
from pipeline.reference import Reference
from pipeline.stages import render, stack, surface, table
from pipeline.stages.stage import Inputs, Stage, Summary, material_parameters, spectrum_parameters

REPORT = "report.html"


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernel": kernel_digest("power_spectrum.cl"),
        "name": config.name,
        "material": material_parameters(config),
        "spectrum": spectrum_parameters(config),
        "accuracy": config.accuracy.model_dump(mode="json"),
        "render": config.render.model_dump(mode="json"),
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    from pipeline.report import plots, validation_report

    field = surface.load(inputs["surface"])
    evaluate = table_evaluator(table.load(inputs["table"]), config)
    reference = Reference(field, config.coherence.sigma_um, shortest_wavelength_nm(config.spectrum), progress)
    lights, radius = config.render.lights, render.map_radius(config)
    directions = [render.light_direction(light) for light in lights]
    checks = [validation.check_map(evaluate, reference, config, wi, radius, progress) for wi in directions]
    built = stack.load(inputs["stack"])
    study = validation.Convergence(built, evaluate, reference, config, directions[0], radius)
    curves = _curves(study, inputs["table"].summary["wavelengths"] > 1, progress)
    maps = [
        {**light.model_dump(), "colour": [asdict(error) for error in check.colour]}
        for light, check in zip(lights, checks, strict=True)
    ]
    results: Summary = {
        "reference": asdict(validation.check_reference(field, reference, config)),
        "random": asdict(validation.check_random(evaluate, reference, config, progress)),
        "maps": maps,
        "convergence": [asdict(curve) for curve in curves],
        "budget": _budget(config, maps),
    }
    exposures = config.render.exposure_ru, config.accuracy.exposure_ru
    pictures = {"surface": plots.height_map(field), "convergence": plots.convergence(curves, exposures[1])}
    for light, check in zip(lights, checks, strict=True):
        named = f"light {light.theta_deg:g}°, {light.phi_deg:g}°"
        pictures[f"comparison_{render.map_name(light)}"] = plots.map_comparison(check, *exposures, named)
    for name, png in pictures.items():
        (folder / f"{name}.png").write_bytes(png)
    (folder / REPORT).write_text(validation_report.build(config, inputs, results, pictures), encoding="utf-8")
    return results


def _curves(study: validation.Convergence, has_steps: bool, progress: Progress) -> list[validation.Curve]:
    """Every setting's curve; a laser line has no wavelength step to vary."""
    settings = [study.terms, *([study.step] if has_steps else []), study.grid, study.exponent]
    curves = []
    for i, setting in enumerate(settings):
        curves.append(setting())
        progress("convergence", (i + 1) / len(settings))
    return curves


def _budget(config: Config, maps: list[dict[str, Any]]) -> dict[str, Any]:
    """The error asked for beside the largest mean error of the maps at its exposure."""
    asked, exposure = config.accuracy.delta_e, config.accuracy.exposure_ru
    measured = max(e["mean"] for m in maps for e in m["colour"] if e["exposure_ru"] == exposure)
    met = None if asked is None else measured <= asked
    return {"delta_e": asked, "exposure_ru": exposure, "measured": measured, "met": met}


VALIDATE = Stage("validate", 1, ("surface", "stack", "table", "render"), _parameters, _produce)
