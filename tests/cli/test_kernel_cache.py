"""The kernel cache as runs use it: damaged kernels are compiled again, and a full disk is code 7."""

import os
import shutil

import pytest

from tests.cli.tool import Tool, flip_a_byte, mounted


@pytest.mark.parametrize("size", ["300k", "4200k"])
def test_a_full_disk_is_one_line(tool: Tool, size: str) -> None:
    """There is no room for the first kernel, or for the fourth."""
    disk = tool.folder / "disk"
    with mounted(disk, f"size={size}") as done:
        if not done:
            pytest.skip("mounting a small file system needs root and the right to mount")
        result = tool.process("run", tool.config(), environment={"XDG_CACHE_HOME": str(disk)})
    assert result.code == 7
    assert len(result.errors) == 1
    assert f"{disk}/diffract-bake/kernels: no space left" in result.stderr.splitlines()[-1]


@pytest.mark.slow
def test_damaged_kernels_are_compiled_again(tool: Tool) -> None:
    environment, config = {"XDG_CACHE_HOME": str(tool.folder / "caches")}, tool.config()

    def compiles() -> bool:
        shutil.rmtree(tool.store, ignore_errors=True)
        result = tool.process("run", config, "--until", "table", environment=environment)
        assert result.code == 0, result.stderr
        return "compiling" in result.stderr

    def made() -> list[bytes]:
        return [path.read_bytes() for path in sorted(tool.store.rglob("c/*")) if path.is_file()]

    assert compiles()
    expected = made()
    assert expected
    for i, file in enumerate((tool.folder / "caches").rglob("*.so")):
        if i % 2:
            os.truncate(file, 0)
        else:
            flip_a_byte(file)
    assert compiles()
    assert made() == expected
    assert not compiles()
