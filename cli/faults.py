"""Errors as lines for people, and exit codes."""

import errno
import os
import sys

from cli import console
from pipeline.errors import BakeError, ResourceError, StorageError
from pipeline.store.store import FULL


def explained(error: Exception) -> tuple[int, list[str]]:
    """Returns the exit code of an error and the lines that explain it.

    Raises the error again where it is an internal fault and DIFFRACT_BAKE_DEBUG is set.
    """
    if isinstance(error, BakeError):
        return error.exit_code, list(error.lines)
    if isinstance(error, OSError) and error.errno in FULL:
        where = "stdout" if error.filename is None else error.filename
        remedy = "" if error.filename is None else "; free some, or choose another folder"
        return StorageError.exit_code, [f"{where}: no space left to write{remedy}"]
    if isinstance(error, MemoryError):
        # in spite of the prediction, or outside of a bake
        text = " ".join(str(error).split()) or "no more can be had"
        remedy = "free some, or use smaller settings: `diffract-bake plan` shows what each stage needs"
        return ResourceError.exit_code, [f"out of memory: {text}; {remedy}"]
    if os.environ.get("DIFFRACT_BAKE_DEBUG"):
        raise error
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return 1, [f"internal fault, please report it: {text} (DIFFRACT_BAKE_DEBUG=1 shows the whole traceback)"]


def is_of_output(error: Exception) -> bool:
    """Says whether stdout or stderr refused output: the reader ended (as in `| head`), or the disk is full."""
    return isinstance(error, OSError) and error.filename is None and error.errno in (errno.EPIPE, *FULL)


def report(error: Exception) -> int:
    """Prints the lines of an error to stderr, and returns its exit code; 0 where the reader of stdout ended."""
    if is_of_output(error):
        # the buffered rest would fail again at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, OSError) and error.errno == errno.EPIPE:
            return 0
    code, lines = explained(error)
    for line in lines:
        console.note(f"error: {line}")
    return code
