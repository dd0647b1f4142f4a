"""SHA-256 digests, which address artifacts and detect changes of files."""

import hashlib
import json
import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any


def of_json(value: Any) -> str:
    """Computes the SHA-256 of a value's canonical JSON: sorted keys, no spaces. Raises ValueError for NaN."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def of_file(path: Path) -> str:
    """Computes the SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def of_source(path: Path) -> str:
    """Computes the SHA-256 of a file that a config names; again only where its status says that it has changed."""
    status = path.stat()
    return _of_source(path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


@lru_cache(maxsize=1024)
def _of_source(path: Path, *_status: int) -> str:
    return of_file(path)


def of_folder(folder: Path) -> dict[str, dict[str, Any]]:
    """Computes the size ("bytes") and the SHA-256 of every file below a folder, by relative path with slashes."""
    found = sorted(path for path in folder.rglob("*") if path.is_file())
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        digests = pool.map(of_file, found)
        return {
            path.relative_to(folder).as_posix(): {"bytes": path.stat().st_size, "sha256": sha256}
            for path, sha256 in zip(found, digests, strict=True)
        }
