"""The results of a run as JSON and CSV."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pipeline.evaluation.speed.constants import Constant
from pipeline.evaluation.speed.criteria import Criterion
from pipeline.evaluation.speed.machine import Machine, share
from pipeline.evaluation.speed.suite import SurfaceBench

_COLUMNS = (
    "surface",
    "method",
    "rings",
    "azimuths",
    "w_terms",
    "resolution",
    "step_nm",
    "textures",
    "texels",
    "seconds",
    "scaled",
    "bytes",
    "mean_delta_e",
    "percentile_99",
    "maximum",
)


@dataclass(frozen=True)
class Results:
    """One run of the bench on one machine; constants: of the first surface's kernels, empty where not measured."""

    machine: Machine
    surfaces: list[SurfaceBench]
    constants: list[Constant]
    criteria: list[Criterion]


def document(results: Results) -> dict[str, Any]:
    """All that was measured, for JSON."""
    found = asdict(results)
    found["criteria"] = [{**asdict(c), "verdict": c.verdict} for c in results.criteria]
    for surface, told in zip(results.surfaces, found["surfaces"], strict=True):
        reached = [share(timed, results.machine) for timed in surface.timed]
        told["timed"] = [{**asdict(r), "bound": r.bound, "bound_share": r.bound_share} for r in reached]
    return found


def json_text(results: Results) -> str:
    return json.dumps(document(results), indent=1) + "\n"


def csv_text(results: Results) -> str:
    """Every table that was made, one a line."""
    text = io.StringIO()
    writer = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(_rows(results.surfaces))
    return text.getvalue()


def _rows(surfaces: Sequence[SurfaceBench]) -> list[dict[str, Any]]:
    return [
        {
            "surface": surface.name,
            "method": point.method,
            **point.settings,
            "texels": point.texels,
            "seconds": f"{point.seconds:.4g}",
            "scaled": point.scaled,
            "bytes": point.bytes,
            "mean_delta_e": f"{point.error.mean:.4g}",
            "percentile_99": f"{point.error.percentile_99:.4g}",
            "maximum": f"{point.error.maximum:.4g}",
        }
        for surface in surfaces
        for point in surface.points
    ]
