"""The stage "table": power spectrum, light and material -> the polar table of XYZ, with its certificate."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.models import Config
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import Tiles
from pipeline.progress import Progress
from pipeline.stages import surface
from pipeline.stages.polar import certificate, power_spectrum
from pipeline.stages.stage import Inputs, Stage, Summary, colour_parameters, kernel_digest
from pipeline.store import arrays
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import interpolator
from pipeline.tables.polar import table as polar

_FILE = "table.zarr"


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernels": kernel_digest(*power_spectrum.PLANNING_KERNELS, "exact_power.cl"),
        # of the certificate, which measures colours and so depends on the whole material
        **colour_parameters(config),
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    power = power_spectrum.of(inputs)
    plan = power_spectrum.planned(inputs["power_spectrum"])
    bake = plan.bake(config.radiometry, power_spectrum.budget(config), power_spectrum.layout_of(config))
    rules = bake.rules(plan.rings.rho())
    table = bake.table(power, plan.rings, rules)
    progress("table", 1.0)
    light = config.radiometry.illumination(config.table.mean_step_nm)
    unknown = polar.unknown_share(table.grid, power.band_per_um, light)
    reference = surface.reference_of(config, inputs, progress)
    certified = certificate.certify(interpolator(table, config.radiometry), reference, config, progress)
    has_spectral_form = power_spectrum.layout_of(config).form == "spectral"
    spectral = certificate.certify_spectral(power, reference, config) if has_spectral_form else None
    arrays.save(
        folder / _FILE,
        {
            "table": arrays.Named(table.values, ("rho", "channel", "w_term", "phi"), "1"),
            "rho": arrays.Named(table.grid.rings.rho(), ("rho",), "1"),
            "phi": arrays.Named(np.degrees(table.grid.azimuths.phi()), ("phi",), "degree"),
            "wavelengths": arrays.Named(rules.count, ("rho",), "1"),
        },
        {
            "rings": asdict(table.grid.rings),
            "azimuths": asdict(table.grid.azimuths),
            "channels": ["X", "Y", "Z"],
        },
    )
    inputs.keep(table)
    return {
        "layout": "polar",
        "rings": asdict(table.grid.rings),
        "azimuths": asdict(table.grid.azimuths),
        "tiles": {"covered": table.tiles.covered.tolist(), "every": list(table.tiles.every)},
        "texels": table.tiles.texels,
        "w_terms": table.w_terms,
        "wavelengths": int(rules.count.max()),
        "wavelengths_mean": float(rules.count.mean()),
        "unknown_share": unknown,
        "skipped_share": 1.0 - table.tiles.covered_share() * (table.grid.rings.rho_max / 2.0) ** 2,
        "certificate": asdict(certified),
        "spectral_error": None if spectral is None else asdict(spectral),
    }


def of(inputs: Inputs) -> polar.PolarTable:
    """Returns the table of a stage's inputs."""
    return inputs.shared("table", load)


def load(artifact: Artifact) -> polar.PolarTable:
    """Reads the table of an artifact of this stage."""
    return polar.PolarTable(arrays.load(artifact.folder / _FILE, "table"), tiles_of(artifact))


def tiles_of(artifact: Artifact) -> Tiles:
    """Returns the tiles in the record of an artifact of this stage."""
    found = artifact.summary
    grid = PolarGrid(Rings(**found["rings"]), Azimuths(**found["azimuths"]))
    return Tiles(grid, np.array(found["tiles"]["covered"], bool), tuple(found["tiles"]["every"]))


def _work(config: Config) -> str:
    layout = power_spectrum.layout_of(config)
    return f"{layout.rings} rings x {layout.azimuths} azimuths"


TABLE = Stage("table", 9, ("surface", "power_spectrum"), _parameters, _produce, uses_device=True, work=_work)
