"""The slowest test: every config in configs/ is baked whole, as published."""

import tomllib
from pathlib import Path

import pytest

from tests.cli.tool import REPOSITORY, Tool

CONFIGS = sorted((REPOSITORY / "configs").glob("*.toml"))


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_config_bakes(tool: Tool, published: Path, path: Path) -> None:
    name = tomllib.loads(path.read_text(encoding="utf-8"))["name"]
    result = tool("run", path, "--json", "--store", published)
    assert result.code == 0, result.stderr
    assert [printed["name"] for printed in result.json] == [name]
    report = (tool.out / name / "report.html").read_text(encoding="utf-8")
    assert f"<title>{name}</title>" in report
    assert tool("verify", tool.bundle(name)).code == 0
