"""The store: content-addressed artifacts, written beside and renamed into place.

    <root>/<stage>/<key>/artifact.json    what it is, how it was made, the digest of every file
    <root>/<stage>/<key>/...              its files
    <root>/tmp/...                        artifacts being written; never read
    <root>/locks/...                      one lock per artifact, so that two runs do not do the same work

An artifact is visible only whole: its folder appears by one rename, after artifact.json was written last.
So a run killed at any moment leaves at most a folder under tmp/, which nothing reads and `collect` removes.
"""

import contextlib
import errno
import json
import os
import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import platformdirs
from filelock import FileLock

from pipeline.errors import DamagedError, StorageError
from pipeline.store import digest, scratch

RECORD = "artifact.json"
FORMAT = 1
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_REFUSALS = (
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EEXIST,
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.EIO,
)
_KEY = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class Artifact:
    """One finished artifact: its folder and its record."""

    folder: Path
    record: dict[str, Any]

    @property
    def stage(self) -> str:
        return str(self.record["stage"])

    @property
    def key(self) -> str:
        return str(self.record["key"])

    @property
    def summary(self) -> dict[str, Any]:
        """What the stage measured and chose."""
        return dict(self.record["summary"])

    @property
    def bytes(self) -> int:
        return sum(int(entry["bytes"]) for entry in self.record["files"].values())


def users_folder() -> Path:
    """Where artifacts are kept unless told otherwise: $DIFFRACT_BAKE_STORE, or the user's cache folder."""
    named = os.environ.get("DIFFRACT_BAKE_STORE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("diffract-bake")) / "store"


class Store:
    """A folder of artifacts shared by any number of runs."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def folder(self, stage: str, key: str) -> Path:
        return self.root / stage / key

    def has(self, stage: str, key: str) -> bool:
        """Whether an artifact stands under this key: folders appear whole. `open` checks its content."""
        return self.folder(stage, key).is_dir()

    def describe(self, stage: str, key: str) -> Artifact:
        """The artifact with its record checked, its files not. Raises DamagedError."""
        return self._read(self.folder(stage, key))

    def open(self, stage: str, key: str) -> Artifact:
        """The artifact, every file checked against its digest. Raises DamagedError."""
        artifact = self._read(self.folder(stage, key))
        faults = _faults(artifact)
        if faults:
            raise DamagedError(_damage(artifact.folder, faults))
        return artifact

    @contextlib.contextmanager
    def lock(self, stage: str, key: str) -> Iterator[None]:
        """Holds the right to make one artifact; another run that wants it waits here."""
        lock = FileLock(self.root / "locks" / f"{stage}-{key}.lock")
        with writing(self.root):
            (self.root / "locks").mkdir(parents=True, exist_ok=True)
            lock.acquire()
        try:
            yield
        finally:
            lock.release()

    @contextlib.contextmanager
    def create(self, stage: str, key: str, record: dict[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
        """A folder to write an artifact into and its record to complete; renamed into place on leaving.

        On any error the folder is removed and nothing becomes visible. Raises StorageError where the disk
        refuses.
        """
        with writing(self.root):
            folder = scratch.make(self.root / "tmp")
        try:
            with writing(self.root):
                whole = {"format": FORMAT, "stage": stage, "key": key, **record}
                yield folder, whole
                _seal(folder, whole)
                self._move(folder, self.folder(stage, key))
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _move(self, folder: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            folder.rename(target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            # another run without our lock (another machine) was first; its artifact is as good

    def artifacts(self) -> list[Artifact]:
        """All artifacts whose record can be read, by stage and key."""
        found = []
        for folder in self._folders():
            with contextlib.suppress(DamagedError):
                found.append(self._read(folder))
        return found

    def _folders(self) -> list[Path]:
        """Every folder that is named as an artifact's: nothing else under the root is ours to judge or remove."""
        return sorted(p for p in self.root.glob("*/*") if _KEY.fullmatch(p.name) and p.is_dir())

    def check(self) -> list[str]:
        """One line for every artifact that is not what it was when it was written."""
        faults = []
        for folder in self._folders():
            try:
                artifact = self._read(folder)
                found = _faults(artifact)
            except DamagedError as error:
                faults.append(str(error))
                continue
            if found:
                faults.append(_damage(folder, found))
        return faults

    def collect(self, keep_days: float | None) -> tuple[int, int]:
        """Removes damaged and abandoned folders and, with `keep_days`, artifacts unused for longer.

        Returns the number of folders removed and the bytes they held.
        """
        now = time.time()
        doomed = [p for p in self.root.glob("tmp/*") if scratch.abandoned(p)]
        for folder in self._folders():
            try:
                damaged = bool(_faults(self._read(folder)))
            except DamagedError:
                damaged = True
            if damaged or (keep_days is not None and _age_s(folder / RECORD, now) > keep_days * 86400.0):
                doomed.append(folder)
        freed = sum(f.stat().st_size for folder in doomed for f in folder.rglob("*") if f.is_file())
        for folder in doomed:
            shutil.rmtree(folder, ignore_errors=True)
        return len(doomed), freed

    def touch(self, stage: str, key: str) -> None:
        """Notes that an artifact was used, for `collect`."""
        with contextlib.suppress(OSError):
            os.utime(self.folder(stage, key) / RECORD)

    def _read(self, folder: Path) -> Artifact:
        try:
            record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
            sealed = record.pop("seal")
            unchanged = digest.of_json(record) == sealed
        except (OSError, ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
            fault = f"{RECORD} cannot be read ({type(error).__name__})"
            raise DamagedError(_damage(folder, [fault])) from None
        if not unchanged:
            raise DamagedError(_damage(folder, [f"{RECORD} was changed after it was written"]))
        artifact = Artifact(folder, record)
        if (artifact.stage, artifact.key) != (folder.parent.name, folder.name):
            raise DamagedError(_damage(folder, [f"it holds {artifact.stage}/{artifact.key}"]))
        return artifact


def _age_s(path: Path, now: float) -> float:
    """Seconds since a path was last written; 0 where it is gone by now."""
    try:
        return now - path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _seal(folder: Path, record: dict[str, Any]) -> None:
    """Writes the record last, with the digests of all files and of itself."""
    record["files"] = digest.of_folder(folder)
    record["seal"] = digest.of_json(record)
    (folder / RECORD).write_text(json.dumps(record, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def _faults(artifact: Artifact) -> list[str]:
    """What differs between an artifact's files and its record."""
    expected, found = artifact.record["files"], digest.of_folder(artifact.folder)
    found.pop(RECORD, None)
    faults = [f"{name} is missing" for name in expected if name not in found]
    faults += [f"{name} was added" for name in found if name not in expected]
    return faults + [f"{name} was changed" for name in expected if name in found and expected[name] != found[name]]


def _damage(folder: Path, faults: list[str]) -> str:
    some = ", ".join(faults[:3]) + (f" and {len(faults) - 3} more" if len(faults) > 3 else "")
    return f"{folder}: {some}. `diffract-bake store collect` removes damaged artifacts; then run again"


@contextlib.contextmanager
def writing(place: Path) -> Iterator[None]:
    """Turns the system's refusals to write under `place` into one StorageError; faults elsewhere stay as they are."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise StorageError(f"{place}: no space left to write; free some, or choose another place") from None
        if error.errno in _REFUSALS and _concerns(error, place):
            raise StorageError(f"{place}: cannot be written ({os.strerror(error.errno)}); choose another") from None
        raise


def _concerns(error: OSError, place: Path) -> bool:
    """Whether a fault names a path at or below `place`, or above it where that does not stand, or none."""
    if error.filename is None:
        return True
    named = Path(os.fsdecode(error.filename))
    return named.is_relative_to(place) or place.is_relative_to(named)
