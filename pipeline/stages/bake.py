"""A whole bake: every stage of a config, and its results laid out where people look."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.config.models import Config
from pipeline.progress import Progress, silent
from pipeline.stages import bundle, run
from pipeline.stages.validate import REPORT
from pipeline.store import scratch
from pipeline.store.store import Artifact, Store, writing

OnStep = Callable[[run.Step, float | None], None]


@dataclass(frozen=True)
class Results:
    """The artifacts of a config by stage, and the files laid out: maps, then the report."""

    name: str
    artifacts: Mapping[str, Artifact]
    files: tuple[Path, ...]

    @property
    def missed_budget(self) -> str | None:
        """One line where the error that was asked for was not met."""
        budget: dict[str, Any] = self.artifacts["validate"].summary["budget"]
        if budget["met"] is not False:
            return None
        return (
            f"{self.name}: accuracy.delta_e asks for {budget['delta_e']:g} at {budget['exposure_ru']:g} RU, measured "
            f"{budget['measured']:.3g}. Raise the budget, use the polar layout, or a finer table."
        )


def validate(
    config: Config, store: Store, folder: Path, progress: Progress = silent, on_step: OnStep | None = None
) -> Results:
    """Does every stage but the bundle, and copies maps and report out of the store into `folder`.

    on_step: as in `run.execute`. A missed budget is no fault here: see `Results.missed_budget`.
    """
    return _until("validate", config, store, folder, progress, on_step)


def make(
    config: Config, store: Store, folder: Path, progress: Progress = silent, on_step: OnStep | None = None
) -> tuple[Results, Path]:
    """Does every stage, copies maps, report and bundle into `folder`, and returns the bundle's folder, too."""
    results = _until("bundle", config, store, folder, progress, on_step)
    return results, bundle.place(store.open("bundle", results.artifacts["bundle"].key), folder)


def _until(
    stage: str, config: Config, store: Store, folder: Path, progress: Progress, on_step: OnStep | None
) -> Results:
    artifacts = run.execute(config, run.plan(config, store, stage), store, progress, on_step)
    return Results(config.name, artifacts, _lay_out(store, artifacts, folder))


def _lay_out(store: Store, artifacts: Mapping[str, Artifact], folder: Path) -> tuple[Path, ...]:
    maps, report = (store.open(name, artifacts[name].key) for name in ("render", "validate"))
    sources = [*(maps.folder / name for name in sorted(maps.record["files"])), report.folder / REPORT]
    with writing(folder), scratch.replacing(folder) as beside:
        for source in sources:
            shutil.copyfile(source, beside / source.name)
    return tuple(folder / source.name for source in sources)
