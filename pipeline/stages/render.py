"""The stage "render": textures -> BRDF maps, one for each light, as EXR and PNG."""

from pathlib import Path
from typing import Any

import numpy as np

from pipeline import layouts
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.optics.colour import clipped, pixels
from pipeline.progress import Progress
from pipeline.report import images
from pipeline.resources import Need, largest
from pipeline.scene.lights import Direction
from pipeline.scene.maps import map_radius
from pipeline.stages.foreseen import Foreseen, LayoutSizes, base, heap, spare
from pipeline.stages.stage import Inputs, Stage, Summary, light_parameters, material_parameters
from pipeline.tables.evaluate import Map, interpolator, look_up_bytes, map_bytes, never_negative, render_map


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "render": config.render.model_dump(mode="json"),
        "material": material_parameters(config),
        "spectrum": light_parameters(config),
    }


def light_direction(light: Direction) -> Array:
    """Computes the unit vector (3,) towards a light, away from the surface."""
    return light.vector


def map_name(light: Direction) -> str:
    """Returns the file name of a light's map without its suffix: it holds the angles in degrees."""
    return f"map_theta{light.theta_deg:.12g}_phi{light.phi_deg:.12g}"


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    interpolate = interpolator(layouts.of(config.table).stored_of(inputs), config.radiometry)
    unit = config.radiometry.unit
    maps = []
    for i, light in enumerate(config.render.lights):
        views = Map(config.render.size, map_radius(config.scene, light))
        interpolated = render_map(interpolate, light_direction(light), views)
        image = never_negative(interpolated)
        stem = map_name(light)
        images.write_xyz(folder / f"{stem}.exr", image)
        images.write_png(folder / f"{stem}.png", pixels(image / unit, config.render.exposure_ru))
        maps.append(
            {
                **light.model_dump(),
                "exr": f"{stem}.exr",
                "png": f"{stem}.png",
                "negative_share": float(np.mean(np.any(interpolated[views.inside] < 0.0, axis=-1))),
                "clipped_share": float(np.mean(clipped(image[views.inside] / unit, config.render.exposure_ru))),
            }
        )
        progress("maps", (i + 1) / len(config.render.lights))
    return {"maps": maps, "exposure_ru": config.render.exposure_ru, "size": config.render.size}


def need(foreseen: Foreseen, sizes: LayoutSizes) -> Need:
    """Computes memory and time of this stage: the table and one map at a time."""
    config, reference = foreseen.config, foreseen.reference
    wavelengths = 1 if config.light.is_line else foreseen.wavelengths
    objects = {"transform": sizes.transform_bytes, "reference": reference.nbytes, "textures": sizes.stored_bytes}
    held = {**foreseen.held(**objects), **heap(sizes.transform_bytes, sizes.table_bytes)}
    factor = 0 if config.table.holds_metals else look_up_bytes(wavelengths, config.material)
    arrays = largest(
        foreseen.reading(table=sizes.table_bytes),
        {"table": sizes.table_bytes, "map": map_bytes(config.render.size), "factor of directions": factor},
    )
    seconds = 1e-6 * len(config.render.lights) * config.render.size**2
    return Need({**base("render"), **spare(sizes.freed_bytes), **held, **arrays}, seconds)


def _work(config: Config) -> str:
    return f"{len(config.render.lights)} map(s) of {config.render.size}²"


RENDER = Stage("render", 5, ("table", "textures"), _parameters, _produce, uses_device=True, work=_work)
