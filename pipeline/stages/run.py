"""The stages of a config in order: the plan, a pure function of config and store, and its execution."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Thread
from typing import Any

from kernels.device import default_device
from pipeline import layouts, resources
from pipeline.config.models import Config
from pipeline.diffraction.device import require_device
from pipeline.progress import Progress, silent
from pipeline.resources import Need
from pipeline.stages import bundle, cost, forecast, provenance, validate
from pipeline.stages.render import RENDER
from pipeline.stages.session import Session
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.stages.surface import SURFACE
from pipeline.store.store import Artifact, Store

UNCHANGED = "nothing it reads has changed"


def stages(config: Config) -> tuple[Stage, ...]:
    """Returns the stages of a config in order; the transform of the surface and the table are the layout's own."""
    layout = layouts.of(config.table)
    return (
        SURFACE,
        layout.transform,
        layout.table,
        layout.textures,
        RENDER,
        validate.stage_of(layout),
        bundle.stage_of(layout),
    )


@dataclass(frozen=True)
class Step:
    """One stage of a plan: the address of its artifact, and whether the store has it."""

    stage: Stage
    key: str
    cached: bool


@dataclass(frozen=True)
class Explanation:
    """The reason why a step is cached or to do, and its work, as texts; and predictions, None where unknown.

    need: its memory. seconds, bytes: predicted time, s, and size of its artifact. delta_e: mean CIELAB error that is
    expected of the table, in the step that makes it.
    """

    reason: str
    work: str
    need: Need | None
    seconds: float | None
    bytes: int | None
    delta_e: float | None


def plan(config: Config, store: Store, until: str = "bundle") -> list[Step]:
    """Lists the steps that a stage needs, itself last, each cached or to do. Writes nothing.

    config: the config. store: the store of artifacts. until: name of the last stage.
    """
    keys: dict[str, str] = {}
    needed = _needed(config, until)
    for stage in needed:
        keys[stage.name] = stage.key(config, keys)
    return [Step(stage, keys[stage.name], store.has(stage.name, keys[stage.name])) for stage in needed]


def explain(config: Config, steps: list[Step], store: Store) -> list[Explanation]:
    """Explains each step of a plan: why it is cached or to do, and its time, memory, bytes and error.

    Reads the records of the whole store, and a scan that no stage has read. Measures the pace of this machine where
    the store does not know it.

    config: the config of the plan. steps: the plan.
    Returns one explanation per step.
    """
    earlier = store.artifacts()
    made = {step.stage.name for step in steps if not step.cached}
    foreseen, machine = forecast.outcome(config, summaries(steps, store)), cost.machine(store)
    explanations = []
    for step in steps:
        name = step.stage.name
        reason = UNCHANGED
        if not step.cached:
            reason = _reason(step.stage, config, made, _latest(earlier, name, config.name))
        need = foreseen.needs.get(name)
        seconds = None if need is None else machine.seconds(name, need)
        error = foreseen.delta_e if name == "table" else None
        work = step.stage.work(config)
        if name == "table" and foreseen.kept_share < 1.0:
            work = f"{work}, {100.0 * foreseen.kept_share:.0f} % of the texels kept"
        explanations.append(Explanation(reason, work, need, seconds, foreseen.written.get(name), error))
    return explanations


def _needed(config: Config, until: str) -> list[Stage]:
    """Returns the stages that `until` needs, in order, itself last."""
    by_name = {stage.name: stage for stage in stages(config)}
    wanted, queue = {until}, [until]
    while queue:
        for name in by_name[queue.pop()].inputs:
            if name not in wanted:
                wanted.add(name)
                queue.append(name)
    return [stage for stage in stages(config) if stage.name in wanted]


def execute(
    config: Config,
    steps: list[Step],
    store: Store,
    progress: Progress = silent,
    on_step: Callable[[Step, float | None], None] | None = None,
    session: Session | None = None,
) -> dict[str, Artifact]:
    """Runs the steps of a plan that are to do.

    config: the config of the plan. steps: the plan. store: where artifacts are read and written.
    progress: called with a step's name and its completed share, 0 to 1.
    on_step: called after each step with the seconds that it took, None where it was cached.
    session: objects in memory, which the stages use and add to; None for none.
    Returns every step's artifact by stage; its record is checked, its files are not.
    Raises ResourceError where a step needs more memory than is allowed, DeviceError where a step needs a device and
    none works, and the errors of the stages and the store.
    """
    keys = {step.stage.name: step.key for step in steps}
    device = _Device() if _uses_device(steps, store) else None
    if device is not None:
        device.start()
    opened: dict[str, Artifact] = {}
    shared = session or Session()
    for step in steps:
        name, seconds = step.stage.name, None
        require_memory(config, steps, store, device.largest_bytes() if device and step.stage.uses_device else None)
        if store.has(name, step.key):
            store.touch(name, step.key)
        else:
            with store.lock(name, step.key):
                # another run may have made it while this one waited for the lock
                if not store.has(name, step.key):
                    started = time.perf_counter()
                    for needed in set(step.stage.inputs) - set(opened):
                        opened[needed] = store.open(needed, keys[needed])
                    artifacts = {needed: opened[needed] for needed in step.stage.inputs}
                    _make(config, step, Inputs(artifacts, shared, step.key), store, progress, device)
                    # its files were hashed when they were written, so they need no check
                    opened[name] = store.describe(name, step.key)
                    seconds = time.perf_counter() - started
        if on_step is not None:
            on_step(step, seconds)
    return {name: store.describe(name, key) for name, key in keys.items()}


def _uses_device(steps: list[Step], store: Store) -> bool:
    """Says whether a step that is to do uses a device; other runs may have made artifacts since the plan."""
    return any(step.stage.uses_device and not store.has(step.stage.name, step.key) for step in steps)


class _Device(Thread):
    """Looks for a device while the first stage works, whose artifact is not kept where none is found.

    No program waits for it to end: an interrupted import may keep it waiting for ever.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._fault: Exception | None = None

    def run(self) -> None:
        try:
            require_device()
        except Exception as error:
            self._fault = error

    def require(self) -> None:
        """Waits for the search and raises its error."""
        self.join()
        if self._fault is not None:
            raise self._fault

    def largest_bytes(self) -> int:
        """Waits for the search; returns how many bytes the device holds in one array, or raises its error."""
        self.require()
        return default_device().largest_bytes

    def heeded(self, progress: Progress) -> Progress:
        """Returns a function that reports progress, and raises the search's error as soon as it is known."""

        def report(step: str, done: float) -> None:
            if not self.is_alive():
                self.require()
            progress(step, done)

        return report


def require_memory(config: Config, steps: list[Step], store: Store, largest_buffer: int | None = None) -> None:
    """Raises ResourceError where a step that is to do needs more memory than is allowed, before it begins.

    Made artifacts tell the samples of a scan and the plan of a table; without them these are foreseen, as far as the
    config says.

    largest_buffer: bytes that the device holds in one array; None where no device was looked for.
    """
    to_do = [step.stage.name for step in steps if not store.has(step.stage.name, step.key)]
    if to_do:
        forecast.require_memory(config, summaries(steps, store), to_do, largest_buffer)


def fits(config: Config, steps: list[Step], store: Store, held_bytes: int) -> bool:
    """Says whether every step that is to do fits into memory beside objects of `held_bytes`, as far as is known."""
    needs, most = forecast.needs(config, summaries(steps, store)), resources.limit().bytes
    # configs before this one may have made artifacts since the plan
    to_do = [step.stage.name for step in steps if not store.has(step.stage.name, step.key)]
    return all(needs[name].bytes + held_bytes <= most for name in to_do if name in needs)


def summaries(steps: list[Step], store: Store) -> dict[str, Summary]:
    """Returns the summaries of those steps of a plan whose artifacts are in the store, by stage."""
    made = [step for step in steps if store.has(step.stage.name, step.key)]
    return {step.stage.name: store.describe(step.stage.name, step.key).summary for step in made}


def _make(
    config: Config, step: Step, inputs: Inputs, store: Store, progress: Progress, device: _Device | None
) -> None:
    """Makes the artifact of a step. device: the search for one, where a step of the run needs it."""
    stage = step.stage
    record: dict[str, Any] = {
        "name": config.name,
        "version": stage.version,
        "parameters": stage.parameters(config),
        "inputs": {name: artifact.key for name, artifact in inputs.artifacts.items()},
    }
    with store.create(stage.name, step.key, record) as (folder, whole):
        started = time.perf_counter()
        whole["summary"] = stage.produce(config, inputs, folder, device.heeded(progress) if device else progress)
        if device:
            device.require()
        whole["provenance"] = {
            **provenance.versions(),
            **(provenance.device() if stage.uses_device else {}),
            "seconds": round(time.perf_counter() - started, 3),
        }


def _latest(artifacts: list[Artifact], stage: str, name: str) -> Artifact | None:
    """Finds the artifact of a stage that was made or used last for a config of this name."""
    found = [a for a in artifacts if a.stage == stage and a.record.get("name") == name]
    return max(found, key=lambda a: (a.folder / "artifact.json").stat().st_mtime, default=None)


def _reason(stage: Stage, config: Config, made: set[str], last: Artifact | None) -> str:
    """Says why a step is to do: never made, changed settings, or an input that will be made."""
    inputs = sorted(made & set(stage.inputs))
    if last is None:
        return "not made before"
    if last.record.get("version") != stage.version:
        return f"the stage's version is now {stage.version}"
    changed = _changes(last.record.get("parameters"), stage.parameters(config))
    if changed:
        return f"changed: {', '.join(changed[:3])}" + (f" and {len(changed) - 3} more" if len(changed) > 3 else "")
    if inputs:
        return f"its input will be made: {', '.join(inputs)}"
    return "its input differs from the last one"


def _changes(before: Any, now: Any, path: str = "") -> list[str]:
    """Lists the key paths whose values differ, with both values where they are short."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = sorted(before.keys() | now.keys())
        return [c for k in keys for c in _changes(before.get(k), now.get(k), f"{path}.{k}" if path else k)]
    if before == now:
        return []
    values = f" {before} -> {now}"
    return [path + (values if len(values) < 40 else "")]
