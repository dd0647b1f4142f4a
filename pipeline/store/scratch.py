"""Temporary folders, named after the process that writes them, so that those of killed processes can be removed."""

import contextlib
import os
import platform
import shutil
import tempfile
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import StorageError

_REPLACING = ".writing-"
# a file descriptor that receives the path of every folder that is made
_announced: int | None = None
_FOREIGN_ABANDONED_AFTER_S = 24 * 3600.0


def announce_to(descriptor: int) -> None:
    """Writes the path of every folder that this process makes to a file descriptor, followed by a zero byte.

    Whoever ends the process learns from it which folders to remove.
    """
    global _announced
    _announced = descriptor


def _announce(folder: Path) -> None:
    if _announced is not None:
        os.write(_announced, os.fsencode(folder.absolute()) + b"\0")


def make(parent: Path, prefix: str = "") -> Path:
    """Makes a new folder `<prefix><pid>@<host>-<random>` under `parent`.

    Its permissions follow the umask. mkdtemp's would hide the results from other users.
    """
    folder = parent / f"{prefix}{os.getpid()}@{platform.node()}-{uuid.uuid4().hex}"
    _announce(folder)
    folder.mkdir(parents=True)
    return folder


@contextlib.contextmanager
def temporary() -> Iterator[Path]:
    """Yields a folder among the system's temporary files, and removes it afterwards."""
    folder = make(Path(tempfile.gettempdir()), "diffract-bake-")
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def abandoned(folder: Path, prefix: str = "") -> bool:
    """Whether the process that wrote a folder has ended; on another machine, after a day without a change."""
    pid, _, rest = folder.name.removeprefix(prefix).partition("@")
    if rest.rpartition("-")[0] == platform.node() and pid.isdigit():
        return not _alive(int(pid))
    try:
        return time.time() - folder.stat().st_mtime > _FOREIGN_ABANDONED_AFTER_S
    except FileNotFoundError:
        return False


def remove_abandoned(parent: Path, prefix: str) -> None:
    """Removes the folders of processes that were killed, below `parent`."""
    for folder in parent.glob(f"{prefix}*"):
        if abandoned(folder, prefix):
            shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """Yields a temporary folder whose files are renamed into `folder`, one by one, if the block raises nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    remove_abandoned(folder, _REPLACING)
    scratch = make(folder, _REPLACING)
    try:
        yield scratch
        for file in sorted(scratch.iterdir()):
            file.replace(folder / file.name)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def require_folder(folder: Path) -> None:
    """Raises StorageError where a folder cannot be created or written, before any work; creates nothing."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not (existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)):
        raise StorageError(f"cannot create {folder}: {existing} is not a writable directory; choose another --out")


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # the process runs under another user
    return True
