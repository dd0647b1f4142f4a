"""`inspect`: scans, configs and bundles; what a config still needs."""

import json
import math

import numpy as np
import pytest
from PIL import Image

from tests.cli.tool import REPOSITORY, Tool

SCAN = REPOSITORY / "configs" / "example_scan.txt"


def test_a_scan_with_units(tool: Tool) -> None:
    found = tool("inspect", SCAN, "--json").json
    assert found["file"] == "example_scan.txt"
    assert found["channel"] == "Topography"
    assert (found["samples"], found["holes"]) == ("160 x 160", 0)
    assert found["pitch_um"] == [0.1, 0.1]
    assert found["um_per_unit"] == 1e6
    assert found["config needs"] == []
    assert found["lowest"] < found["highest"]


def test_text_for_people_tells_the_same(tool: Tool) -> None:
    result = tool("inspect", SCAN)
    assert (result.code, result.stderr) == (0, "")
    printed = {line[:16].strip(): line[17:] for line in result.stdout.splitlines()}
    found = tool("inspect", SCAN, "--json").json
    assert printed == {key: v if isinstance(v, str) else json.dumps(v) for key, v in found.items()}


@pytest.mark.parametrize(
    ("name", "needs"),
    [
        ("scan.npy", ["surface.pitch_um", "surface.height_unit"]),
        ("scan.txt", ["surface.pitch_um", "surface.height_unit"]),
        ("scan.png", ["surface.pitch_um", "surface.height_range_um"]),
    ],
)
def test_the_keys_it_asks_for_are_the_keys_that_bake(tool: Tool, name: str, needs: list[str]) -> None:
    heights = 100 + 20 * np.sin(np.arange(100) / 3)[None, :] * np.cos(np.arange(100) / 5)[:, None]
    path = tool.folder / name
    if name.endswith("npy"):
        np.save(path, heights)
    elif name.endswith("txt"):
        np.savetxt(path, heights, fmt="%.3f")
    else:
        Image.fromarray(np.uint8(heights)).save(path)
    assert tool("inspect", path, "--json").json["config needs"] == needs
    values = {"surface.pitch_um": 0.1, "surface.height_unit": "nm", "surface.height_range_um": 0.1}
    keys = {key.removeprefix("surface."): values[key] for key in needs}
    config = tool.config(surface={"path": name, **keys})
    assert tool("render", config, "--exact", "--size", "16").code == 0


def test_holes_of_a_scan_without_a_height(tool: Tool) -> None:
    np.save(tool.folder / "scan.npy", np.full((9, 10), np.nan))
    found = tool("inspect", "scan.npy", "--json").json
    assert (found["samples"], found["holes"], found["lowest"]) == ("10 x 9", 90, None)


def test_what_was_not_measured(tool: Tool) -> None:
    rng = np.random.default_rng(0)
    heights = rng.standard_normal((40, 50))
    heights[30:] = 0.0
    heights[5, 6:9] = -9999
    np.save(tool.folder / "scan.npy", heights)
    found = tool("inspect", "scan.npy", "--json").json
    assert (found["samples"], found["holes"]) == ("50 x 40", 503)
    assert found["cropped"] == {"bottom": 0, "top": 10, "left": 0, "right": 0}
    assert found["not measured"] == [
        "no-data number (-9999): 3 samples, 0.15 %",
        "rows of one value (0): 500 samples, 25 %",
    ]
    assert found["lowest"] > -6
    (warning,) = found["warnings"]
    assert warning.startswith("25 % of the scan was not measured")
    assert "10 rows at the top cropped" in warning
    assert found["mask covers"] == 0.0


def test_a_config_with_its_defaults(baked: Tool) -> None:
    found = baked("inspect", "small.toml", "--json").json
    assert found["table"] == {
        "layout": "taylor",
        "resolution": 41,
        "power": 5.0,
        "terms": "auto",
        "step_nm": 5.0,
        "tolerance": 1e-4,
    }
    assert found["publish"]["version"] == "1.0.0"
    assert baked("inspect", "small.toml").stdout.startswith("name             small\n")


def test_a_bundle(baked: Tool) -> None:
    found = baked("inspect", baked.bundle(), "--json").json
    assert found == json.loads((baked.bundle() / "manifest.json").read_text(encoding="utf-8"))
    assert "licence          not stated" in baked("inspect", baked.bundle()).stdout


def test_a_scan_that_run_refuses_says_so(tool: Tool) -> None:
    np.save(tool.folder / "flat.npy", np.full((32, 32), 3.0))
    (flat,) = tool("inspect", "flat.npy", "--json").json["warnings"]
    assert flat.startswith("flat.npy: expected heights that vary, found the same height everywhere; for a mirror use")
    heights = "\n".join(" ".join(f"{(i * j) % 7}" for j in range(32)) for i in range(32))
    (tool.folder / "far.txt").write_text(f"# Width: 32 m\n# Height: 32 m\n# Value units: nm\n{heights}\n")
    (far,) = tool("inspect", "far.txt", "--json").json["warnings"]
    assert "expected a pitch within 0.0001..100 um, found 1e+06 x 1e+06 um" in far
    np.save(tool.folder / "good.npy", np.arange(1024.0).reshape(32, 32))
    assert tool("inspect", "good.npy", "--json").json["warnings"] == []


def test_files_that_cannot_be_inspected(tool: Tool) -> None:
    assert tool("inspect", "none").code == 2
    assert tool("inspect", tool.folder).code == 6
    (tool.folder / "odd.bin").write_bytes(bytes(range(256)))
    result = tool("inspect", "odd.bin")
    assert result.code == 3
    assert len(result.errors) == 1
    (tool.folder / "odd.toml").write_text("colour = 1", encoding="utf-8")
    assert tool("inspect", "odd.toml").code == 2
    result = tool("inspect", SCAN, "--channel", "Phase")
    assert result.code == 3
    assert "only 'Topography'" in result.errors[0]


def test_the_formats_are_listed(tool: Tool) -> None:
    listed = tool("inspect", "--formats")
    assert listed.code == 0
    assert {".x3p", ".sur", ".gsf", ".spm"} <= set(listed.stdout.split())
    keys = [entry["key"] for entry in tool("inspect", "--formats", "--json").json]
    assert len(keys) == len(listed.stdout.splitlines())
    assert tool("inspect", SCAN, "--formats").code == 2


def test_what_a_scene_visits_is_drawn_and_counted(tool: Tool) -> None:
    """A cone of views about one light visits the disc of its radius about -wi."""
    config = tool.config(scene={"lights": [{"theta_deg": 30}], "views": {"theta_max_deg": 40}})
    picture = tool.folder / "scene.png"
    result = tool("inspect", config, "--picture", picture, "--json")
    visited = json.loads(result.stdout)["visited"]
    assert result.code == 0
    assert visited["rho_max"] == pytest.approx(0.5 + math.sin(math.radians(40)))
    assert visited["disc_share"] == pytest.approx((math.sin(math.radians(40)) / 2) ** 2, rel=0.15)
    assert math.cos(math.radians(30)) + math.cos(math.radians(40)) == pytest.approx(visited["w"][0], abs=0.01)
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_a_picture_needs_a_scene(tool: Tool) -> None:
    result = tool("inspect", tool.config(), "--picture", tool.folder / "scene.png")
    assert result.code == 2
    assert "has none" in result.stderr
