"""Seconds and peak memory of every stage of a bake, in a process of its own and an empty store.

As a script it is that process; its arguments are a config as JSON, the last stage, and the folder of the store.
"""

import json
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from pipeline import resources
from pipeline.config.models import Config
from pipeline.evaluation.speed.processes import RunFailedError
from pipeline.stages import forecast, run
from pipeline.store import scratch
from pipeline.store.store import Store


@dataclass(frozen=True)
class StageCost:
    """The cost of one stage.

    seconds: of the stage with its artifact. predicted_bytes: what it was predicted to need. peak_bytes: the most
    memory that the process held during it. children_bytes: of the processes that it has started so far, the most that
    one held.
    """

    stage: str
    seconds: float
    predicted_bytes: int
    peak_bytes: int
    children_bytes: int


@dataclass(frozen=True)
class BakeCost:
    """The seconds of a process from its start to its end, and the costs of its stages in order."""

    seconds: float
    stages: tuple[StageCost, ...]

    @property
    def stages_s(self) -> float:
        """Seconds of all stages."""
        return sum(stage.seconds for stage in self.stages)

    @property
    def peak_bytes(self) -> int:
        """The most memory that the process held in a stage."""
        return max(stage.peak_bytes for stage in self.stages)

    def stage(self, name: str) -> StageCost:
        """Return the cost of a stage."""
        return next(stage for stage in self.stages if stage.stage == name)


def measure(config: Config, until: str) -> BakeCost:
    """Bake a config up to a stage in another process. Raises RunFailedError."""
    # -P: nothing is imported from the working folder
    module = [sys.executable, "-P", "-m", "pipeline.evaluation.speed.stage_costs"]
    with scratch.temporary() as folder:
        command, started = [*module, config.model_dump_json(), until, str(folder)], time.perf_counter()
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        seconds = time.perf_counter() - started
    if finished.returncode != 0:
        raise RunFailedError(finished.stderr.strip().rpartition("\n")[2])
    return BakeCost(seconds, tuple(StageCost(**each) for each in json.loads(finished.stdout)))


def _bake(config: Config, until: str, store: Store) -> list[StageCost]:
    steps, found = run.plan(config, store, until), []
    predicted = dict(forecast.needs(config, {}))

    def on_step(step: run.Step, seconds: float | None) -> None:
        name, peak = step.stage.name, resources.peak_bytes()
        # nothing is known of a scan until it is read. What follows the search for a grid is predicted from the grid
        # that was found, and so is the search itself
        if not predicted or name == "power_spectrum":
            predicted.update(forecast.needs(config, run.summaries(steps, store)))
        children = 1024 * getrusage(RUSAGE_CHILDREN).ru_maxrss
        found.append(StageCost(name, seconds or 0.0, predicted[name].bytes, peak, children))
        resources.forget_peak()

    resources.forget_peak()
    run.execute(config, steps, store, on_step=on_step)
    return found


if __name__ == "__main__":
    costs = _bake(Config.model_validate_json(sys.argv[1]), sys.argv[2], Store(Path(sys.argv[3])))
    print(json.dumps([asdict(cost) for cost in costs]))
