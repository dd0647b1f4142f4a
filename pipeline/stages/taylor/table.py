"""The stage "table": Taylor stack, light and material -> I_p(u, v) in X, Y and Z, with its certificate."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.accuracy import certificate
from pipeline.config.models import Config
from pipeline.progress import Progress
from pipeline.stages import surface
from pipeline.stages.stage import Inputs, Stage, Summary, colour_parameters, kernel_digest, scene_parameters
from pipeline.stages.taylor import stack
from pipeline.store import arrays
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import interpolator
from pipeline.tables.taylor import grid
from pipeline.tables.taylor import table as taylor

_FILE = "table.zarr"


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernel": kernel_digest("taylor_table.cl", "dft_stack.cl", "exact_power.cl"),
        # of the certificate, which measures colours and so depends on the whole material
        **colour_parameters(config),
        "table": config.table.model_dump(mode="json"),
        "scene": scene_parameters(config),
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    built = stack.of(inputs)
    section = stack.layout_of(config)
    quadrature = config.radiometry.integrand(section.step_nm)
    table = taylor.build(built, quadrature, section.resolution, section.power, config.scene, progress)
    nodes = grid.nodes(table.resolution, table.power)
    arrays.save(
        folder / _FILE,
        {
            "I_p": arrays.Named(table.values, ("v", "u", "channel", "p"), "1"),
            "computed": arrays.Named(table.computed, ("v", "u"), "1"),
            "unknown": arrays.Named(table.unknown, ("v", "u"), "1"),
            "u": arrays.Named(nodes, ("u",), "1"),
            "v": arrays.Named(nodes, ("v",), "1"),
        },
        {"power": table.power, "channels": ["X", "Y", "Z"]},
    )
    inside = np.hypot(nodes[:, None], nodes) <= grid.U_MAX
    interpolate = interpolator(table, config.radiometry)
    certified = certificate.measure(interpolate, surface.reference_of(config, inputs, progress), config, progress)
    inputs.keep(table)
    return {
        "layout": "taylor",
        "resolution": table.resolution,
        "power": table.power,
        "powers_of_w": int(table.values.shape[3]),
        "wavelengths": len(quadrature.lambda_nm),
        "unknown_share": table.unknown_share,
        "skipped_share": float(1.0 - np.mean(table.computed[inside])),
        "certificate": asdict(certified),
    }


def of(inputs: Inputs) -> taylor.TaylorTable:
    """Returns the table of a stage's inputs."""
    return inputs.shared("table", load)


def load(artifact: Artifact) -> taylor.TaylorTable:
    """Reads the table of an artifact of this stage."""
    zarr = artifact.folder / _FILE
    values, computed, unknown = (arrays.load(zarr, name) for name in ("I_p", "computed", "unknown"))
    return taylor.TaylorTable(values, computed, unknown, float(arrays.attributes(zarr)["power"]))


def _work(config: Config) -> str:
    layout = stack.layout_of(config)
    return f"{layout.resolution}² nodes x {layout.step_nm:g} nm steps"


TABLE = Stage("table", 4, ("surface", "stack"), _parameters, _produce, uses_device=True, work=_work)
