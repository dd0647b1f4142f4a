"""The cache of compiled kernels: one process at a time fills it, and every file is checked before it is used.

    <folder>/lock           held while a process compiles or loads a program or a kernel
    <folder>/compiled/...   one record per program or kernel: the files that compiling it made, with their digests
    <folder>/...            PoCL's files: program.bc of each program, a shared object of each kernel

PoCL loads what it finds there unchecked and does not sync what it writes: after a power loss, or with one bit
flipped, it crashes or computes other numbers.
"""

import errno
import hashlib
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from pathlib import Path

import platformdirs
from filelock import FileLock

_FULL = (errno.ENOSPC, errno.EDQUOT)
_RECORDS = "compiled"
# PoCL writes these at every use, and reads none of them
_UNCHECKED = ("lock", "last_accessed")
# free space for a program: its source and preprocessed source to load it, its objects as well to compile it
_ROOM_TO_LOAD, _ROOM_TO_COMPILE = 2**20, 2**22


class KernelCache:
    """PoCL's kernels on disk, with records of what was compiled, and who is notified before something is."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []

    @cached_property
    def folder(self) -> Path:
        """Where compiled kernels are kept between processes; for this process alone where that cannot be written.

        Raises OSError (ENOSPC) where its disk is full.
        """
        folder = Path(platformdirs.user_cache_dir("diffract-bake")) / "kernels"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with FileLock(folder / "lock"):
                pass
        except OSError as error:
            if error.errno in _FULL:
                raise _full(folder) from None
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
        """Hold the cache alone while a program or kernel is compiled or loaded: PoCL's fails if processes share it.

        Files that compiling it made earlier are compared with their digests. If one differs, or if it was never
        compiled, all files that no record vouches for are removed, so that PoCL compiles instead of loading them.

        identity: of the program or kernel.
        Raises OSError (ENOSPC) where the disk is full: the compiler would end the process.
        """
        record = self.folder / _RECORDS / hashlib.sha256(identity.encode()).hexdigest()
        with FileLock(self.folder / "lock"):
            if self._vouched(record) is not None:
                self._require_room(_ROOM_TO_LOAD)
                yield
                return
            self._remove_unknown()
            self._require_room(_ROOM_TO_COMPILE)
            known = set(self._files())
            for announce in self._listeners:
                announce()
            yield
            with suppress(OSError):  # without its record, the next process compiles it once more
                self._write(record, [name for name in self._files() if name not in known])

    def _require_room(self, size: int) -> None:
        """Raise OSError (ENOSPC) where the disk has less free space, bytes."""
        place = self.folder / "room"
        try:
            descriptor = os.open(place, os.O_WRONLY | os.O_CREAT, 0o600)
            try:
                os.posix_fallocate(descriptor, 0, size)
            finally:
                os.close(descriptor)
                place.unlink()
        except OSError as error:
            if error.errno in _FULL:
                raise _full(self.folder) from None

    def _vouched(self, record: Path) -> set[str] | None:
        """Return the files that a record names, None where one of them or the record itself is not as written."""
        try:
            if not stat.S_ISREG(record.lstat().st_mode):
                return None
            files = json.loads(record.read_bytes())
            for name, (size, digest) in files.items():
                status = (self.folder / name).lstat()
                if not stat.S_ISREG(status.st_mode) or status.st_size != size or self._digest(name) != digest:
                    return None
        except (OSError, ValueError, TypeError, AttributeError, RecursionError):
            return None
        return set(files)

    def _digest(self, name: str) -> str:
        return hashlib.blake2b((self.folder / name).read_bytes(), digest_size=32).hexdigest()

    def _files(self) -> Iterator[str]:
        """Yield the relative names of all files of PoCL's that it reads."""
        for folder, folders, files in os.walk(self.folder):
            if Path(folder) == self.folder and _RECORDS in folders:
                folders.remove(_RECORDS)
            # a link to a folder is listed as a folder, and not followed
            links = [name for name in folders if (Path(folder) / name).is_symlink()]
            for name in (*files, *links):
                if name not in _UNCHECKED:
                    yield (Path(folder) / name).relative_to(self.folder).as_posix()

    def _remove_unknown(self) -> None:
        """Remove the records that do not hold, all files that no other record names, and folders left empty."""
        known: set[str] = set()
        for record in (self.folder / _RECORDS).glob("*"):
            files = self._vouched(record)
            if files is None:
                shutil.rmtree(record) if record.is_dir() else record.unlink(missing_ok=True)
            else:
                known |= files
        for name in [name for name in self._files() if name not in known]:
            (self.folder / name).unlink(missing_ok=True)
        for folder, _, _ in os.walk(self.folder, topdown=False):
            with suppress(OSError):  # it is not empty
                Path(folder).rmdir()

    def _write(self, record: Path, names: list[str]) -> None:
        files = {name: ((self.folder / name).stat().st_size, self._digest(name)) for name in names}
        record.parent.mkdir(exist_ok=True)
        unfinished = record.with_name("unfinished")
        unfinished.write_text(json.dumps(files), encoding="utf-8")
        unfinished.replace(record)


def _full(folder: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))


@cache
def kernel_cache() -> KernelCache:
    """Return this process's cache of kernels."""
    return KernelCache()
