"""`bench speed`: all surfaces, kernels' constants, whole runs and criteria, and the files that hold them."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pipeline.config.models import Config
from pipeline.evaluation import results
from pipeline.evaluation.check import Check
from pipeline.evaluation.sources import as_published
from pipeline.evaluation.speed import checks, constants, growth, machine, memory, processes, setting, suite, truth
from pipeline.evaluation.speed.constants import Constant
from pipeline.evaluation.speed.growth import GrowthCurve
from pipeline.evaluation.speed.machine import Machine, share
from pipeline.evaluation.speed.processes import RunFailedError
from pipeline.evaluation.speed.suite import FULL, MAIN, QUICK, SurfaceSpeed
from pipeline.evaluation.stability import sweep, verdict
from pipeline.progress import Progress
from pipeline.stages import run as stages
from pipeline.stages import surface
from pipeline.store import scratch
from pipeline.store.store import Store
from pipeline.surface.heightfield import HeightField

# recipes, each with its defaults, where no config is named
_BUILT_IN = ("elaphe", "xenopeltis", "blazed")
_BAKES_A_SIZE = 2
_COLUMNS = (
    *("surface", "method", "rings", "azimuths", "w_terms", "resolution", "step_nm", "textures", "texels"),
    *("seconds", "scaled", "bytes", "mean_delta_e", "percentile_99", "maximum"),
)


@dataclass(frozen=True)
class SpeedResults:
    """One run on one machine.

    constants: of the first surface's kernels, empty where not measured. curve: cost over the size of a scan.
    """

    machine: Machine
    surfaces: list[SurfaceSpeed]
    constants: list[Constant]
    curve: GrowthCurve
    checks: list[Check]

    def document(self) -> dict[str, Any]:
        """Return all that was measured, for JSON; stages with their shares of the machine's limits."""
        surfaces = [
            {**results.plain(each), "timed": results.plain([share(timed, self.machine) for timed in each.timed])}
            for each in self.surfaces
        ]
        measured = {"surfaces": surfaces, "constants": self.constants, "curve": self.curve}
        return results.document(self.checks, machine=self.machine, **measured)

    def files(self) -> dict[str, str | bytes]:
        """Return by name speed.json, speed.csv (a row a table), speed.png, curve.csv (a row a size), curve.png."""
        from pipeline.evaluation.plots import speed_plots

        files: dict[str, str | bytes] = {
            "speed.json": results.json_text(self.document()),
            "speed.csv": results.csv_text(list(self._rows()), _COLUMNS),
            "speed.png": speed_plots.error_against_cost(self.surfaces, truth.EXPOSURE_RU),
        }
        if self.curve.sizes:
            files["curve.csv"] = results.csv_text(self.curve.rows(), growth.COLUMNS)
            files["curve.png"] = speed_plots.cost_against_size(self.curve)
        return files

    def _rows(self) -> Iterator[dict[str, Any]]:
        for each in self.surfaces:
            for point in each.points:
                row = {"surface": each.name, **vars(point), **point.settings, "mean_delta_e": point.error.mean}
                row |= {"percentile_99": point.error.percentile_99, "maximum": point.error.maximum}
                yield {column: row[column] for column in _COLUMNS if column in row}


@contextmanager
def built_in() -> Iterator[tuple[Path, ...]]:
    """Give paths of configs of three synthetic surfaces for as long as they are needed."""
    with scratch.temporary() as folder:
        recipes = ((name, f'[surface]\nrecipe = {{ kind = "{name}" }}\n') for name in _BUILT_IN)
        yield tuple(processes.write_config(folder, name, text) for name, text in recipes)


def run(
    configs: Sequence[tuple[Config, Path]],
    quick: bool,
    store: Store,
    command_line: Sequence[str],
    progress: Progress,
    note: Callable[[str], None],
) -> SpeedResults:
    """Measure all surfaces and the machine.

    configs: with the files that hold them. quick: smaller maps and samples; one process, no large scan.
    command_line: the words that start the tool, for whole runs. note: called with the name of each part.
    """
    note("device:")
    limits, found = machine.measure(), []
    for config, path in ((as_published(config), path) for config, path in configs):
        note(f"{config.name}:")
        each = suite.run(config, _field(config, store, progress), QUICK if quick else FULL, progress)
        found.append(each if quick else _with_whole_run(each, command_line, path, progress))
        limits = machine.best(limits, machine.measure())
    judged = [check for each in found for check in checks.of_surface(each, limits)]
    judged += verdict.criterion(verdict.sweep(sweep.tall()))
    note(f"growth from {growth.SIDES[0]} x {growth.SIDES[0]} samples:")
    if quick:
        curve = growth.measure(growth.SIDES[:1], 1, (), progress)
    else:
        curve = growth.measure(growth.SIDES, _BAKES_A_SIZE, growth.FORMATS, progress)
    judged += checks.of_curve(curve, limits)
    if quick:
        return SpeedResults(
            limits, found, [], curve, [*judged, checks.of_large_scan(None), *checks.of_compiling(None)]
        )
    note("constants of the kernels:")
    first = configs[0][0]
    inputs = setting.make(_field(first, store, progress), first, MAIN)
    buys = constants.measure(inputs, FULL.bakes, progress)
    note(f"{memory.LARGE_SIDE} x {memory.LARGE_SIDE} samples, 64 terms:")
    judged.append(checks.of_large_scan(memory.peak_bytes(*memory.large_scan(), MAIN)))
    note("a new machine:")
    return SpeedResults(limits, found, buys, curve, [*judged, *_compiling(command_line, progress)])


def _field(config: Config, store: Store, progress: Progress) -> HeightField:
    made = stages.execute(config, stages.plan(config, store, "surface"), store, progress)
    return surface.load(store.open("surface", made["surface"].key))


def _with_whole_run(found: SurfaceSpeed, command_line: Sequence[str], path: Path, progress: Progress) -> SurfaceSpeed:
    try:
        return replace(found, whole_run=processes.warm_run(command_line, path, progress))
    except RunFailedError as error:
        return replace(found, whole_run_fault=f"run --until table failed: {error}")


def _compiling(command_line: Sequence[str], progress: Progress) -> list[Check]:
    try:
        return checks.of_compiling(processes.measure_compiling(command_line, progress))
    except RunFailedError as error:
        return checks.of_compiling(None, f"a run on a new kernel cache failed: {error}")
