"""Whole runs of the command line, each in a process of its own with a store of its own: what a user waits for."""

import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


class RunFailedError(RuntimeError):
    """A run ended with another exit code than 0; the message is its last line on stderr."""


@dataclass(frozen=True)
class Spent:
    """Seconds from a process's start to its end, and processor seconds of it and of what it started."""

    seconds: float
    cpu_s: float


@dataclass(frozen=True)
class CommandLine:
    """How the tool is started: the words before the name of a command."""

    words: Sequence[str]

    def run(self, config: Path, cache: Path | None = None, until: str | None = None) -> Spent:
        """What a run of a config takes with an empty store.

        cache: the user's cache folder, kernels included; None for his own. until: the last stage; None for all.
        Raises RunFailedError.
        """
        with tempfile.TemporaryDirectory() as folder:
            command = [*self.words, "run", str(config), "--store", f"{folder}/store", "--out", f"{folder}/out"]
            command += [] if until is None else ["--until", until]
            environment = dict(os.environ)
            if cache is not None:
                environment["XDG_CACHE_HOME"] = str(cache)
                # this process told PoCL where its own cache is
                environment.pop("POCL_CACHE_DIR", None)
            with tempfile.TemporaryFile("w+", encoding="utf-8") as told:
                started = time.perf_counter()
                process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=told, env=environment)
                # unlike getrusage, it tells of this child alone
                _, status, usage = os.wait4(process.pid, 0)
                seconds = time.perf_counter() - started
                process.returncode = os.waitstatus_to_exitcode(status)
                if process.returncode != 0:
                    told.seek(0)
                    raise RunFailedError(told.read().strip().rpartition("\n")[2])
        return Spent(seconds, usage.ru_utime + usage.ru_stime)
