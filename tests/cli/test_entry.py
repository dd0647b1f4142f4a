"""The supervisor: signals end a command wherever it is, with its children, and a crash is one line."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.tool import REPOSITORY, Tool

# takes the place of the command: prints a line, and then does what a test asks for
_COMMAND = """
import ctypes, os, signal, subprocess, sys, threading
from cli import main
from cli.entry import process
def work():
    print("at work", flush=True)
    {work}
main.main = work
process()
"""
# holds the interpreter's lock, as compilers and readers of files do
IN_C = "ctypes.PyDLL(None).sleep(30)"
IN_PYTHON = "threading.Event().wait(30)"
IN_A_CHILD = "subprocess.run([sys.executable, '-c', 'import time; print(1, flush=True); time.sleep(30)'])"


def start(work: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", _COMMAND.format(work=work)],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "at work\n"
    return process


@pytest.mark.alone
@pytest.mark.parametrize("work", [IN_C, IN_PYTHON, IN_A_CHILD])
@pytest.mark.parametrize(
    ("sent", "line"),
    [
        (signal.SIGINT, "interrupted; finished stages are kept\n"),
        (signal.SIGTERM, "terminated; finished stages are kept\n"),
    ],
)
def test_a_signal_ends_everything(work: str, sent: signal.Signals, line: str) -> None:
    with start(work) as process:
        if work == IN_A_CHILD:
            assert process.stdout is not None
            process.stdout.readline()
        started = time.monotonic()
        process.send_signal(sent)
        process.send_signal(sent)
        # a child that lived on would hold the pipes open
        _, stderr = process.communicate(timeout=20)
        took = time.monotonic() - started
    assert (process.returncode, stderr) == (128 + sent, line)
    assert took < 2.0


@pytest.mark.alone
def test_a_killed_supervisor_takes_the_command_with_it() -> None:
    with start(IN_C) as process:
        process.kill()
        # a command that lived on would hold the pipes open
        process.communicate(timeout=2.0)
    assert process.returncode == -signal.SIGKILL


@pytest.mark.parametrize("sent", [signal.SIGHUP, signal.SIGINT])
def test_signals_that_the_caller_ignores(sent: signal.Signals) -> None:
    """As nohup and the background jobs of scripts do: the terminal's end is ignored, an interrupt is not."""
    before = signal.signal(sent, signal.SIG_IGN)
    try:
        process = start("threading.Event().wait(1)")
    finally:
        signal.signal(sent, before)
    with process:
        process.send_signal(sent)
        process.communicate(timeout=20)
    assert process.returncode == (0 if sent == signal.SIGHUP else 130)


@pytest.mark.parametrize(
    ("work", "code", "line"),
    [
        ("os.abort()", 1, "error: internal fault, please report it: SIGABRT ended the process\n"),
        ("os.kill(os.getpid(), signal.SIGKILL)", 1, "error: SIGKILL ended the process; the system does that where "),
        (
            "os.write(2, b'LLVM \\x1b[1mERROR\\n'); os._exit(1)",
            1,
            "error: internal fault, please report it: a library ended the process: LLVM \\x1b[1mERROR\n",
        ),
        (
            "os.write(2, b'IO failure on output stream: No space left on device\\n'); os._exit(1)",
            7,
            "error: no space left to write; free some (IO failure on output stream: No space left on device)\n",
        ),
    ],
)
def test_a_crash_is_one_line(work: str, code: int, line: str) -> None:
    with start(work) as process:
        _, stderr = process.communicate(timeout=20)
    assert process.returncode == code
    assert stderr.startswith(line)
    assert stderr.count("\n") == 1


def test_lines_of_libraries_do_not_reach_stderr() -> None:
    lines = "import logging, warnings; warnings.warn('one'); logging.error('two'); os.write(2, b'three')"
    with start(lines) as process:
        assert process.communicate(timeout=20)[1] == ""
    assert process.returncode == 0


@pytest.mark.parametrize("name", ["a\nb.gwy", "\x1b]0;title\x07.npy", "\x9b31m.npy", "\u202egpj.npy"])
def test_names_of_files_are_escaped(tool: Tool, name: str) -> None:
    (tool.folder / name).write_bytes(b"no scan")
    (tool.folder / (name + ".toml")).write_text("name = 1", encoding="utf-8")
    for command in ("inspect", "run"):
        for file in (name, name + ".toml", name + "absent"):
            result = tool(command, file)
            assert result.code in (2, 3)
            assert all(line.isprintable() for line in result.stderr.split("\n"))
            lines = result.stderr.splitlines()
            assert result.errors == lines or (lines[0].startswith("Usage: ") and len(lines) == 4)


def test_children_of_bench_import_nothing_from_the_working_folder(tmp_path: Path) -> None:
    from cli import bench

    (tmp_path / "cli").mkdir()
    (tmp_path / "cli" / "entry.py").write_text("def process(): print('planted')", encoding="utf-8")
    words = [*bench.COMMAND_LINE, "--version"]
    done = subprocess.run(words, cwd=tmp_path, env={**os.environ}, capture_output=True, text=True, check=True)
    assert "planted" not in done.stdout
