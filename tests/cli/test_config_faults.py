"""Wrong usage and faults of configs: all of them, before any work."""

import pytest

from tests.cli.tool import Tool, recipe

FAULTY = """
name = "has space"
colour = 1

[surface]
recipe = { kind = "sinusoid", size_um = -10, period_nm = 3 }

[coherence]
sigma_um = "wide"

[spectrum]
range_nm = [780, 380]
illuminant = "D66"

[table]
layout = "taylor"
resolution = 500
step_nm = 0

[render]
lights = [{ theta_deg = 95 }]
"""
FAULTY_KEYS = [
    "name",
    "colour",
    "surface.recipe.size_um",
    "surface.recipe.period_nm",
    "coherence.sigma_um",
    "spectrum.range_nm",
    "spectrum.illuminant",
    "table.resolution",
    "table.step_nm",
    "render.lights.0.theta_deg",
]


def untouched(tool: Tool) -> bool:
    return not tool.store.exists() and not tool.out.exists()


@pytest.mark.parametrize("command", ["run", "plan", "validate", "publish", "render", "bench speed"])
def test_every_fault_at_once_with_its_key(tool: Tool, command: str) -> None:
    (tool.folder / "faulty.toml").write_text(FAULTY, encoding="utf-8")
    result = tool(*command.split(), "faulty.toml")
    assert result.code == 2
    assert result.stdout == ""
    assert result.errors == result.stderr.splitlines()
    keys = [line.removeprefix("error: faulty.toml: ").split(": ")[0] for line in result.errors]
    assert sorted(keys) == sorted(FAULTY_KEYS)
    assert untouched(tool)


def test_every_config_is_checked_before_the_first_is_baked(tool: Tool) -> None:
    good = tool.config()
    (tool.folder / "faulty.toml").write_text(FAULTY, encoding="utf-8")
    result = tool("run", good, "faulty.toml")
    assert result.code == 2
    assert all(line.startswith("error: faulty.toml: ") for line in result.stderr.splitlines())
    assert untouched(tool)


@pytest.mark.parametrize("command", ["run", "validate"])
def test_two_configs_of_one_name_would_share_a_folder(tool: Tool, command: str) -> None:
    first, second = tool.config("first.toml"), tool.config("second.toml", surface=recipe("mirror"))
    result = tool(command, first, second)
    assert result.code == 2
    assert result.stderr == f"error: {second}: name: 'small' is also the name of {first}\n"
    assert untouched(tool)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "name: required, but missing"),
        (b"name = ", "not valid TOML"),
        (b"\x89PNG\r\n\x1a\n\x00", "cannot be read as UTF-8 text"),
        (b'name = "x"\n[surface]\npath = "none.txt"\n', "surface.path: no such file: "),
        (b'name = "x"\n[surface]\n', "surface: expected either 'path' (a scan) or 'recipe'"),
    ],
)
def test_files_that_are_no_config(tool: Tool, content: bytes, message: str) -> None:
    (tool.folder / "x.toml").write_bytes(content)
    result = tool("run", "x.toml")
    assert result.code == 2
    assert any(line.startswith(f"error: x.toml: {message}") for line in result.errors), result.stderr
    assert "Traceback" not in result.stderr
    assert untouched(tool)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bake"], "No such command 'bake'"),
        (["run"], "Missing argument 'CONFIG...'"),
        (["run", "--colour", "red", "x.toml"], "--colour"),
        (["run", "none.toml"], "error: none.toml: no such config file"),
        (["render", "x.toml", "--theta", "90"], "90"),
        (["render", "x.toml", "--size", "4"], "4"),
        (["eval", "none.toml", "--directions", "d.csv"], "'none.toml' does not exist"),
        (["verify", "none"], "'none' does not exist"),
        (["store", "burn"], "No such command 'burn'"),
    ],
)
def test_wrong_usage(tool: Tool, arguments: list[str], message: str) -> None:
    result = tool(*arguments)
    assert result.code == 2
    assert result.stdout == ""
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert untouched(tool)


def test_a_recipe_that_its_pitch_cannot_carry(tool: Tool) -> None:
    result = tool("run", tool.config(surface=recipe("sinusoid", period_um=0.15)))
    assert result.code == 2
    assert len(result.errors) == 1
    assert "surface.recipe." in result.errors[0]
    assert tool.artifacts() == {}
    assert not tool.out.exists()
