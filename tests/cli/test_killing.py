"""Killed at any moment, a run leaves nothing that a later one trusts wrongly; two at once do the work once."""

import re
import shutil
import signal
from pathlib import Path

import pytest

from tests.cli import kills
from tests.cli.tool import Tool, temporary_files
from tests.support import killed_at

STAGES = ["surface", "stack", "table", "textures", "render", "validate"]

pytestmark = [pytest.mark.slow, pytest.mark.long]

# a signal once validation is at work and has a file in its folder
SIGNALLED = """
import os, signal
from cli.entry import process
from pipeline.stages import validate
produce = validate._produce
def interrupted(config, inputs, folder, progress):
    (folder / "half.txt").write_text("half")
    def tell(step, done):
        os.kill(os.getppid(), signal.{name})
        progress(step, done)
    return produce(config, inputs, folder, tell)
validate._produce = interrupted
process()
"""


def test_killed_after_every_stage(baked: Tool, tool: Tool) -> None:
    """Each run is killed as its first stage is done."""
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
    """Each run gets further into what the ones before have left to do, until one comes to its end."""
    config, count, stood = tool.config(), 30, []
    while (result := tool.process("run", config, wrapper=killed_at(count))).code != 0:
        assert result.code == -signal.SIGKILL, result.stderr
        stood.append(len(tool.artifacts()))
        count += 30
    # before anything was made, and with more and more of it
    assert stood == sorted(stood)
    assert len({*stood}) >= 3
    assert_ends_as(baked, tool)


def test_killed_while_results_are_laid_out_and_published(baked: Tool, copy: Tool) -> None:
    shutil.rmtree(copy.out)
    whole = copy.process("run", "small.toml", wrapper=killed_at(10**9))
    assert whole.code == 0, whole.stderr
    found = re.search(r"changes: (\d+)", whole.stderr)
    assert found is not None
    changes = int(found[1])
    assert changes > 25
    shutil.rmtree(copy.out)
    seen = 0
    for share in (0.08, 0.16, 0.24, 0.5, 0.6, 0.8, 0.9, 0.97, 1.0):
        result = copy.process("run", "small.toml", wrapper=killed_at(max(1, int(share * changes))))
        assert result.code in (0, -signal.SIGKILL), result.stderr
        seen += result.code != 0
        for bundle in copy.out.glob("small/small-*"):
            assert copy("verify", bundle).code == 0
    assert seen >= 5
    assert_ends_as(baked, copy)


def assert_ends_as(undisturbed: Tool, tool: Tool) -> None:
    """One more run makes what an undisturbed one did, and removes the temporary files."""
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
    assert temporary_files(tool) == []


@pytest.mark.parametrize(("name", "code", "word"), [("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")])
def test_signalled_at_work(tool: Tool, name: str, code: int, word: str) -> None:
    result = tool.process("run", tool.config(), wrapper=SIGNALLED.format(name=name))
    assert result.code == code
    assert result.stderr.splitlines()[-1] == f"{word}; finished stages are kept"
    assert "Traceback" not in result.stderr
    assert list(tool.artifacts()) == ["render", "stack", "surface", "table", "textures"]
    assert temporary_files(tool) == []


@pytest.mark.parametrize("outs", [("out", "out"), ("one", "two")], ids=["one folder", "two folders"])
def test_two_runs_at_once_share_the_work(baked: Tool, tool: Tool, outs: tuple[str, str]) -> None:
    config = tool.config()
    both = [tool.start("run", config, "--out", out) for out in outs]
    printed = []
    for process in both:
        with process:
            printed.append(process.communicate(timeout=120)[1])
    assert [process.returncode for process in both] == [0, 0], printed
    for stage in STAGES:
        # made by one of them, cached for the other
        lines = [line for text in printed for line in text.splitlines() if re.match(rf"  {stage} ", line)]
        assert sorted("cached" in line for line in lines) == [False, True], stage
    assert tool.artifacts() == baked.artifacts()
    assert temporary_files(tool) == []
    for out in {*outs}:
        assert bundles(tool.folder / out) == [baked.bundle().name]
    assert tool("store", "check").code == 0


@pytest.mark.alone
def test_a_few_of_the_kills_of_make_kills(tmp_path: Path) -> None:
    counts = kills.Counts()
    kills.sweep(tmp_path, kills=2, seed=5, longest_s=3.0, counts=counts)
    for sent in (signal.SIGINT, signal.SIGTERM):
        kills.interrupts(tmp_path, 3, sent, 1.0, counts)
    assert counts.faults == []


def bundles(out: Path) -> list[str]:
    return [path.name for path in (out / "small").glob("small-*")]
