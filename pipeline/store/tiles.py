"""Tiles of tables in the store: small files under one address, each with its digest, each made once.

    <root>/tiles/<key>/<band>-<sector>    BLAKE2b of the content, 32 bytes, and the content

An artifact has a record of all its files, and is whole or not there. Tiles of one address are made by several runs,
as their scenes need them, so each file stands for itself. It is written in a folder below tmp/ and renamed into
place. Two runs that make one tile write the same content. A tile that was changed counts as missing and is made
again.
"""

import hashlib
import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from stat import S_ISREG

from pipeline.store import scratch

FOLDER = "tiles"
Place = tuple[int, int]
_DIGEST_BYTES = 32
# a tile has a few hundred kilobytes
_MOST_BYTES = 2**26


class TileFolder:
    """The tiles of one address."""

    def __init__(self, root: Path, key: str) -> None:
        """Takes the folder of the store and the address, 64 hexadecimal digits."""
        self._root, self.key = root, key
        self.folder = root / FOLDER / key

    def read(self, places: Iterable[Place]) -> dict[Place, bytes]:
        """Reads those of some tiles that are there and unchanged, by band and sector."""
        found = {place: _content(self.folder / _name(place)) for place in places}
        return {place: content for place, content in found.items() if content is not None}

    def write(self, tiles: Mapping[Place, bytes]) -> None:
        """Writes tiles. Raises OSError where the store cannot be written."""
        beside = scratch.make(self._root / "tmp")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for place, content in tiles.items():
                file = beside / _name(place)
                file.write_bytes(_digest(content) + content)
                file.replace(self.folder / file.name)
        finally:
            shutil.rmtree(beside, ignore_errors=True)

    def touch(self) -> None:
        """Records the time of the last use."""
        os.utime(self.folder)

    @property
    def files(self) -> list[Path]:
        """The files of all tiles, by name."""
        return sorted(self.folder.iterdir())

    @property
    def bytes(self) -> int:
        """Size of all files."""
        return sum(file.lstat().st_size for file in self.files)

    def faults(self) -> list[Path]:
        """Lists the files that are no tile, or were changed since they were written."""
        return [file for file in self.files if _content(file) is None]


def _name(place: Place) -> str:
    return f"{place[0]}-{place[1]}"


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=_DIGEST_BYTES).digest()


def _content(file: Path) -> bytes | None:
    """Reads the content of a tile; None where there is none, or where it was changed. Links are not followed."""
    try:
        # a pipe would wait for its writer
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        with open(descriptor, "rb", closefd=True) as stream:
            status = os.fstat(descriptor)
            whole = stream.read() if S_ISREG(status.st_mode) and status.st_size <= _MOST_BYTES else b""
    except OSError:
        return None
    content = whole[_DIGEST_BYTES:]
    return content if _digest(content) == whole[:_DIGEST_BYTES] else None
