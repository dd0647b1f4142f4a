"""The stage "textures": table -> the textures that a bundle holds, with the certificate of what they hold."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.config.models import Config
from pipeline.progress import Progress
from pipeline.stages import surface
from pipeline.stages.polar import table
from pipeline.stages.stage import (
    Inputs,
    Stage,
    Summary,
    colour_parameters,
    kernel_digest,
    scene_parameters,
    textures_work,
)
from pipeline.store import arrays
from pipeline.tables.evaluate import Table, interpolator
from pipeline.tables.polar.compression import Envelope, Textures, whole

if TYPE_CHECKING:
    from pipeline.bundle.polar.storage import Stored

_FILE = "textures.zarr"


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernels": kernel_digest("cubic_spline.cl", "dft_stack.cl", "exact_power.cl"),
        "precision": config.publish.precision,
        "textures": config.publish.textures,
        **colour_parameters(config),
        "scene": scene_parameters(config),
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    from pipeline.accuracy.checks import check_border, check_flank
    from pipeline.bundle.polar import storage

    certificate = inputs.summary("table")["certificate"]
    if storage.is_whole(config):
        return {"loss": None, "certificate": certificate}
    reference = surface.reference_of(config, inputs, progress)
    stored, loss, random = storage.choose(config, table.of(inputs), reference)
    arrays.save(
        folder / _FILE,
        {
            "texels": arrays.Named(stored.values, ("output", "row", "column"), "1"),
            "scale": arrays.Named(stored.scale, ("output",), "1"),
            "basis": arrays.Named(stored.textures.basis, ("output", "channel", "w_term"), "1"),
        },
        {"envelope": asdict(stored.textures.envelope)},
    )
    inputs.keep(stored)
    measured = storage.mean_error(random, config)
    kept = measured <= config.budget_delta_e
    interpolate = interpolator(stored.textures, config.radiometry)
    flank, border = (check(interpolate, reference, config) for check in (check_flank, check_border))
    return {
        "loss": loss.model_dump(mode="json"),
        "certificate": {
            **certificate,
            "delta_e": config.budget_delta_e if kept else None,
            "measured": measured,
            "random": asdict(random),
            "flank": None if flank is None else asdict(flank),
            "border": None if border is None else asdict(border),
        },
    }


def of(inputs: Inputs) -> "Stored":
    """Returns the stored textures of a stage's inputs."""
    from pipeline.bundle.polar import storage

    if inputs.summary("textures")["loss"] is None:
        return storage.store(whole(table.of(inputs)), "float")
    return inputs.shared("textures", lambda _: _load(inputs))


def table_of(inputs: Inputs) -> Table:
    """Returns the table that the stored textures hold."""
    if inputs.summary("textures")["loss"] is None:
        return table.of(inputs)
    return of(inputs).textures


def _load(inputs: Inputs) -> "Stored":
    from pipeline.bundle.polar import atlas, storage

    zarr = inputs["textures"].folder / _FILE
    values, scale, basis = (arrays.load(zarr, name) for name in ("texels", "scale", "basis"))
    envelope = Envelope(**arrays.attributes(zarr)["envelope"])
    tiles = table.tiles_of(inputs["table"])
    places = atlas.place(tiles)
    textures = Textures(storage.read_back(places, values, scale), basis, tiles, envelope)
    return storage.Stored(values, scale, places, textures)


TEXTURES = Stage("textures", 3, ("surface", "table"), _parameters, _produce, uses_device=True, work=textures_work)
