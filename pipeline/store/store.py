"""The store: content-addressed artifacts, which are written to a temporary folder and renamed into place.

    <root>/<stage>/<key>/artifact.json    stage, key, provenance, and the digest of every file
    <root>/<stage>/<key>/...              files of the artifact
    <root>/tiles/<key>/...                tiles of tables (tiles.py), each a file of its own
    <root>/tmp/...                        artifacts being written; never read
    <root>/locks/...                      one lock per artifact, so that two runs do not do the same work

artifact.json is written last, and then the folder appears by one rename: only complete artifacts are visible. A run
that is killed leaves at most a folder under tmp/, which `collect` removes.
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
from typing import Any, TypeVar

import platformdirs
from filelock import FileLock

from pipeline.errors import DamagedError, StorageError
from pipeline.store import digest, files, scratch
from pipeline.store import tiles as tile_files
from pipeline.store.tiles import TileFolder

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
_RECORD_BYTES = 16 * 2**20
_REQUIRED = {"stage": str, "key": str, "files": dict}
_TYPES = {
    **_REQUIRED,
    "name": str,
    "version": int,
    "parameters": dict,
    "inputs": dict,
    "summary": dict,
    "provenance": dict,
}
_T = TypeVar("_T")


@dataclass(frozen=True)
class Artifact:
    """A complete artifact: its folder and its record (artifact.json)."""

    folder: Path
    record: dict[str, Any]

    @property
    def stage(self) -> str:
        """Name of the stage that made it."""
        return str(self.record["stage"])

    @property
    def key(self) -> str:
        """Its address, 64 hexadecimal digits."""
        return str(self.record["key"])

    @property
    def summary(self) -> dict[str, Any]:
        """The values that the stage measured and chose."""
        return dict(self.record["summary"])

    def measured(self, key: str, kind: type[_T]) -> _T:
        """Returns a value of the summary. Raises DamagedError where it is missing or of another type than `kind`."""
        value = self.record.get("summary", {}).get(key)
        if not isinstance(value, kind):
            raise DamagedError(_damage(self.folder, [f"{RECORD}: expected {key} of type {kind.__name__}"]))
        return value

    @property
    def bytes(self) -> int:
        """Size of all files."""
        return sum(int(entry["bytes"]) for entry in self.record["files"].values())


def users_folder() -> Path:
    """Returns the default folder of artifacts: $DIFFRACT_BAKE_STORE, or one in the user's cache folder."""
    named = os.environ.get("DIFFRACT_BAKE_STORE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("diffract-bake")) / "store"


class Store:
    """A folder of artifacts, which any number of runs can share."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def folder(self, stage: str, key: str) -> Path:
        """Returns the folder of an artifact, whether it exists or not."""
        return self.root / stage / key

    def has(self, stage: str, key: str) -> bool:
        """Whether anything is at the artifact's address. `describe` and `open` check that it is the artifact."""
        return os.path.lexists(self.folder(stage, key))

    def describe(self, stage: str, key: str) -> Artifact:
        """Reads the record of an artifact and checks it, without its files. Raises DamagedError."""
        return self._read(self.folder(stage, key))

    def open(self, stage: str, key: str) -> Artifact:
        """Reads the record of an artifact and checks every file against its digest. Raises DamagedError."""
        artifact = self._read(self.folder(stage, key))
        faults = _faults(artifact)
        if faults:
            raise DamagedError(_damage(artifact.folder, faults))
        return artifact

    @contextlib.contextmanager
    def lock(self, stage: str, key: str) -> Iterator[None]:
        """Holds the lock of one artifact; other runs wait for it. Raises StorageError where it cannot be written."""
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
        """Creates an artifact: yields a temporary folder for its files and its record, and then renames the folder.

        On any error the folder is removed, and no artifact becomes visible.

        stage, key: its address. record: entries of artifact.json, to which the block may add.
        Raises StorageError where the files cannot be written.
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
            # a run that does not see the lock, on another machine, made the same artifact first

    def artifacts(self) -> list[Artifact]:
        """Lists the artifacts whose record can be read, by stage and key."""
        found = []
        for folder in self._folders():
            with contextlib.suppress(DamagedError):
                found.append(self._read(folder))
        return found

    def _folders(self) -> list[Path]:
        """Lists what is named like an artifact; the store neither judges nor removes anything else."""
        found = (p for p in self.root.glob("*/*") if _KEY.fullmatch(p.name))
        return sorted(p for p in found if p.parent.name != tile_files.FOLDER)

    def tiles(self, key: str) -> TileFolder:
        """Returns the tiles of an address, whether there are any or not."""
        return TileFolder(self.root, key)

    def tile_folders(self) -> list[TileFolder]:
        """Lists the addresses that have tiles."""
        found = (p for p in self.root.glob(f"{tile_files.FOLDER}/*") if _KEY.fullmatch(p.name))
        return [self.tiles(p.name) for p in sorted(found) if p.is_dir() and not p.is_symlink()]

    def check(self) -> list[str]:
        """Checks all artifacts and tiles; returns one line for each address of which a file has changed."""
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
        for tiles in self.tile_folders():
            if changed := [f"{file.name} was changed" for file in tiles.faults()]:
                faults.append(_damage(tiles.folder, changed))
        return faults

    def collect(self, keep_days: float | None) -> tuple[int, int]:
        """Removes what is damaged, temporary folders of killed runs, and what was not used for `keep_days` days.

        Of the tiles of an address, those that are damaged are removed, or all where none was used.

        keep_days: None keeps all that is not damaged.
        Returns the number of removed folders and single files, and their size in bytes.
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
        for tiles in self.tile_folders():
            unused = keep_days is not None and _age_s(tiles.folder, now) > keep_days * 86400.0
            doomed += [tiles.folder] if unused else tiles.faults()
        freed = sum(_bytes(path) for path in doomed)
        for path in doomed:
            _remove(path)
        return len(doomed), freed

    def touch(self, stage: str, key: str) -> None:
        """Records the time of an artifact's last use, for `collect`."""
        with contextlib.suppress(OSError):
            os.utime(self.folder(stage, key) / RECORD)

    def _read(self, folder: Path) -> Artifact:
        if folder.is_symlink() or not folder.is_dir():
            raise DamagedError(_damage(folder, ["expected a folder, found something else"]))
        try:
            record = json.loads(files.read_text(folder / RECORD, _RECORD_BYTES))
            sealed = record.pop("seal")
            unchanged = digest.of_json(record) == sealed
            odd = _odd_entries(record)
        except (OSError, ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
            fault = f"{RECORD} cannot be read ({type(error).__name__})"
            raise DamagedError(_damage(folder, [fault])) from None
        if not unchanged:
            raise DamagedError(_damage(folder, [f"{RECORD} was changed after it was written"]))
        if odd:
            raise DamagedError(_damage(folder, [f"{RECORD}: {', '.join(odd)} of a wrong type"]))
        artifact = Artifact(folder, record)
        if (artifact.stage, artifact.key) != (folder.parent.name, folder.name):
            raise DamagedError(_damage(folder, [f"it holds {artifact.stage}/{artifact.key}"]))
        return artifact


def _odd_entries(record: dict[str, Any]) -> list[str]:
    """Lists the entries of a record that are missing or not of their type.

    Raises ValueError where a text cannot be printed, because it holds half of a surrogate pair.
    """
    json.dumps(record, ensure_ascii=False).encode()
    odd = [key for key in _REQUIRED if key not in record]
    odd += [key for key, kind in _TYPES.items() if key in record and not isinstance(record[key], kind)]
    if odd:
        return odd
    entries = record["files"].values()
    sized = all(isinstance(entry, dict) and isinstance(entry.get("bytes"), int) for entry in entries)
    seconds = record.get("provenance", {}).get("seconds", 0.0)
    return [
        *(["files"] if not sized else []),
        *(["provenance.seconds"] if not isinstance(seconds, int | float) else []),
    ]


def _bytes(path: Path) -> int:
    """Computes the size of a file, or of all files below a folder; links are not followed."""
    if path.is_symlink() or not path.is_dir():
        return path.lstat().st_size
    return sum(file.lstat().st_size for file in path.rglob("*") if file.is_file())


def _remove(path: Path) -> None:
    """Removes a folder with all that is in it, or a file or link."""
    if path.is_symlink() or not path.is_dir():
        path.unlink(missing_ok=True)
    else:
        shutil.rmtree(path, ignore_errors=True)


def _age_s(path: Path, now: float) -> float:
    """Computes the seconds since a path was last written; 0 where it no longer exists."""
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
    """Lists the differences between an artifact's files and its record; sizes are compared before contents."""
    expected = artifact.record["files"]
    found, faults = files.listing(artifact.folder, [*expected, RECORD])
    found.pop(RECORD, None)
    faults += [f"{name} is missing" for name in expected if name not in found]
    faults += [f"{name} was added" for name in found if name not in expected]
    return faults + [
        f"{name} was changed"
        for name, entry in expected.items()
        if name in found and not _unchanged(artifact.folder / name, found[name], entry)
    ]


def _unchanged(path: Path, size: int, entry: dict[str, Any]) -> bool:
    return size == entry["bytes"] and digest.of_file(path) == entry.get("sha256")


def _damage(folder: Path, faults: list[str]) -> str:
    some = ", ".join(faults[:3]) + (f" and {len(faults) - 3} more" if len(faults) > 3 else "")
    return f"{folder}: {some}. `diffract-bake store collect` removes damaged artifacts; then run again"


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turns errors of the system when writing below `folder` into a StorageError; other errors pass unchanged."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            # other folders are written meanwhile: compiled kernels have a cache of their own
            full = folder if error.filename is None or _concerns(error, folder) else os.fsdecode(error.filename)
            raise StorageError(f"{full}: no space left to write; free some, or choose another folder") from None
        if error.errno in _REFUSALS and _concerns(error, folder):
            reason = os.strerror(error.errno)
            raise StorageError(f"{folder}: cannot be written ({reason}); choose another folder") from None
        raise


def _concerns(error: OSError, folder: Path) -> bool:
    """Whether an error names no path, or one that contains `folder` or lies in it."""
    if error.filename is None:
        return True
    named = Path(os.fsdecode(error.filename))
    return named.is_relative_to(folder) or folder.is_relative_to(named)
