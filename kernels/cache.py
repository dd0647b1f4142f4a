"""The cache of compiled kernels: one process at a time fills it."""

import hashlib
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from pathlib import Path

import platformdirs
from filelock import FileLock


class KernelCache:
    """PoCL's kernels on disk, with marks of what was compiled, and who is notified before something is."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []

    @cached_property
    def folder(self) -> Path:
        """Where compiled kernels are kept between processes; for this process alone where that cannot be written."""
        folder = Path(platformdirs.user_cache_dir("diffract-bake")) / "kernels"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with FileLock(folder / "lock"):
                pass
        except OSError:
            return Path(tempfile.mkdtemp(prefix="diffract-bake-kernels-"))
        return folder

    @contextmanager
    def announcing(self, announce: Callable[[], None]) -> Iterator[None]:
        """Call `announce` before each program or kernel that this machine has not compiled yet, while this lasts."""
        self._listeners.append(announce)
        try:
            yield
        finally:
            self._listeners.remove(announce)

    @contextmanager
    def compiling(self, identity: str) -> Iterator[None]:
        """Hold the cache alone: PoCL's fails at random when processes fill it together.

        identity: of the program or kernel. A mark in the folder records that it was compiled.
        """
        mark = self.folder / "compiled" / hashlib.sha256(identity.encode()).hexdigest()
        with FileLock(self.folder / "lock"):
            if mark.exists():
                yield
                return
            for announce in self._listeners:
                announce()
            yield
            with suppress(OSError):  # without its mark, the next process announces it once more
                mark.parent.mkdir(exist_ok=True)
                mark.touch()


@cache
def kernel_cache() -> KernelCache:
    """Return this process's cache of kernels."""
    return KernelCache()
