"""Folders being written, named after their writer: a killed run's leavings are told from work in progress."""

import os
import platform
import time
import uuid
from pathlib import Path

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


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
