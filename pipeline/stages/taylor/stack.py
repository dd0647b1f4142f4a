"""The stage "stack": height field -> the DFT of every Taylor term at the visible frequencies."""

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.models import Config
from pipeline.diffraction import dft_stack, expansion
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress
from pipeline.stages import surface
from pipeline.stages.stage import Inputs, Stage, Summary, light_parameters
from pipeline.store import arrays
from pipeline.store.store import Artifact
from pipeline.tables.taylor.layout import TaylorLayout

_FILE = "stack.zarr"


def layout_of(config: Config) -> TaylorLayout:
    """Returns the section [table] of a config with the paper's layout."""
    assert isinstance(config.table, TaylorLayout)
    return config.table


def _parameters(config: Config) -> dict[str, Any]:
    table = layout_of(config)
    return {
        "spectrum": light_parameters(config),
        "sigma_um": config.coherence.sigma_um,
        "terms": table.terms,
        "tolerance": table.tolerance,
        "step_nm": table.step_nm,
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    field = surface.of(inputs)
    table = layout_of(config)
    quadrature = trapezoid(config.light, table.step_nm)
    order = None if table.terms == "auto" else table.terms
    plan = expansion.plan_taylor(field, quadrature, table.tolerance, order)
    built = dft_stack.build(
        field,
        "taylor",
        plan.order + 1,
        config.coherence.sigma_um,
        expansion.W_MAX / (1e-3 * quadrature.lambda_min_nm),
        dft_stack.window_tolerance(table.tolerance),
        progress,
    )
    _save(built, folder / _FILE)
    return {
        "order": plan.order,
        "predicted_error": plan.error,
        "truncation": plan.truncation,
        "float32_rounding": plan.rounding,
        "frequencies": list(built.coefficients.shape[:2]),
        "window_reach": list(built.reach),
    }


def _save(built: dft_stack.Stack, path: Path) -> None:
    rows, columns = built.coefficients.shape[:2]
    dfx, dfy = built.spacing_per_um
    arrays.save(
        path,
        {
            "F": arrays.Named(built.coefficients, ("fy", "fx", "part", "term"), "1"),
            "fx": arrays.Named((np.arange(columns) - built.column_zero) * dfx, ("fx",), "1/um"),
            "fy": arrays.Named((np.arange(rows) - built.row_zero) * dfy, ("fy",), "1/um"),
        },
        {
            "basis": built.basis,
            "row_zero": built.row_zero,
            "column_zero": built.column_zero,
            "spacing_per_um": list(built.spacing_per_um),
            "reach": list(built.reach),
            "half_range_um": built.half_range_um,
            "sigma_um": built.sigma_um,
            "band_per_um": list(built.band_per_um),
        },
    )


def of(inputs: Inputs) -> dft_stack.Stack:
    """Returns the stack of a stage's inputs."""
    return load(inputs["stack"])


def load(artifact: Artifact) -> dft_stack.Stack:
    """Reads the stack of an artifact of this stage."""
    zarr = artifact.folder / _FILE
    found = arrays.attributes(zarr)
    for pair in ("spacing_per_um", "reach", "band_per_um"):
        found[pair] = tuple(found[pair])
    coefficients = arrays.load(zarr, "F")
    return dft_stack.Stack(coefficients=coefficients, terms=coefficients.shape[3], **found)


STACK = Stage("stack", 4, ("surface",), _parameters, _produce)
