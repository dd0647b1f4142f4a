"""A tool of its own for each test, as in tests/cli."""

from pathlib import Path

import pytest

from tests.cli.tool import Tool


@pytest.fixture
def tool(tmp_path: Path) -> Tool:
    """An empty folder, an empty store."""
    return Tool(tmp_path, tmp_path / "store")
