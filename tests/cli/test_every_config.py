"""The slowest test: every config in configs/ is baked whole by one command, as published."""

import tomllib

from tests.cli.tool import REPOSITORY, Tool


def test_every_config_bakes(tool: Tool) -> None:
    paths = sorted((REPOSITORY / "configs").glob("*.toml"))
    names = [tomllib.loads(path.read_text(encoding="utf-8"))["name"] for path in paths]
    result = tool("run", *paths, "--json")
    assert result.code == 0, result.stderr
    assert [told["name"] for told in result.json] == names
    for name in names:
        report = (tool.out / name / "report.html").read_text(encoding="utf-8")
        assert f"<title>{name}</title>" in report
        assert tool("verify", tool.bundle(name)).code == 0
