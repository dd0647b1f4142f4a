"""Bad scenes end in one line with their key, before any work."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.config.read import parse
from pipeline.errors import ConfigError
from pipeline.report import images
from tests.scene.scenes import latlong, write_environment
from tests.scene.tube import write_glb, write_obj

LIGHT = {"theta_deg": 30.0}
CAMERA = {"position": [0.0, -60.0, 200.0], "fov_deg": 12.0, "size": [40, 20]}
SEEN = {"lights": [LIGHT], "cameras": [CAMERA]}


def faults(folder: Path, **keys: Any) -> dict[str, str]:
    """The faults of a config with this [scene]: messages by key."""
    document = {"name": "a", "surface": {"recipe": {"kind": "mirror"}}, "scene": keys}
    with pytest.raises(ConfigError) as refused:
        parse(document, "file.toml", folder)
    assert all("\n" not in line for line in refused.value.lines)
    return dict(refused.value.faults)


@pytest.mark.parametrize(
    ("keys", "key", "said"),
    [
        ({"lights": []}, "lights", "at least 1"),
        ({"lights": [{"theta_deg": 90.0}]}, "lights.0.theta_deg", "above the horizon"),
        ({"lights": [LIGHT, {"kind": "sun", "theta_deg": 120.0}]}, "lights.1.theta_deg", "above the horizon"),
        ({"lights": [{"kind": "range", "theta_deg": [60.0, 100.0]}]}, "lights.0.theta_deg", "above the horizon"),
        ({"lights": [{"kind": "range", "theta_deg": [60.0, 50.0]}]}, "lights.0.theta_deg", "from < to"),
        ({"lights": [{"kind": "range", "theta_deg": [0, 9], "phi_deg": [0, 400]}]}, "lights.0.phi_deg", "360 apart"),
        ({"lights": [{"kind": "cone", "theta_deg": 0, "diameter_deg": 200}]}, "lights.0.diameter_deg", "180"),
        ({"lights": [{"kind": "lamp", "theta_deg": 0}]}, "lights.0", "expected a kind, one of direction, range"),
        ({"lights": [{"kind": 3, "theta_deg": 0}]}, "lights.0", "expected a kind"),
        ({"lights": [{"kind": "sun", "theta_deg": 0, "diameter_deg": 1}]}, "lights.0.diameter_deg", "unknown key"),
        ({"lights": [{**LIGHT, "power": 0.0}]}, "lights.0.power", "greater than"),
        ({"lights": [{"kind": "environment", "path": "no.exr"}]}, "lights.0.path", "no such file"),
        ({"lights": [LIGHT], "views": {"theta_min_deg": 40, "theta_max_deg": 30}}, "views", "theta_max_deg"),
        ({"lights": [LIGHT], "views": {"phi_deg": [10, 10]}}, "views.phi_deg", "from < to"),
        ({"lights": [LIGHT], "cameras": []}, "cameras", "at least 1"),
        ({"lights": [LIGHT], "sample": [1, 1]}, "", "expected cameras"),
        (SEEN, "", "with a mesh, or with the size"),
        ({**SEEN, "sample": [1, 1], "views": {}}, "", "views or cameras"),
        ({**SEEN, "sample": [1, 0]}, "sample.1", "greater than 0"),
        ({**SEEN, "mesh": {"path": "no.obj"}}, "mesh.path", "no such file"),
        ({**SEEN, "sample": [50, 50], "cameras": [{"position": [0, 0, 1]}]}, "cameras.0", "set up"),
        ({**SEEN, "sample": [9, 9], "cameras": [{"position": [0, 9, -9]}]}, "cameras.0", "none of its pixels"),
        ({**SEEN, "sample": [9, 9], "cameras": [CAMERA, {"position": [0, -9, 9], "target": [0, -40, 20]}]},
         "cameras.1", "none of its pixels"),
        ({**SEEN, "sample": [50, 50], "lights": [{"theta_deg": 100}]}, "lights.0", "below the horizon there"),
        ({**SEEN, "sample": [50, 50], "cameras": [{**CAMERA, "size": [0, 4]}]}, "cameras.0.size.0", "greater than"),
        ({**SEEN, "sample": [50, 50], "cameras": [{**CAMERA, "fov_deg": 180}]}, "cameras.0.fov_deg", "170"),
    ],
)  # fmt: skip
def test_a_fault_names_its_key(tmp_path: Path, keys: dict[str, Any], key: str, said: str) -> None:
    found = faults(tmp_path, **keys)
    assert set(found) == {f"scene.{key}".rstrip(".")}
    assert said in next(iter(found.values()))


def environment_fault(folder: Path, content: Any, names: str = "RGB") -> str:
    """The fault of an environment map of these luminances, or bytes."""
    path = folder / "sky.exr"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        write_environment(path, content, names)
    found = faults(folder, lights=[{"kind": "environment", "path": "sky.exr"}])
    assert list(found) == ["scene.lights.0.path"]
    return found["scene.lights.0.path"]


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_an_environment_of_no_radiance_is_refused(tmp_path: Path, value: float) -> None:
    sky = latlong()
    sky[3, 4:6] = value
    assert "got others in 2 of 8192 pixels" in environment_fault(tmp_path, sky)


def test_a_large_environment_is_refused_by_its_header(tmp_path: Path) -> None:
    """16384 x 8192 pixels are refused before they are decoded."""
    images.write_exr(tmp_path / "sky.exr", {"Y": np.zeros((8192, 16384), np.float16)}, "data")
    content = (tmp_path / "sky.exr").read_bytes()
    assert "at most 4096 x 2048, got 16384 x 8192" in environment_fault(tmp_path, content)


@pytest.mark.parametrize(
    ("content", "names", "said"),
    [
        (np.ones((64, 64)), "RGB", "twice as many columns as rows"),
        (np.zeros((8, 16)), "RGB", "black everywhere"),
        (np.ones((8, 16)), "XZ", "expected the channels"),
        (b"\x89PNG", "RGB", "cannot be read as EXR"),
        (b"", "RGB", "cannot be read as EXR"),
        (np.where(np.arange(16)[:, None] < 8, 0.0, 1.0) * np.ones(32), "Y", "above the horizon"),
    ],
)
def test_an_image_that_is_no_sky_is_refused(tmp_path: Path, content: Any, names: str, said: str) -> None:
    assert said in environment_fault(tmp_path, content, names)


def mesh_fault(folder: Path, path: Path, **keys: Any) -> tuple[str, str]:
    """The key and the message of the fault of a mesh."""
    ((key, message),) = faults(folder, **SEEN, mesh={"path": path.name, **keys}).items()
    return key, message


def test_a_mesh_without_tangents_needs_a_direction(tmp_path: Path) -> None:
    for path in (write_obj(tmp_path / "a.obj", textured=False), write_glb(tmp_path / "a.glb", "NORMAL")):
        key, said = mesh_fault(tmp_path, path)
        assert key == "scene.mesh.along"
        assert "expected tangents or texture coordinates in the file, got neither" in said


def test_texture_coordinates_without_a_direction_are_none(tmp_path: Path) -> None:
    text = write_obj(tmp_path / "a.obj").read_text(encoding="ascii")
    lines = ["vt 0.5 0.5" if line.startswith("vt ") else line for line in text.splitlines()]
    (tmp_path / "a.obj").write_text("\n".join(lines), encoding="ascii")
    key, said = mesh_fault(tmp_path, tmp_path / "a.obj")
    assert key == "scene.mesh.along"
    assert "without a direction" in said


def test_a_direction_that_is_normal_to_all_that_is_seen_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n", encoding="ascii")
    key, said = mesh_fault(tmp_path, tmp_path / "a.obj", along=[0.0, 0.0, 1.0])
    assert key == "scene.mesh.along"
    assert "normal to" in said


def test_a_direction_without_a_length_is_refused(tmp_path: Path) -> None:
    key, said = mesh_fault(tmp_path, write_obj(tmp_path / "a.obj"), along=[0.0, 0.0, 0.0])
    assert key == "scene.mesh.along"
    assert "[0, 0, 0]" in said


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.obj", "v 0 0 0\n", "triangles"),
        ("a.obj", "", "mesh"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "NaN or infinity in 1 of 3"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "normals"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 2 1 0\nf 1 2 9\n", "mesh"),
        ("a.obj", "\0\1\2 no mesh at all", "mesh"),
        ("a.glb", "glTF", "cannot be read as a mesh"),
        ("a.glb", "glTF" + "x" * 100, "cannot be read as a mesh"),
        ("a.gltf", "{}", "mesh"),
        ("a.gltf", "[", "cannot be read as a mesh"),
        ("a.stl", "solid", "expected a mesh as .obj"),
        ("a.gltf", json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": "b.bin"}]}), "save it as .glb"),
    ],
)  # fmt: skip
def test_a_mesh_that_cannot_be_read_is_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text, encoding="ascii")
    key, found = mesh_fault(tmp_path, tmp_path / name, along=[1.0, 0.0, 0.0])
    assert key == "scene.mesh.path"
    assert said in found


def test_a_mesh_needs_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    key, said = mesh_fault(tmp_path, write_obj(tmp_path / "a.obj"))
    assert key == "scene.mesh.path"
    assert 'pip install "diffract-bake[scene]"' in said


def test_a_light_below_the_horizon_of_all_that_is_seen_is_refused(tmp_path: Path) -> None:
    """From above, one sees nothing of a tube that light from straight below reaches."""
    write_obj(tmp_path / "a.obj")
    above = {**CAMERA, "position": [0.0, -1.0, 200.0]}
    keys = {"lights": [LIGHT, {"theta_deg": 180.0}], "cameras": [above], "mesh": {"path": "a.obj"}}
    assert list(faults(tmp_path, **keys)) == ["scene.lights.1"]
