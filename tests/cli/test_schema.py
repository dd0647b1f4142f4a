"""JSON Schemas: docs/schemas holds what the command prints, and it knows every key that is in use."""

import json
import tomllib
from pathlib import Path

import pytest

from tests.cli.tool import REPOSITORY, Tool
from tests.schemas import SCHEMAS, faults, schema_of

CONFIGS = sorted([*(REPOSITORY / "configs").glob("*.toml"), *(REPOSITORY / "tests" / "scans").glob("*.toml")])


@pytest.mark.parametrize("document", ["config", "manifest"])
def test_the_committed_schema_is_what_the_command_prints(tool: Tool, document: str) -> None:
    """After a change of the models: diffract-bake inspect --schema config > docs/schemas/config.json."""
    result = tool("inspect", "--schema", document)
    assert (result.code, result.stderr) == (0, "")
    assert (SCHEMAS / f"{document}.json").read_text(encoding="utf-8") == result.stdout
    assert result.json["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert tool("inspect", "--schema", document, "--json").stdout == result.stdout


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_it_knows_every_config(path: Path) -> None:
    schema = schema_of("config")
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    assert faults(schema, document, schema) == []
    # and the walk sees what is wrong
    document["surface"]["colour"] = 1
    document["render"] = {"size": "large"}
    document["table"] = {"layout": "round"}
    del document["name"]
    found = faults(schema, document, schema)
    assert {".surface.colour: unknown key", ".render.size: 'large' is no integer", ".name: missing"} < set(found)
    assert any(fault.startswith(".table.layout") for fault in found)


def test_it_knows_every_key_of_a_manifest(baked: Tool) -> None:
    schema = schema_of("manifest")
    document = json.loads((baked.bundle() / "manifest.json").read_text(encoding="utf-8"))
    assert faults(schema, document, schema) == []
    del document["grid"]["power"]
    document["author"] = "nobody"
    assert faults(schema, document, schema) == [".grid.power: missing", ".author: unknown key"]


def test_a_schema_is_asked_for_alone(tool: Tool) -> None:
    assert tool("inspect", "--schema", "config", ".").code == 2
    assert tool("inspect", "--schema", "config", "--channel", "Height").code == 2
    assert tool("inspect", "--schema", "scan").code == 2
    result = tool("inspect")
    assert result.code == 2
    assert "Missing argument 'SOURCE'; or --schema" in result.stderr
