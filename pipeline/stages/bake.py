"""A whole bake: every stage of a config, and the results copied into a folder for people."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.config.models import Config
from pipeline.progress import Progress, silent
from pipeline.stages import bundle, run
from pipeline.stages.session import Session
from pipeline.stages.validate import REPORT
from pipeline.store import scratch
from pipeline.store.store import Artifact, Store, writing

OnStep = Callable[[run.Step, float | None], None]


@dataclass(frozen=True)
class Results:
    """The results of a bake.

    name: the config's. artifacts: the artifact of each stage, by the stage's name.
    files: the copies in the results' folder: maps (EXR and PNG), then the report.
    """

    name: str
    artifacts: Mapping[str, Artifact]
    files: tuple[Path, ...]

    @property
    def missed_budget(self) -> str | None:
        """Returns the error message of a missed error budget; None where it is met or none is set."""
        budget: dict[str, Any] = self.artifacts["validate"].measured("budget", dict)
        if budget["met"] is not False:
            return None
        return (
            f"{self.name}: accuracy.delta_e asks for {budget['delta_e']:g} at {budget['exposure_ru']:g} RU, measured "
            f"{budget['measured']:.3g}. Raise the budget, use the polar layout, or a finer table."
        )


def validate(
    config: Config,
    steps: list[run.Step],
    store: Store,
    folder: Path,
    progress: Progress = silent,
    on_step: OnStep | None = None,
    session: Session | None = None,
) -> Results:
    """Runs every stage except the bundle, and copies maps and report from the store into a folder.

    config: the config. steps: its plan until this stage. store: the store of its artifacts.
    folder: of the results, made where it is missing.
    progress: called with a step's name and its completed share, 0 to 1. on_step, session: as in `run.execute`.
    Returns the results; a missed budget raises nothing, see `Results.missed_budget`.
    Raises StorageError where a file cannot be written, and the errors of the stages.
    """
    return _made(config, steps, store, folder, progress, on_step, session)


def make(
    config: Config,
    steps: list[run.Step],
    store: Store,
    folder: Path,
    progress: Progress = silent,
    on_step: OnStep | None = None,
    session: Session | None = None,
) -> tuple[Results, Path]:
    """Runs every stage, and copies maps, report and bundle from the store into a folder.

    steps: the plan of the config until its bundle. Other parameters and errors are those of `validate`.
    Returns the results and the bundle's folder.
    Raises DamagedError as well, where `folder` already has a bundle of this name whose files have changed.
    """
    results = _made(config, steps, store, folder, progress, on_step, session)
    return results, bundle.place(store.open("bundle", results.artifacts["bundle"].key), folder)


def _made(
    config: Config,
    steps: list[run.Step],
    store: Store,
    folder: Path,
    progress: Progress,
    on_step: OnStep | None,
    session: Session | None,
) -> Results:
    artifacts = run.execute(config, steps, store, progress, on_step, session)
    return Results(config.name, artifacts, _lay_out(store, artifacts, folder))


def _lay_out(store: Store, artifacts: Mapping[str, Artifact], folder: Path) -> tuple[Path, ...]:
    maps, report = (store.open(name, artifacts[name].key) for name in ("render", "validate"))
    sources = [*(maps.folder / name for name in sorted(maps.record["files"])), report.folder / REPORT]
    with writing(folder), scratch.replacing(folder) as temporary:
        for source in sources:
            shutil.copyfile(source, temporary / source.name)
    return tuple(folder / source.name for source in sources)
