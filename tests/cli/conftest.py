"""Tools in folders of their own; one small bake shared by all that only read it."""

import os
import shutil
from pathlib import Path

import pytest

from tests.cli.tool import Result, Tool


@pytest.fixture
def tool(tmp_path: Path) -> Tool:
    """An empty folder, an empty store."""
    return Tool(tmp_path, tmp_path / "store")


@pytest.fixture(scope="session")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Tool, Result]:
    """The small config's first run, in this process, and what it printed."""
    folder = tmp_path_factory.mktemp("baked")
    tool = Tool(folder, folder / "store")
    result = tool("run", tool.config())
    assert result.code == 0, result.stderr
    return tool, result


@pytest.fixture(scope="session")
def baked(first_run: tuple[Tool, Result]) -> Tool:
    """The folder of the small config after its first run: read it, change nothing."""
    return first_run[0]


@pytest.fixture(scope="session")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store for what configs/ and the validation bench hold, empty at first: each artifact is made once for all.

    Workers of pytest-xdist share it, as runs share a store: each has a folder of its own in one that is common.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    return folder / "published"


@pytest.fixture
def copy(baked: Tool, tmp_path: Path) -> Tool:
    """A copy of `baked` to change at will."""
    folder = tmp_path / "copy"
    shutil.copytree(baked.folder, folder)
    return Tool(folder, folder / "store")
