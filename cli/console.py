"""Functions that all commands share: options, progress on stderr, tables on stdout."""

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TextIO

import click

from pipeline.progress import Progress

# steps that last longer get a line
_REPORTED_AFTER_S = 1.0

# the process's own stderr, where `keep_stderr` has taken its place; None: sys.stderr
_messages: TextIO | None = None


def keep_stderr(foreign: int) -> None:
    """Keeps stderr for this module's lines: what libraries write there goes to the file descriptor `foreign`.

    Compilers and readers of images write to the descriptor, Python's warnings and loggers to sys.stderr.
    """
    global _messages
    if sys.stderr is not None:
        own = os.dup(sys.stderr.fileno())
        _messages = os.fdopen(own, "w", buffering=1, encoding=sys.stderr.encoding, errors="backslashreplace")
    os.dup2(foreign, 2)


def escaped(text: str) -> str:
    """Replaces what a terminal does not print as one character of a line: control and formatting characters.

    Names of files and messages of libraries hold whatever their authors put there.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)


def store_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds --store to a command."""
    return click.option(
        "--store",
        "store_root",
        type=click.Path(path_type=Path, file_okay=False),
        envvar="DIFFRACT_BAKE_STORE",
        show_envvar=True,
        help="Folder of cached artifacts [default: the user's cache].",
    )(command)


def memory_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds --memory to a command: the limit of what stages are predicted to need while the command runs."""
    return click.option(
        "--memory",
        metavar="SIZE",
        callback=_allow_memory,
        expose_value=False,
        help="Refuse stages that need more, as 4GiB [default: what the machine has left].",
    )(command)


def _allow_memory(context: click.Context, parameter: click.Parameter, text: str | None) -> None:
    if text is None:
        return
    from pipeline import resources

    try:
        context.with_resource(resources.allowing(resources.bytes_of(text)))
    except ValueError as error:
        raise click.BadParameter(str(error), context, parameter) from None


def json_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds --json to a command."""
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON document for machines.")(command)


def out_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds --out to a command."""
    return click.option(
        "--out",
        type=click.Path(path_type=Path, file_okay=False),
        default=Path("out"),
        show_default=True,
        help="Folder for results, with one subfolder per config.",
    )(command)


def open_store(root: Path | None) -> Any:
    """Opens the store at `root`, by default the user's."""
    from pipeline.store.store import Store, users_folder

    return Store(root or users_folder())


class FiniteNumber(click.ParamType[float]):
    """An option's type: a finite number from `low` to below `high`."""

    name = "number"

    def __init__(self, low: float, high: float = math.inf) -> None:
        self._low, self._high = low, high

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and self._low <= number < self._high):
            below = f" and below {self._high:g}" if math.isfinite(self._high) else ""
            self.fail(f"expected a finite number from {self._low:g}{below}, got {value!r}", param, ctx)
        return number


def print_json(value: Any) -> None:
    """Prints a JSON document to stdout."""
    click.echo(json.dumps(value, indent=1))


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Prints left-aligned columns to stdout, with their names as the first row."""
    table = [[escaped(str(cell)) for cell in row] for row in (columns, *rows)]
    widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
    for row in table:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
        say("  ".join(cells).rstrip())


def say(text: str) -> None:
    """Prints one line of a result to stdout."""
    click.echo(escaped(text))


def warn(text: str) -> None:
    """Prints a warning to stderr, as one line."""
    note(f"warning: {text}")


def note(text: str) -> None:
    """Prints one line to stderr: progress, or a message."""
    click.echo(escaped(text), file=_messages, err=True)


def usage_error(error: click.ClickException) -> None:
    """Prints a fault of the command line to stderr: usage, and the message as one line."""
    click.UsageError(escaped(error.format_message()), getattr(error, "ctx", None)).show(_messages)


def warning_reporter(config: Any, store: Any) -> Callable[[Any, float | None], None]:
    """Returns a callback for `run.execute` that prints the warnings of the surface stage."""

    def on_step(step: Any, seconds: float | None) -> None:  # noqa: ARG001
        if step.stage.name == "surface":
            for text in store.describe("surface", step.key).measured("warnings", list):
                warn(f"{config.name}: {text}")

    return on_step


def step_reporter(config: Any, store: Any) -> Callable[[Any, float | None], None]:
    """Returns a callback for `run.execute` that prints each step's run time, and warnings of the surface stage."""
    report_warnings = warning_reporter(config, store)

    def on_step(step: Any, seconds: float | None) -> None:
        note(f"  {step.stage.name:<14} " + ("cached" if seconds is None else f"{seconds:.1f} s"))
        report_warnings(step, seconds)

    return on_step


@contextmanager
def showing_progress() -> Iterator[Progress]:
    """Yields a progress callback: a bar on a terminal, else a line per long step. It reports compilation, too."""
    from kernels.cache import kernel_cache

    # functools' cache prints the line once, even if many kernels are compiled
    with kernel_cache().announcing(cache(lambda: note("  compiling kernels for this processor, once ..."))):
        # stderr is None where the process has none (2>&-)
        stream = _messages or sys.stderr
        if stream is not None and stream.isatty():
            with _bar() as progress:
                yield progress
        else:
            yield _Lines()


class _Lines:
    """A progress callback that prints one line for each step that takes longer than a second."""

    def __init__(self) -> None:
        self._started: dict[str, float] = {}

    def __call__(self, step: str, done: float) -> None:
        now = time.monotonic()
        started = self._started.setdefault(step, now)
        if done >= 1.0:
            del self._started[step]
        elif now - started > _REPORTED_AFTER_S:
            # once per step; a step that begins again is reported again
            self._started[step] = math.inf
            note(f"  {step}: {100 * done:.0f} % after {now - started:.0f} s ...")


@contextmanager
def _bar() -> Iterator[Progress]:
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, TaskID, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("  {task.description:<14}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Bars(*columns, TimeRemainingColumn(), console=Console(file=_messages, stderr=True), transient=True) as bars:
        tasks: dict[str, TaskID] = {}

        def progress(step: str, done: float) -> None:
            if step not in tasks:
                tasks[step] = bars.add_task(escape(escaped(step)), total=1.0)
            # a completed bar disappears at once, before the next line of text
            bars.update(tasks[step], completed=done, visible=done < 1.0, refresh=done >= 1.0)

        yield progress
