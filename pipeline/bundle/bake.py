"""Bake: every stage of a config, what people look at laid out beside, and its bundle."""

import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.config.models import Config
from pipeline.progress import Progress, silent
from pipeline.stages import run
from pipeline.stages.validate import REPORT
from pipeline.store import scratch
from pipeline.store.store import Artifact, Store, writing


@dataclass(frozen=True)
class Results:
    """What a config became: its artifacts by stage, and the files laid out, the report last."""

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


def make(
    config: Config,
    store: Store,
    folder: Path,
    progress: Progress = silent,
    on_step: Callable[[run.Step, float | None], None] | None = None,
) -> Results:
    """Does every stage, and copies maps and report out of the store into `folder`.

    `on_step` hears of each step, as in `run.execute`. A missed budget is no fault here: see `Results.missed_budget`.
    """
    artifacts = run.execute(config, run.plan(config, store), store, progress, on_step)
    return Results(config.name, artifacts, _lay_out(store, artifacts, folder))


def _lay_out(store: Store, artifacts: Mapping[str, Artifact], folder: Path) -> tuple[Path, ...]:
    maps, report = (store.open(name, artifacts[name].key) for name in ("render", "validate"))
    sources = [*(maps.folder / name for name in sorted(maps.record["files"])), report.folder / REPORT]
    with writing(folder), scratch.replacing(folder) as beside:
        for source in sources:
            shutil.copyfile(source, beside / source.name)
    return tuple(folder / source.name for source in sources)


def publish_once(
    config: Config, store: Store, artifacts: Mapping[str, Artifact], folder: Path, progress: Progress = silent
) -> tuple[Path, float | None]:
    """The bundle of these artifacts in `folder`, and the seconds it took, None where it stood already."""
    from pipeline.bundle.publish import publish, published

    standing = published(config, {name: a.key for name, a in artifacts.items()}, folder)
    if standing is not None:
        return standing, None
    started = time.perf_counter()
    opened = {name: store.open(name, artifact.key) for name, artifact in artifacts.items()}
    return publish(config, opened, folder, progress), time.perf_counter() - started
