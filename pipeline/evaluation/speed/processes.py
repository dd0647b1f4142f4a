"""Whole runs of the command line, each in a process and a store of its own: warm runs, and the cost of compiling."""

import os
import shutil
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from pipeline.progress import Progress, silent
from pipeline.store import scratch
from pipeline.store.store import Store

# a first config, and one of other terms, nodes in s, terms in |w| and window reach
_FIRST = '[surface]\nrecipe = { kind = "blazed", period_um = 2.5, height_um = 0.25 }\n'
_NEXT = """\
[surface]
recipe = { kind = "elaphe", height_um = 0.8, size_um = 40 }
[coherence]
sigma_um = 6
[accuracy]
delta_e = 0.5
"""
# as configs/elaphe.toml and configs/xenopeltis.toml
_FIRST_BAKE = """\
[surface]
recipe = { kind = "elaphe", across_um = 1.144, height_um = 0.37, seed = 1 }
[render]
lights = [{ theta_deg = 0 }, { theta_deg = 30, phi_deg = 180 }]
"""
_SECOND_BAKE = """\
[surface]
recipe = { kind = "xenopeltis", across_um = 0.55, along_um = 1.55, height_um = 0.3, seed = 1 }
[render]
lights = [{ theta_deg = 0 }, { theta_deg = 20 }]
"""
_WHOLE_RUNS = 6


class RunFailedError(RuntimeError):
    """A run ended with another exit code than 0; the message is its last line on stderr."""


@dataclass(frozen=True)
class Spent:
    """What a process took from its start to its end.

    seconds: on the clock. cpu_s: processor seconds of it and of its children. stages: seconds of each stage, in
    order; the rest of `seconds` is the start of the process, imports and digests of artifacts.
    """

    seconds: float
    cpu_s: float
    stages: Mapping[str, float]

    def __str__(self) -> str:
        """Names the seconds of every part."""
        rest = self.seconds - sum(self.stages.values())
        parts = [*self.stages.items(), ("start, imports and digests", rest)]
        told = " + ".join(f"{name} {seconds:.2f}" for name, seconds in parts)
        return f"{told} s; {self.cpu_s:.2f} s of processors"


def run(words: Sequence[str], configs: Sequence[Path], cache: Path | None = None, until: str | None = None) -> Spent:
    """Run configs with an empty store.

    words: those that start the tool, before the name of a command. cache: folder of caches, kernels included; None
    for the user's own. until: the last stage; None for all. Raises RunFailedError.
    """
    environment = dict(os.environ) if cache is None else {**os.environ, "XDG_CACHE_HOME": str(cache)}
    with scratch.temporary() as folder:
        command = [*words, "run", *map(str, configs), "--store", f"{folder}/store", "--out", f"{folder}/out"]
        command += [] if until is None else ["--until", until]
        before, started = getrusage(RUSAGE_CHILDREN), time.perf_counter()
        ended = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment, text=True)
        seconds, after = time.perf_counter() - started, getrusage(RUSAGE_CHILDREN)
        made = sorted(Store(folder / "store").artifacts(), key=lambda artifact: len(artifact.record["inputs"]))
    if ended.returncode != 0:
        raise RunFailedError(ended.stderr.strip().rpartition("\n")[2])
    stages = {artifact.stage: artifact.record["provenance"]["seconds"] for artifact in made}
    return Spent(seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, stages)


def write_config(folder: Path, name: str, text: str) -> Path:
    """Write a config of a name, its other keys and sections as `text`, and return its path."""
    path = folder / f"{name}.toml"
    path.write_text(f'name = "{name}"\n{text}', encoding="utf-8")
    return path


def warm_run(command_line: Sequence[str], config: Path, progress: Progress = silent) -> Spent:
    """Run `run --until table` with an empty store and warm kernels, and return the fastest of five.

    One more run, the first, fills the kernel cache. Raises RunFailedError.
    """
    runs = []
    for i in range(_WHOLE_RUNS):
        runs.append(run(command_line, [config], until="table"))
        progress("whole runs", (i + 1) / _WHOLE_RUNS)
    return min(runs[1:], key=lambda each: each.seconds)


@dataclass(frozen=True)
class Compiling:
    """Costs on a machine whose kernel cache is empty.

    first_s, next_s: processor seconds that compiling adds to the first `run --until table`, and to the next of other
    terms, nodes and reach. first_bake_s, second_bake_s: seconds of a whole first run, kernels compiled within it, and
    of a second surface's.
    """

    first_s: float
    next_s: float
    first_bake_s: float
    second_bake_s: float


def measure_compiling(command_line: Sequence[str], progress: Progress = silent) -> Compiling:
    """Measure compiling: processor time of a run with cold kernels less that with warm ones.

    Raises RunFailedError.
    """
    with scratch.temporary() as folder:
        root, cache, done = folder, folder / "cache", iter(range(1, 9))
        first, other = write_config(root, "first", _FIRST), write_config(root, "next", _NEXT)

        def cpu_s(path: Path) -> float:
            spent = run(command_line, [path], cache, until="table").cpu_s
            progress("compiling", next(done) / 8.0)
            return spent

        def forget_kernels() -> None:
            shutil.rmtree(cache / "diffract-bake" / "kernels", ignore_errors=True)

        def cold_s(path: Path) -> float:
            forget_kernels()
            return cpu_s(path)

        # the first run fills all other caches; other processes only add
        cpu_s(first)
        cold = min(cold_s(first), cold_s(first))
        warm = min(cpu_s(first), cpu_s(first))
        cold_next = cpu_s(other)
        warm_next = min(cpu_s(other), cpu_s(other))
        forget_kernels()
        bakes = [
            run(command_line, [write_config(root, name, text)], cache).seconds
            for name, text in (("elaphe", _FIRST_BAKE), ("xenopeltis", _SECOND_BAKE))
        ]
    return Compiling(cold - warm, max(cold_next - warm_next, 0.0), *bakes)
