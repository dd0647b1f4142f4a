"""Configs whose scene is a mesh or an environment, baked whole."""

import json

import pytest

from tests.cli.test_polar import write
from tests.cli.tool import Tool
from tests.scene.scenes import latlong, write_environment
from tests.scene.tube import write_obj

CAMERA = {"position": [0, -60, 200], "fov_deg": 12, "size": [160, 60]}


@pytest.mark.slow
def test_a_mesh_under_the_sun_is_baked_and_certified(tool: Tool) -> None:
    """The snake-like tube of docs/usage.md: its certificate is over what the camera sees, and over its border."""
    write_obj(tool.folder / "tube.obj")
    scene = {"lights": [{"kind": "sun", "theta_deg": 20}], "cameras": [CAMERA], "mesh": {"path": "tube.obj"}}
    result = tool("run", write(tool, scene=scene), "--json")
    assert result.code == 0, result.stderr
    certificate = json.loads(result.stdout)[0]["stages"]["textures"]["summary"]["certificate"]
    assert certificate["measured"] <= certificate["delta_e"] == 0.5
    assert certificate["random"]["directions"] == 2000
    assert certificate["border"]["directions"] > 0
    assert tool("verify", tool.bundle()).code == 0
    config = json.loads((tool.bundle() / "manifest.json").read_text(encoding="utf-8"))["provenance"]["config"]
    assert config["scene"]["mesh"]["path"] == "tube.obj"
    assert [entry["file"] for entry in config["scene_files"]] == ["tube.obj"]
    assert "What the scene visits." in (tool.out / "small" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_another_file_of_the_same_name_is_another_scene(tool: Tool) -> None:
    """The address of an artifact holds the content of an environment, and not its name."""
    scene = {"lights": [{"kind": "environment", "path": "sky.exr"}]}
    planned = []
    for luminance in (latlong(), latlong()[:, ::-1], latlong()):
        write_environment(tool.folder / "sky.exr", luminance)
        planned.append(json.loads(tool("plan", tool.config(scene=scene), "--json").stdout))
    assert planned[0] == planned[2] != planned[1]
