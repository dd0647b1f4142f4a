"""Help that teaches, versions, and what fits a terminal."""

import resource
import statistics
from importlib.metadata import version

import pytest

from cli.main import _COMMANDS
from tests.cli.tool import Tool, too_wide

COMMANDS = [[name] for name in _COMMANDS] + [["store", name] for name in ("list", "check", "collect")]
COMMANDS += [["bench", name] for name in ("speed", "stability", "figures")]


@pytest.mark.parametrize("command", [[], *COMMANDS], ids=" ".join)
def test_every_command_has_help(tool: Tool, command: list[str]) -> None:
    result = tool(*command, "--help")
    assert (result.code, result.stderr) == (0, "")
    assert result.stdout.startswith("Usage: ")
    # a sentence on what it does, and a word on every option
    assert len(result.stdout.splitlines()[2].strip()) > 20
    assert too_wide(result.stdout) == []
    options = [line for line in result.stdout.splitlines() if line.startswith("  --")]
    assert all(line.split("  ")[-1] for line in options)


@pytest.mark.parametrize("command", [c for c in COMMANDS if c not in (["store"], ["bench"])], ids=" ".join)
def test_every_command_speaks_json(tool: Tool, command: list[str]) -> None:
    assert "--json" in tool(*command, "--help").stdout


def test_help_lists_every_command_with_its_purpose(tool: Tool) -> None:
    text = tool("-h").stdout
    lines = {line.split()[0]: line.split(maxsplit=1)[1] for line in text.split("Commands:")[1].splitlines() if line}
    assert set(lines) == set(_COMMANDS)
    assert all(len(text) > 15 for text in lines.values())


def test_without_arguments_it_shows_help(tool: Tool) -> None:
    result = tool()
    assert result.code == 2
    assert "Usage: " in result.stderr


def test_version(tool: Tool) -> None:
    result = tool.process("--version")
    assert (result.code, result.stderr) == (0, "")
    assert result.stdout == f"diffract-bake, version {version('diffract-bake')}\n"


def test_help_is_instant(tool: Tool) -> None:
    """Of a processor's time: what else the machine does is not the command's."""
    seconds = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert tool.process("--help").code == 0
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    assert 0.0 < statistics.median(seconds) < 0.5


def test_store_list(baked: Tool) -> None:
    printed = baked("store", "list", "--json").json
    assert printed["root"] == str(baked.store)
    found: dict[str, list[str]] = {}
    for artifact in printed["artifacts"]:
        assert artifact["name"] == "small"
        # textures without loss are the table, which they do not copy
        assert artifact["bytes"] > 0 or artifact["stage"] == "textures"
        found.setdefault(artifact["stage"], []).append(artifact["key"])
    assert found == baked.artifacts()
    lines = baked("store", "list").stdout.splitlines()
    assert lines[0].split() == ["stage", "name", "MiB", "key"]
    assert len(lines) == 1 + 7 + 1
    assert too_wide("\n".join(lines[:-1])) == []
    assert lines[-1].startswith("7 artifacts, ")


def test_an_empty_store(tool: Tool) -> None:
    assert tool("store", "list", "--json").json["artifacts"] == []
    assert tool("store", "check").code == 0
    assert tool("store", "collect", "--json").json["removed"] == 0
    assert not tool.store.exists()


def test_collect_removes_artifacts_that_were_long_unused(copy: Tool) -> None:
    assert copy("store", "collect", "--unused-days", "1").stdout.startswith("removed 0 folders")
    assert copy("store", "collect", "--unused-days", "0").stdout.startswith("removed 7 folders")
    assert copy.artifacts() == {}
    # the results stand on their own
    assert copy("verify", copy.bundle()).code == 0


def test_tables_fit_a_terminal(baked: Tool) -> None:
    assert too_wide(baked("doctor").stdout.split("\npython")[0]) == []
    assert too_wide(baked("inspect", "small.toml").stdout.splitlines()[0]) == []
