"""The kernel cache: a file that is not as it was compiled is never loaded."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import pytest

from kernels.cache import KernelCache

PROGRAM, KERNEL = "AB/HASH/program.bc", "AB/HASH/kernel/1-1-1/kernel.so"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KernelCache:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return KernelCache()


def use(cache: KernelCache, name: str) -> bool:
    """Does as PoCL does: loads a file, or compiles it where it is missing. Returns whether it compiled."""
    file = cache.folder / name
    with cache.compiling(name):
        if file.exists():
            assert file.read_text() == f"compiled {name}"
            return False
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"compiled {name}")
        (cache.folder / "AB" / "HASH" / "last_accessed").touch()
        return True


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[3] ^= 1
    file.write_bytes(content)


def replace_by_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


def replace_by_link(file: Path) -> None:
    other = file.with_name("other")
    file.rename(other)
    file.symlink_to(other)


def replace_by_pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


DAMAGES: list[Callable[[Path], None]] = [
    lambda file: os.truncate(file, 0),
    lambda file: os.truncate(file, 5),
    lambda file: os.truncate(file, 2**33),
    Path.unlink,
    flip,
    replace_by_folder,
    replace_by_link,
    replace_by_pipe,
]


def test_what_was_compiled_is_loaded(cache: KernelCache) -> None:
    assert [use(cache, name) for name in (PROGRAM, KERNEL, PROGRAM, KERNEL)] == [True, True, False, False]


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", [PROGRAM, KERNEL])
def test_a_damaged_file_is_compiled_again(cache: KernelCache, damage: Callable[[Path], None], name: str) -> None:
    for each in (PROGRAM, KERNEL):
        use(cache, each)
    damage(cache.folder / name)
    assert [use(cache, each) for each in (PROGRAM, KERNEL)] == [each == name for each in (PROGRAM, KERNEL)]
    assert [use(cache, each) for each in (PROGRAM, KERNEL)] == [False, False]


@pytest.mark.parametrize("content", ["", "garbage", "[]", '{"a": 1}', '{"../x": [1, "2"]}', "[" * 10**5])
def test_a_damaged_record_vouches_for_nothing(cache: KernelCache, content: str) -> None:
    use(cache, PROGRAM)
    (record,) = (cache.folder / "compiled").iterdir()
    record.write_text(content)
    assert use(cache, PROGRAM)
    assert not use(cache, PROGRAM)


def test_a_foreign_file_is_not_loaded(cache: KernelCache) -> None:
    (cache.folder / PROGRAM).parent.mkdir(parents=True)
    (cache.folder / PROGRAM).write_text("planted, or left by a killed process")
    assert use(cache, PROGRAM)


def test_a_disk_that_fills_later(cache: KernelCache) -> None:
    use(cache, PROGRAM)
    with (
        mock.patch("os.posix_fallocate", side_effect=OSError(errno.ENOSPC, "full")),
        pytest.raises(OSError, match="No space left on device: '"),
    ):
        use(cache, KERNEL)
    assert not (cache.folder / "room").exists()
    assert use(cache, KERNEL)
