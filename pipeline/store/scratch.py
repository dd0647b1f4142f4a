"""Folders being written, named after their writer: a killed run's leavings are told from work in progress."""

import contextlib
import os
import platform
import shutil
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import StorageError

_REPLACING = ".writing-"
_FOREIGN_ABANDONED_AFTER_S = 24 * 3600.0


def make(parent: Path, prefix: str = "") -> Path:
    """A new folder `<prefix><pid>@<host>-<random>` under `parent`.

    Not mkdtemp's, which would hide what it becomes from other users: the umask decides who reads it.
    """
    folder = parent / f"{prefix}{os.getpid()}@{platform.node()}-{uuid.uuid4().hex}"
    folder.mkdir(parents=True)
    return folder


def abandoned(folder: Path, prefix: str = "") -> bool:
    """Whether the folder's writer is gone; one on another machine counts as gone after a day without a change."""
    pid, _, rest = folder.name.removeprefix(prefix).partition("@")
    if rest.rpartition("-")[0] == platform.node() and pid.isdigit():
        return not _alive(int(pid))
    try:
        return time.time() - folder.stat().st_mtime > _FOREIGN_ABANDONED_AFTER_S
    except FileNotFoundError:
        return False


def remove_abandoned(parent: Path, prefix: str) -> None:
    """What killed runs left under `parent`."""
    for folder in parent.glob(f"{prefix}*"):
        if abandoned(folder, prefix):
            shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """A scratch folder whose files take their places in `folder`, each by one rename, when it is left unharmed."""
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
    """Better told before the work than after it, and nothing is made yet. Raises StorageError."""
    standing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not (standing.is_dir() and os.access(standing, os.W_OK | os.X_OK)):
        raise StorageError(f"{folder}: cannot be written, for {standing} is no folder to write in; see --out")


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass  # it is somebody else's, and alive
    return True
