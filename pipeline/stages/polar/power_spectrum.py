"""The stage "power_spectrum": height field -> E(r, phi, s) on a polar grid, for any illuminant and observer."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.models import Config
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.progress import Progress
from pipeline.stages import surface
from pipeline.stages.stage import Inputs, Stage, Summary, kernel_digest, scene_parameters
from pipeline.store import arrays
from pipeline.store.store import Artifact
from pipeline.surface import windows
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan

_FILE = "power_spectrum.zarr"
# the kernels from the stack to a table: the plan measures errors of tables
PLANNING_KERNELS = ("dft_stack.cl", "spectral_operator.cl", "cubic_spline.cl")


def layout_of(config: Config) -> PolarLayout:
    """Returns the section [table] of a config with the polar layout."""
    assert isinstance(config.table, PolarLayout)
    return config.table


def _parameters(config: Config) -> dict[str, Any]:
    return {
        "kernel": kernel_digest("polar_power_spectrum.cl", *PLANNING_KERNELS),
        "coherence": config.coherence.model_dump(mode="json"),
        "wavelengths": _wavelengths(config),
        "scene": scene_parameters(config),
        "table": layout_of(config).model_dump(mode="json"),
        "delta_e": config.budget_delta_e,
        "exposure_ru": config.accuracy.exposure_ru,
    }


def _wavelengths(config: Config) -> dict[str, Any]:
    """Returns the wavelengths, a line or a range, nm: a power spectrum depends on nothing else of the light."""
    light = config.light
    if light.is_line:
        return {"lambda_nm": light.lambda_min_nm}
    return {"range_nm": list(light.range_nm)}


def budget(config: Config) -> plan.Budget:
    """Returns the error budget for which a config's tables are planned."""
    return plan.Budget(config.budget_delta_e, config.accuracy.exposure_ru)


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    field = surface.of(inputs)
    places = windows.places(field.extent, config.coherence)
    layout, allowed = layout_of(config), budget(config)
    sigma_um, light = config.coherence.sigma_um, config.light
    trial = plan.start(field, places, sigma_um, light, config.scene, allowed, layout, progress)
    chosen = plan.choose(trial, config.scene, allowed, layout)
    built = trial.mean_power_spectrum(chosen.azimuths, progress)
    # its memory serves the writing
    del trial
    arrays.save(
        folder / _FILE,
        {
            "E": arrays.Named(built.values, ("tile", "r", "s", "lane"), "1"),
            "phi": arrays.Named(
                np.degrees(built.azimuths.phi()).reshape(-1, built.values.shape[3]), ("tile", "lane"), "degree"
            ),
            "r": arrays.Named(built.radius_per_um, ("r",), "1/um"),
            "s": arrays.Named(built.s_per_um, ("s",), "1/um"),
        },
        {
            "azimuths": asdict(built.azimuths),
            "s_max_per_um": built.s_max_per_um,
            "sigma_um": built.sigma_um,
            "band_per_um": list(built.band_per_um),
        },
    )
    inputs.keep(built)
    return {
        **asdict(chosen),
        "radii": len(built.radius_per_um),
        "bytes": built.values.nbytes,
        "windows": places.count,
        "speckle_contrast": power_spectrum.speckle_contrast(built),
    }


def planned(artifact: Artifact) -> plan.Plan:
    """Reads the plan in the record of an artifact of this stage."""
    return plan_in(artifact.summary)


def plan_in(summary: Summary) -> plan.Plan:
    """Reads the plan in the summary of this stage."""
    found = {key: summary[key] for key in ("terms", "s_nodes", "w_terms", "probed_delta_e")}
    azimuths, rings = Azimuths(**summary["azimuths"]), Rings(**summary["rings"])
    return plan.Plan(azimuths=azimuths, rings=rings, **found)


def of(inputs: Inputs) -> power_spectrum.PolarPowerSpectrum:
    """Returns the power spectrum of a stage's inputs."""
    return inputs.shared("power_spectrum", load)


def load(artifact: Artifact) -> power_spectrum.PolarPowerSpectrum:
    """Reads the power spectrum of an artifact of this stage."""
    zarr = artifact.folder / _FILE
    found = arrays.attributes(zarr)
    return power_spectrum.PolarPowerSpectrum(
        arrays.load(zarr, "E"),
        arrays.load(zarr, "r"),
        Azimuths(**found["azimuths"]),
        found["s_max_per_um"],
        found["sigma_um"],
        tuple(found["band_per_um"]),
    )


def _work(config: Config) -> str:
    return f"a grid for a mean dE of {config.budget_delta_e:g}"


POWER_SPECTRUM = Stage("power_spectrum", 8, ("surface",), _parameters, _produce, uses_device=True, work=_work)
