"""Predictions of time, bytes and error of the stages before they begin, calibrated and corrected on this machine.

A stage states its operations from its sizes: `Need.seconds` is their time at the nominal rate of
`pipeline.resources`. What a stage does besides (imports, plots, small files) takes a constant time. Both, as fitted
on one machine, are scaled by the pace at which this machine does a fixed piece of work, and by what earlier runs of
the same stage took here. Pace and corrections are kept in the store, in a file per machine.
"""

import contextlib
import json
import math
import os
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

import numpy as np

from pipeline.resources import Need
from pipeline.store import digest, files
from pipeline.store.store import Store


@dataclass(frozen=True)
class _Fit:
    """Time of a stage as `fixed` + `factor` x Need.seconds, s, on the machine on which they were fitted."""

    fixed: float
    factor: float


# two cores of a server with AVX2; processor seconds over the number of cores that a stage keeps busy, from six bakes
# that no test repeats
_FITS = {
    "surface": _Fit(0.03, 0.95),
    "power_spectrum": _Fit(0.6, 1.4),
    "stack": _Fit(0.3, 1.0),
    "table": _Fit(0.3, 0.9),
    "textures": _Fit(0.01, 0.9),
    "render": _Fit(0.12, 1.25),
    "validate": _Fit(1.7, 0.65),
    "bundle": _Fit(0.03, 0.5),
}
_OTHER = _Fit(0.3, 1.0)
# processor seconds of `_piece_of_work` on that machine
_NOMINAL_S = 0.072
_REPEATS = 3
# a correction is the geometric mean of the last so many runs; a longer memory would keep what no longer holds
_REMEMBERED = 8
_LEAST, _MOST = 0.1, 10.0
_FOLDER, _FILE_BYTES = "costs", 2**16


@dataclass(frozen=True)
class Pace:
    """The speed of this machine: `pace`, its time for a fixed piece of work over that of the machine of the fits, and
    `ratios`, what the last runs of each stage took over what was predicted without them.
    """

    pace: float = 1.0
    ratios: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def seconds(self, stage: str, need: Need) -> float:
        """Predicts the time of a stage, s."""
        ratios = self.ratios.get(stage, ())
        learned = math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else 1.0
        return learned * self._unlearned_s(stage, need)

    def learned(self, stage: str, need: Need, seconds: float) -> "Pace":
        """Returns the machine that also knows of a run of a stage, which took `seconds`."""
        ratio = min(_MOST, max(_LEAST, seconds / self._unlearned_s(stage, need)))
        latest = (*self.ratios.get(stage, ()), ratio)[-_REMEMBERED:]
        return Pace(self.pace, {**self.ratios, stage: latest})

    def _unlearned_s(self, stage: str, need: Need) -> float:
        if not need.arrays:
            return 0.01
        fit = _FITS.get(stage, _OTHER)
        return self.pace * (fit.fixed + fit.factor * need.seconds)


def machine(store: Store) -> Pace:
    """Returns what the store knows of this machine; else measures its pace, in half a second, and keeps that."""
    found = _read(store)
    if found is None:
        found = Pace(pace=_pace())
        keep(found, store)
    return found


def keep(known: Pace, store: Store) -> None:
    """Writes what is known of this machine; a store that cannot be written keeps nothing."""
    path = _path(store)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(f".{os.getpid()}")
        partial.write_text(json.dumps({"pace": known.pace, "ratios": dict(known.ratios)}), encoding="utf-8")
        partial.replace(path)


def _read(store: Store) -> Pace | None:
    """Reads what the store knows of this machine; None where there is nothing that could be."""
    try:
        document = json.loads(files.read_text(_path(store), _FILE_BYTES))
        ratios = {str(stage): tuple(map(float, values)) for stage, values in document["ratios"].items()}
        found = Pace(float(document["pace"]), ratios)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    numbers = [found.pace, *(ratio for values in ratios.values() for ratio in values)]
    return found if all(_LEAST / 10 <= number <= _MOST * 10 for number in numbers) else None


def _path(store: Store) -> Path:
    machine = [platform.node(), platform.machine(), os.cpu_count(), os.environ.get("DIFFRACT_BAKE_DEVICE")]
    return store.root / _FOLDER / f"{digest.of_json(machine)[:16]}.json"


def _pace() -> float:
    """Measures the time of a fixed piece of work over its nominal time: processor time, which others disturb less."""
    return max(_LEAST, min(_MOST, min(_piece_of_work() for _ in range(_REPEATS)) / _NOMINAL_S))


def _piece_of_work() -> float:
    """Does what stages do beside kernels: transforms, functions, hashing, Python. Returns processor seconds."""
    started = time.thread_time()
    values = np.linspace(0.0, 1.0, 512 * 512).reshape(512, 512)
    for _ in range(4):
        np.fft.rfft2(values)
        np.exp(1j * values)
    sha256(bytes(2**22)).digest()
    counts: dict[int, int] = {}
    for i in range(100_000):
        counts[i % 97] = counts.get(i % 97, 0) + i
    return time.thread_time() - started
