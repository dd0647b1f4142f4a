"""The stage "validate": errors of the table against the exact reference, as numbers, plots and a page."""

from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import asdict
from functools import partial
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

from pipeline import layouts
from pipeline.accuracy import checks, convergence
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.progress import Progress
from pipeline.resources import Need, largest
from pipeline.scene.maps import map_radius
from pipeline.stages import render, surface
from pipeline.stages.foreseen import Foreseen, LayoutSizes, base, heap, spare
from pipeline.stages.layout import Layout
from pipeline.stages.session import Small
from pipeline.stages.stage import Inputs, Stage, Summary, colour_parameters, kernel_digest
from pipeline.store import digest
from pipeline.tables.evaluate import Evaluator, table_evaluator

REPORT = "report.html"
# of one reflectance, s
_METAL_S = 7e-8


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernel": kernel_digest("dft_stack.cl", "exact_power.cl"),
        "name": config.name,
        **colour_parameters(config),
        "render": config.render.model_dump(mode="json"),
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    # one thread draws while the device computes the next numbers
    with ThreadPoolExecutor(1) as drawing:
        results, drawn = _measured(config, inputs, drawing, progress)
        pictures = {name: picture.result() for name, picture in drawn.items()}
    for name, png in pictures.items():
        (folder / f"{name}.png").write_bytes(png)
    from pipeline.stages import validation_report

    (folder / REPORT).write_text(validation_report.build(config, inputs, results, pictures), encoding="utf-8")
    return results


def _measured(
    config: Config, inputs: Inputs, drawing: Executor, progress: Progress
) -> tuple[Summary, dict[str, Future[bytes]]]:
    """Computes the numbers of the summary; returns them and the pictures by name, drawn by the executor."""
    field, layout = surface.of(inputs), layouts.of(config.table)
    drawn = {"surface": drawing.submit(_once, inputs, f"plot of {inputs['surface'].key}", "height_map", field)}
    # errors are those of the textures that a bundle holds; settings are varied of the table that they are made of
    evaluate, baked = (table_evaluator(of(inputs), config.radiometry) for of in (layout.stored_of, layout.table_of))
    if config.scene is not None:
        tiles = None if layout.tiles_of is None else layout.tiles_of(inputs["table"])
        drawn["scene"] = drawing.submit(_picture, "visited_directions", config.scene, tiles)
    reference = surface.reference_of(config, inputs, progress)
    exposures = (config.render.exposure_ru, config.accuracy.exposure_ru)
    radii = [map_radius(config.scene, light) for light in config.render.lights]
    studied, compute = _name_of_curves(layout, config, inputs), partial(_curves, layout, config, inputs, baked)
    curves = inputs.session.derived(studied, lambda: compute(reference, progress)).value
    drawn["convergence"] = drawing.submit(_once, inputs, f"plot of {studied}", "convergence", curves, exposures[1])
    maps: list[dict[str, Any]] = []
    for light, radius in zip(config.render.lights, radii, strict=True):
        towards, named = render.light_direction(light), f"light {light.theta_deg:g}°, {light.phi_deg:g}°"
        check = checks.check_map(evaluate, reference, config, towards, radius, progress)
        picture = drawing.submit(_picture, "map_comparison", check, *exposures, named)
        drawn[f"comparison_{render.map_name(light)}"] = picture
        errors = {key: [asdict(error) for error in getattr(check, key)] for key in ("colour", "largest")}
        maps.append({**light.model_dump(), **errors})
    certificate = inputs.summary("textures")["certificate"]
    results: Summary = {
        # these were measured for the certificate
        **{name: certificate[name] for name in ("reference", "random", "flank", "border")},
        "maps": maps,
        "convergence": [asdict(curve) for curve in curves],
        "budget": _budget(config, maps),
    }
    return results, drawn


def _picture(of: str, *arguments: Any) -> bytes:
    """Draws a plot by its function's name, as PNG; matplotlib is imported here because that takes long."""
    png: bytes = getattr(import_module("pipeline.accuracy.plots"), of)(*arguments)
    return png


def _once(inputs: Inputs, name: str, of: str, *arguments: Any) -> bytes:
    """Draws a plot that other configs of this run share."""
    return inputs.session.derived(name, lambda: Small(_picture(of, *arguments))).value


def _studied(layout: Layout, config: Config) -> Config:
    """Returns the config whose light and material the curves have."""
    return config if layout.studied is None else layout.studied(config)


def _name_of_curves(layout: Layout, config: Config, inputs: Inputs) -> str:
    """Names the curves after all that they depend on."""
    of = {**colour_parameters(_studied(layout, config)), "light": config.render.lights[0].model_dump()}
    table = "table" if layout.studied is None else layout.transform.name
    return f"curves of {inputs[table].key} {digest.of_json(of)}"


def _curves(
    layout: Layout, config: Config, inputs: Inputs, baked: Evaluator, reference: Reference, progress: Progress
) -> Small[list[convergence.Curve]]:
    """Computes the error against each setting of the table, on a coarse map under the first light."""
    studied, first = _studied(layout, config), config.render.lights[0]
    coarse = convergence.CoarseMap(reference, studied, render.light_direction(first), map_radius(config.scene, first))
    study, curves = layout.study(studied, inputs, baked, coarse), []
    for i, setting in enumerate(study):
        curves.append(setting())
        progress("convergence", (i + 1) / len(study))
    return Small(curves)


def _budget(config: Config, maps: list[dict[str, Any]]) -> dict[str, Any]:
    """Compares the allowed error with the largest mean error of the maps at the same exposure."""
    asked, exposure = config.accuracy.delta_e, config.accuracy.exposure_ru
    measured = max(e["mean"] for m in maps for e in m["colour"] if e["exposure_ru"] == exposure)
    met = None if asked is None else measured <= asked
    return {"delta_e": asked, "exposure_ru": exposure, "measured": measured, "met": met}


def need(foreseen: Foreseen, sizes: LayoutSizes) -> Need:
    """Computes memory and time of this stage.

    Table, textures, transform and reference exist throughout. The maps of all lights wait for their drawing.
    """
    config, reference = foreseen.config, foreseen.reference
    lights = len(config.render.lights)
    views, wavelengths = round(pi / 4 * checks.MAP_SIZE**2), foreseen.wavelengths
    transform = {"transform": sizes.transform_bytes}
    table = {"table": sizes.table_bytes, "textures": sizes.stored_bytes}
    kept = {**spare(sizes.freed_bytes, sizes.study.buffer), **heap(sizes.transform_bytes, sizes.table_bytes)}
    answering = reference.answering(views, wavelengths, config.material)
    maps = {"maps of all lights": lights * 7 * checks.MAP_SIZE**2 * 8, **answering}
    arrays = largest(
        {"reference": reference.nbytes, **foreseen.reading(**table)},
        {"reference": reference.nbytes, **table, **foreseen.reading(transform=sizes.transform_bytes)},
        {"reference": reference.nbytes, **table, **transform, **sizes.study.arrays},
        {**table, **transform, **reference.making()},
        {**table, **transform, **maps},
    )
    # the rows of a map share sums over columns
    shared = (2 * reference.stack.reach[1] + 1) / 2
    # Fresnel's equations of a metal at every view and wavelength
    metal = _METAL_S * views * wavelengths if config.material.fresnel == "conductor" else 0.0
    seconds = sizes.study.seconds + (lights + 0.05) * (reference.seconds(views, wavelengths) / shared + metal)
    return Need({**base("validate"), **kept, **foreseen.held(), **arrays}, seconds, sizes.study.buffer)


def _work(config: Config) -> str:
    return f"{len(config.render.lights)} map(s) of {checks.MAP_SIZE}² at 1 nm"


def stage_of(layout: Layout) -> Stage:
    """Returns the validation stage of a layout, whose inputs include the layout's transform."""
    inputs = ("surface", layout.transform.name, "table", "textures", "render")
    return Stage("validate", 10, inputs, _parameters, _produce, uses_device=True, work=_work)
