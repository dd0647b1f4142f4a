"""The stage "textures": table -> the precision in which a bundle holds it, with the certificate of what it holds."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipeline.accuracy import certificate
from pipeline.config.models import Config
from pipeline.progress import Progress
from pipeline.stages import surface
from pipeline.stages.stage import (
    Inputs,
    Stage,
    Summary,
    colour_parameters,
    kernel_digest,
    scene_parameters,
    textures_work,
)
from pipeline.stages.taylor import table
from pipeline.tables.evaluate import interpolator
from pipeline.tables.taylor.table import TaylorTable


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernels": kernel_digest("dft_stack.cl", "exact_power.cl"),
        "precision": config.publish.precision,
        **colour_parameters(config),
        "scene": scene_parameters(config),
    }


def _produce(config: Config, inputs: Inputs, _folder: Path, progress: Progress) -> Summary:
    if config.publish.precision == "float":
        return {"loss": None, "certificate": inputs.summary("table")["certificate"]}
    from pipeline.bundle.taylor import storage

    baked = table.of(inputs)
    scale = storage.scales(baked, "half")
    loss = storage.measure(config, baked, scale)
    rounded = storage.in_half(baked, scale)
    reference = surface.reference_of(config, inputs, progress)
    certified = certificate.measure(interpolator(rounded, config.radiometry), reference, config, progress)
    inputs.keep(rounded)
    return {"loss": loss.model_dump(mode="json"), "certificate": asdict(certified)}


def table_of(inputs: Inputs) -> TaylorTable:
    """Returns the table that the stored textures hold."""
    baked = table.of(inputs)
    if inputs.summary("textures")["loss"] is None:
        return baked
    from pipeline.bundle.taylor import storage

    return inputs.shared("textures", lambda _: storage.in_half(baked, storage.scales(baked, "half")))


TEXTURES = Stage("textures", 2, ("surface", "table"), _parameters, _produce, uses_device=True, work=textures_work)
