"""`render`: maps of any light, the right way round."""

import numpy as np
import pytest
from PIL import Image

from pipeline.report import images
from tests.cli.tool import Tool, recipe

SIZE = 65


@pytest.fixture(scope="module")
def mirror(tmp_path_factory: pytest.TempPathFactory) -> Tool:
    folder = tmp_path_factory.mktemp("mirror")
    tool = Tool(folder, folder / "store")
    tool.config("mirror.toml", name="mirror", surface=recipe("mirror"), render={"exposure_ru": 1})
    return tool


def direction_of(row: int, column: int) -> tuple[float, float]:
    """(x, y) of a pixel's centre, +y up."""
    return (2 * column + 1) / SIZE - 1.0, 1.0 - (2 * row + 1) / SIZE


@pytest.mark.parametrize("exact", [False, True], ids=["table", "reference"])
@pytest.mark.parametrize(
    ("phi", "x", "y"), [(0, -0.5, 0.0), (90, 0.0, -0.5), (180, 0.5, 0.0), (-90, 0.0, 0.5), (45, -0.354, -0.354)]
)
def test_a_mirror_shows_the_light_opposite(mirror: Tool, phi: int, x: float, y: float, exact: bool) -> None:
    more = ["--exact"] if exact else []
    result = mirror("render", "mirror.toml", "--theta", "30", "--phi", str(phi), "--size", str(SIZE), *more)
    assert result.code == 0, result.stderr
    stem = f"map_theta30_phi{phi}" + ("_exact" if exact else "")
    assert result.stdout.splitlines() == [f"out/mirror/{stem}.exr", f"out/mirror/{stem}.png"]
    luminance = images.read_xyz(mirror.out / "mirror" / f"{stem}.exr")[..., 1]
    assert luminance.shape == (SIZE, SIZE)
    row, column = np.unravel_index(np.argmax(luminance), luminance.shape)
    # within a pixel
    np.testing.assert_allclose(direction_of(int(row), int(column)), (x, y), atol=2 / SIZE)
    with Image.open(mirror.out / "mirror" / f"{stem}.png") as png:
        pixels = np.asarray(png.convert("L"))
    assert pixels[row, column] == pixels.max() > 0
    lower_half = pixels[SIZE // 2 + 1 :].max() > pixels[: SIZE // 2].max()
    assert lower_half == (y < 0) or y == 0


def test_only_the_reference_skips_the_table(mirror: Tool, tool: Tool) -> None:
    result = tool("render", mirror.folder / "mirror.toml", "--exact", "--size", "16")
    assert result.code == 0
    assert list(tool.artifacts()) == ["surface"]


def test_the_configs_own_lights(baked: Tool, tool: Tool) -> None:
    result = baked("render", "small.toml", "--out", tool.out, "--json")
    assert result.json == {"files": [str(tool.out / "small" / f"map_theta0_phi0.{end}") for end in ("exr", "png")]}
    for end in ("exr", "png"):
        name = f"map_theta0_phi0.{end}"
        assert (tool.out / "small" / name).read_bytes() == (baked.out / "small" / name).read_bytes()


def test_size_and_exposure(baked: Tool, tool: Tool) -> None:
    for exposure in ("1", "5000"):
        out = tool.folder / exposure
        assert baked("render", "small.toml", "--size", "20", "--exposure", exposure, "--out", out).code == 0
    shown = []
    for exposure in ("1", "5000"):
        with Image.open(tool.folder / exposure / "small" / "map_theta0_phi0.png") as png:
            assert png.size == (20, 20)
            shown.append(np.asarray(png).astype(int))
    assert shown[1].sum() > shown[0].sum()


def test_table_and_reference_look_alike(mirror: Tool) -> None:
    for more in ([], ["--exact"]):
        assert mirror("render", "mirror.toml", "--theta", "0", "--size", str(SIZE), *more).code == 0
    table, exact = (images.read_xyz(mirror.out / "mirror" / f"map_theta0_phi0{s}.exr") for s in ("", "_exact"))
    assert np.abs(table - exact).max() < 0.1 * exact.max()
