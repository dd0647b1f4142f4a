"""A seeded sweep of signals over runs: `make kills`. Stores that runs were killed in give the undisturbed results.

Each store is cold or has warm kernels, and its config is polar or Taylor. Up to three runs are ended in it by KILL,
TERM or INT at a random moment; then one more run must make the artifacts, the bundle and the maps of an undisturbed
run, and leave no temporary files. Interrupts are spread over the first seconds of runs, and each must end its run
within two seconds, with its exit code and one line.
"""

import argparse
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.cli.tool import SMALL, Tool, temporary_files, toml

# seconds from a signal to the end of the run
ENDS_WITHIN_S = 2.0
LINES = {
    signal.SIGINT: "interrupted; finished stages are kept",
    signal.SIGTERM: "terminated; finished stages are kept",
}
LAYOUTS = {"taylor": {"layout": "taylor", "resolution": 41}, "polar": {"layout": "polar"}}


def write_config(tool: Tool, layout: str) -> Path:
    """Writes the small config with a layout, and gives its path."""
    path = tool.folder / "small.toml"
    path.write_text(toml({**SMALL, "table": LAYOUTS[layout]}), encoding="utf-8")
    return path


@dataclass
class Counts:
    """Counts of a sweep: endings of signalled runs by kind, and faults, one line each."""

    ended: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    slowest_s: float = 0.0


def signalled(tool: Tool, config: Path, sent: signal.Signals, after_s: float, cache: Path, counts: Counts) -> None:
    """Sends a signal to a run `after_s` seconds after its start, and counts its ending."""
    before, finished = temporary_files(tool), True
    with tool.start("run", config, environment={"XDG_CACHE_HOME": str(cache)}) as process:
        try:
            process.wait(after_s)
        except subprocess.TimeoutExpired:
            finished = False
            process.send_signal(sent)
        sent_at = time.monotonic()
        try:
            _, stderr = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            counts.faults.append(f"{sent.name} after {after_s:.3f} s: did not end within 60 s")
            return
    took, code = time.monotonic() - sent_at, process.returncode
    counts.slowest_s = max(counts.slowest_s, took)
    if took > ENDS_WITHIN_S and code != 0:
        counts.faults.append(f"{sent.name} after {after_s:.3f} s: {took:.1f} s until its end")
    lines = stderr.splitlines()
    if code == 0 and (finished or took < 0.2):
        counts.ended["had finished"] += 1
    elif (sent == signal.SIGKILL and code == -sent) or (
        code == 128 + sent and lines and lines[-1] == LINES[sent] and "Traceback" not in stderr
    ):
        counts.ended[sent.name] += 1
    elif code == -sent and not lines:
        # the interpreter had not installed its handler
        counts.ended[f"{sent.name} before the interpreter ran"] += 1
    elif "in process\n" not in stderr and "KeyboardInterrupt" in stderr and after_s < 0.5:
        # before the first instruction of cli/entry.py's function
        counts.ended[f"{sent.name} while the interpreter started"] += 1
    else:
        counts.faults.append(f"{sent.name} after {after_s:.3f} s: exit code {code}, {took:.1f} s, {stderr[-300:]!r}")
    left = [path for path in temporary_files(tool) if path not in before]
    if sent != signal.SIGKILL and left:
        counts.faults.append(f"{sent.name} after {after_s:.3f} s leaves {left}")


def results(tool: Tool) -> dict[str, object]:
    """The addresses of all artifacts, the bundle's name, and the files laid out."""
    shown = tool.out / "small"
    return {
        "artifacts": tool.artifacts(),
        "bundle": tool.bundle().name,
        "files": {path.name: path.read_bytes() for path in sorted(shown.iterdir()) if path.is_file()},
    }


def undisturbed(folder: Path, layout: str, cache: Path) -> dict[str, object]:
    """The results of a run that nothing disturbs, which also fills the kernel cache."""
    tool = Tool(folder, folder / "store")
    folder.mkdir()
    done = tool.process("run", write_config(tool, layout), environment={"XDG_CACHE_HOME": str(cache)})
    assert done.code == 0, done.stderr
    return results(tool)


def sweep(folder: Path, kills: int, seed: int, longest_s: float, counts: Counts) -> int:
    """Kills runs and compares the next run's results with the undisturbed ones; returns the number of stores."""
    chance, warm, expected = random.Random(seed), folder / "warm", {}
    for layout in LAYOUTS:
        expected[layout] = undisturbed(folder / layout, layout, warm)
    stores = 0
    while kills > 0:
        place = folder / f"store{stores}"
        place.mkdir()
        tool, layout = Tool(place, place / "store"), chance.choice(list(LAYOUTS))
        cache = warm
        if chance.random() < 0.3:
            # cold kernels; FFTW's plans are kept, because others give a Taylor stack other last bits
            cache = place / "cache"
            shutil.copytree(warm, cache, ignore=shutil.ignore_patterns("kernels"))
        config = write_config(tool, layout)
        for _ in range(min(kills, chance.randint(1, 3))):
            sent = chance.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT))
            signalled(tool, config, sent, chance.uniform(0.0, longest_s), cache, counts)
            kills -= 1
        done = tool.process("run", config, environment={"XDG_CACHE_HOME": str(cache)})
        if done.code != 0 or results(tool) != expected[layout]:
            counts.faults.append(f"store {stores} ({layout}): the next run differs: {done.code} {done.stderr[-300:]}")
        elif tool("store", "check").code != 0 or tool("verify", tool.bundle()).code != 0:
            counts.faults.append(f"store {stores} ({layout}): damaged")
        elif tool("store", "collect").code != 0 or temporary_files(tool):
            counts.faults.append(f"store {stores} ({layout}): leaves {temporary_files(tool)}")
        shutil.rmtree(place)
        stores += 1
        print(f"store {stores}: {dict(counts.ended)}, {len(counts.faults)} faults", file=sys.stderr)
    return stores


def interrupts(folder: Path, count: int, sent: signal.Signals, within_s: float, counts: Counts) -> None:
    """Sends a signal to `count` runs, at moments spread evenly over the first `within_s` seconds."""
    cache = folder / "warm"
    for i in range(count):
        place = folder / f"{sent.name}{i}"
        place.mkdir()
        tool = Tool(place, place / "store")
        signalled(tool, tool.config(), sent, within_s * (i + 0.5) / count, cache, counts)
        shutil.rmtree(place)
    print(f"{sent.name}: {dict(counts.ended)}, {len(counts.faults)} faults", file=sys.stderr)


def main() -> int:
    """Runs the sweep and prints its counts; returns 1 where there were faults."""
    # a shell's background job ignores interrupts, and so would the runs until their first instruction
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--interrupts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--longest", type=float, default=6.0, help="latest moment of a kill, s after the start")
    given = parser.parse_args()
    killed, spread = Counts(), Counts()
    with tempfile.TemporaryDirectory() as folder:
        stores = sweep(Path(folder), given.kills, given.seed, given.longest, killed)
        interrupts(Path(folder), given.interrupts, signal.SIGINT, 3.0, spread)
    print(f"{given.kills} kills in {stores} stores, whose next runs were compared: {dict(killed.ended)}")
    print(f"{given.interrupts} interrupts over the first 3 s: {dict(spread.ended)}")
    print(
        f"slowest ending: {max(killed.slowest_s, spread.slowest_s):.2f} s; limit {ENDS_WITHIN_S} s on a quiet machine"
    )
    for fault in (*killed.faults, *spread.faults):
        print(f"fault: {fault}")
    return int(bool(killed.faults or spread.faults))


if __name__ == "__main__":
    sys.exit(main())
