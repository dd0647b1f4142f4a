"""Killed at any moment, a run leaves nothing that a later one trusts wrongly; two at once do the work once."""

import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.cli.tool import Tool, leavings

STAGES = ["surface", "stack", "table", "render", "validate"]

# counts what changes the disk and kills its own process at one of them
KILLED_AT = """
import os, signal, sys
left = {count}
def hook(event, arguments):
    global left
    if event in ("os.mkdir", "os.rename", "os.remove", "os.utime", "shutil.copyfile") or (
        event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
    ):
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(hook)
import atexit
atexit.register(lambda: print("events:", {count} - left, file=sys.stderr))
"""


def test_killed_after_every_stage_and_in_between(baked: Tool, tool: Tool) -> None:
    """Each run is killed as its first stage is done, or so many seconds after its start."""
    config = tool.config()
    for stage in STAGES:
        with tool.start("run", config) as process:
            assert process.stderr is not None
            for line in process.stderr:
                if re.match(rf"  {stage} ", line):
                    break
            process.kill()
        assert stage in tool.artifacts()
    assert_ends_as(baked, tool)


def test_killed_at_moments_spread_over_the_run(baked: Tool, tool: Tool) -> None:
    config, delay, killed = tool.config(), 0.5, 0
    while True:
        with tool.start("run", config) as process:
            try:
                process.communicate(timeout=delay)
            except subprocess.TimeoutExpired:
                process.kill()
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL
        killed, delay = killed + 1, delay * 1.6
    assert killed >= 3
    assert_ends_as(baked, tool)


def test_killed_while_results_are_laid_out_and_published(baked: Tool, copy: Tool) -> None:
    shutil.rmtree(copy.out)
    whole = copy.process("run", "small.toml", wrapper=KILLED_AT.format(count=10**9))
    assert whole.code == 0, whole.stderr
    found = re.search(r"events: (\d+)", whole.stderr)
    assert found is not None
    events = int(found[1])
    assert events > 25
    shutil.rmtree(copy.out)
    seen = 0
    for share in (0.08, 0.16, 0.24, 0.5, 0.6, 0.8, 0.9, 0.97, 1.0):
        result = copy.process("run", "small.toml", wrapper=KILLED_AT.format(count=max(1, int(share * events))))
        assert result.code in (0, -signal.SIGKILL), result.stderr
        seen += result.code != 0
        for bundle in copy.out.glob("small/small-*"):
            assert copy("verify", bundle).code == 0
    assert seen >= 5
    assert_ends_as(baked, copy)


def assert_ends_as(undisturbed: Tool, tool: Tool) -> None:
    """One more run makes what an undisturbed one did, and the leavings go."""
    result = tool.process("run", "small.toml")
    assert result.code == 0, result.stderr
    assert tool.artifacts() == undisturbed.artifacts()
    assert tool.bundle().name == undisturbed.bundle().name
    assert tool("verify", tool.bundle()).code == 0
    assert tool("store", "check").code == 0
    shown = sorted(path.name for path in (undisturbed.out / "small").iterdir())
    assert sorted(path.name for path in (tool.out / "small").iterdir()) == shown
    for name in shown[:3]:
        assert (tool.out / "small" / name).read_bytes() == (undisturbed.out / "small" / name).read_bytes()
    assert tool("store", "collect").code == 0
    assert leavings(tool) == []


def test_interrupted_by_the_keyboard(tool: Tool) -> None:
    with tool.start("run", tool.config()) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("  table"):
                break
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert stderr.splitlines()[-1] == "interrupted; finished stages are kept"
    assert "Traceback" not in stderr
    assert list(tool.artifacts()) == ["render", "stack", "surface", "table"]
    assert leavings(tool) == []


@pytest.mark.parametrize("outs", [("out", "out"), ("one", "two")], ids=["one folder", "two folders"])
def test_two_runs_at_once_share_the_work(baked: Tool, tool: Tool, outs: tuple[str, str]) -> None:
    config = tool.config()
    both = [tool.start("run", config, "--out", out) for out in outs]
    told = []
    for process in both:
        with process:
            told.append(process.communicate(timeout=120)[1])
    assert [process.returncode for process in both] == [0, 0], told
    for stage in STAGES:
        # made by one of them, cached for the other
        lines = [line for text in told for line in text.splitlines() if re.match(rf"  {stage} ", line)]
        assert sorted("cached" in line for line in lines) == [False, True], stage
    assert tool.artifacts() == baked.artifacts()
    assert leavings(tool) == []
    for out in {*outs}:
        assert bundles(tool.folder / out) == [baked.bundle().name]
    assert tool("store", "check").code == 0


def bundles(out: Path) -> list[str]:
    return [path.name for path in (out / "small").glob("small-*")]
