"""Tiles in the store: each made once, and never used where it was changed."""

import multiprocessing
import os
from pathlib import Path

import pytest

from pipeline.store.store import Store

KEY = "ab" * 32
TILES = {(0, 0): b"a" * 100, (0, 12): b"b" * 300, (7, 3): b""}


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


def test_tiles_come_back_and_leave_nothing_temporary(store: Store) -> None:
    tiles = store.tiles(KEY)
    assert tiles.read(TILES) == {}
    tiles.write(TILES)
    assert tiles.read([*TILES, (9, 9)]) == TILES
    assert list((store.root / "tmp").iterdir()) == []
    assert store.check() == []
    assert store.artifacts() == []
    (listed,) = store.tile_folders()
    assert (listed.key, listed.bytes, len(listed.files)) == (KEY, 400 + 3 * 32, 3)


def test_a_changed_tile_counts_as_missing_is_named_and_collected_alone(store: Store) -> None:
    tiles = store.tiles(KEY)
    tiles.write(TILES)
    harmed = tiles.folder / "0-12"
    content = bytearray(harmed.read_bytes())
    content[50] ^= 1
    harmed.write_bytes(content)
    assert set(tiles.read(TILES)) == {(0, 0), (7, 3)}
    (line,) = store.check()
    assert str(tiles.folder) in line
    assert "0-12 was changed" in line
    assert store.collect(None) == (1, len(content))
    assert store.check() == []
    tiles.write({(0, 12): TILES[0, 12]})
    assert tiles.read(TILES) == TILES


@pytest.mark.parametrize("kind", ["cut", "empty", "link", "pipe", "folder"])
def test_what_is_no_tile_is_not_read_and_is_collected(store: Store, tmp_path: Path, kind: str) -> None:
    tiles = store.tiles(KEY)
    tiles.write(TILES)
    place = tiles.folder / "0-0"
    whole = place.read_bytes()
    place.unlink()
    if kind == "cut":
        place.write_bytes(whole[:-1])
    elif kind == "empty":
        place.write_bytes(b"")
    elif kind == "link":
        (tmp_path / "elsewhere").write_bytes(whole)
        place.symlink_to(tmp_path / "elsewhere")
    elif kind == "pipe":
        os.mkfifo(place)
    else:
        place.mkdir()
    assert (0, 0) not in tiles.read(TILES)
    assert store.collect(None)[0] == 1
    assert not os.path.lexists(place)
    assert kind != "link" or (tmp_path / "elsewhere").exists()


def test_unused_tiles_are_collected_and_used_ones_stay(store: Store) -> None:
    tiles = store.tiles(KEY)
    tiles.write(TILES)
    os.utime(tiles.folder, (0, 0))
    tiles.touch()
    assert store.collect(1.0) == (0, 0)
    os.utime(tiles.folder, (0, 0))
    assert store.collect(1.0)[0] == 1
    assert store.tile_folders() == []


def _write(root: Path, part: int) -> None:
    for _ in range(20):
        Store(root).tiles(KEY).write({(part, k): bytes([k]) * 1000 for k in range(8)} | TILES)


def test_two_processes_write_one_address_at_once(store: Store) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write, args=(store.root, part)) for part in (20, 21)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0, 0]
    assert len(store.tiles(KEY).files) == 16 + len(TILES)
    assert store.check() == []
