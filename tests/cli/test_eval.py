"""`eval`: radiance for directions, from a bundle, a table or the reference."""

from collections.abc import Iterable

import numpy as np
import pytest

from tests.cli.tool import Result, Tool

HEADER = "theta_i,phi_i,theta_r,phi_r\n"


def rows(values: Iterable[Iterable[float]]) -> str:
    return "".join(",".join(f"{value:.6f}" for value in row) + "\n" for row in values)


def directions(count: int) -> str:
    rng = np.random.default_rng(7)
    angles = np.stack([80 * rng.random(count), 360 * rng.random(count)] * 2, axis=-1)
    angles[:, 2] = 80 * rng.random(count)
    return rows(angles)


def xyz(result: Result) -> np.ndarray:
    assert result.code == 0, result.stderr
    header, *lines = result.stdout.splitlines()
    assert header == "X,Y,Z"
    return np.array([[float(value) for value in line.split(",")] for line in lines])


def ask(tool: Tool, *arguments: object, text: str) -> Result:
    return tool("eval", *map(str, arguments), "--directions", "-", stdin=text)


def test_bundle_and_config_agree(baked: Tool) -> None:
    asked = HEADER + directions(200)
    from_bundle, from_config = (xyz(ask(baked, s, text=asked)) for s in (baked.bundle(), "small.toml"))
    assert from_bundle.shape == (200, 3)
    assert (from_bundle[:, 1] > 0).any()
    np.testing.assert_allclose(from_bundle, from_config, rtol=1e-9, atol=1e-9 * from_config.max())


def test_a_node_of_the_table_is_the_reference(tool: Tool) -> None:
    """The mirror direction is a node for every light, w still varies, and both integrate every nanometre: what is
    left is the table's own error, 1e-4 of the local value (docs/accuracy.md, "Numerical range")."""
    config = tool.config(table={"step_nm": 1.0})
    asked = rows([(theta, 20, theta, 200) for theta in (0, 10, 30, 50, 70)])
    table, exact = xyz(ask(tool, config, text=asked)), xyz(ask(tool, config, "--exact", text=asked))
    np.testing.assert_allclose(table, exact, rtol=1e-4)


def test_a_fine_table_is_close_to_the_reference(tool: Tool) -> None:
    """Off the nodes a bilinear look-up errs by the curvature within a cell, where the lobes of orders are steep.
    501 nodes a side (the default) leave about 0.5 % of the brightest value asked for here; 2 % is allowed."""
    config = tool.config(table={"step_nm": 1.0, "resolution": 501})
    asked = rows([(0, 0, theta, 0) for theta in np.arange(1.0, 40.0, 1.5)])
    table, exact = xyz(ask(tool, config, text=asked)), xyz(ask(tool, config, "--exact", text=asked))
    assert np.abs(table - exact).max() < 0.02 * exact.max()


def test_header_comments_and_blank_lines_are_optional(baked: Tool) -> None:
    (baked.folder / "plain.csv").write_text("0,0,13,0\n30,0,30,180\n", encoding="utf-8")
    plain = xyz(baked("eval", "small.toml", "--directions", "plain.csv"))
    dressed = f"# two pairs\n\n{HEADER}0, 0, 13, 0  # first\n\n30,0,30,180\n"
    np.testing.assert_array_equal(xyz(ask(baked, "small.toml", text=dressed)), plain)
    (baked.folder / "plain.csv").unlink()


def test_json(baked: Tool) -> None:
    asked = "0,0,13,0\n30,0,30,180\n"
    printed = ask(baked, "small.toml", "--json", text=asked).json
    assert [list(row) for row in printed] == [["X", "Y", "Z"]] * 2
    found = np.array([list(row.values()) for row in printed])
    np.testing.assert_allclose(found, xyz(ask(baked, "small.toml", text=asked)), rtol=1e-11)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,0,10,0\n0,0,10\n", "-: line 2: expected four numbers"),
        ("0,0,10,0\n\n0,0,ten,0\n", "-: line 3: expected four numbers"),
        ("0,0,181,0\n", "-: line 1: expected theta in [0, 180]"),
        ("0,0,-1,0\n", "-: line 1: expected theta in [0, 180]"),
        ("0,nan,10,0\n", "-: line 1: expected theta in [0, 180]"),
        ("0,0,10,inf\n", "-: line 1: expected theta in [0, 180]"),
        (f"0,0,1,0\n{HEADER}", "-: line 2: expected four numbers"),
        (f"{HEADER}", "-: expected rows of theta_i,phi_i,theta_r,phi_r in degrees, got none"),
        ("", "got none"),
    ],
)
def test_faults_of_the_csv_name_their_line(baked: Tool, text: str, message: str) -> None:
    result = ask(baked, "small.toml", text=text)
    assert result.code == 3
    assert result.stdout == ""
    (line,) = result.errors
    assert message in line


def test_a_csv_that_is_none(baked: Tool, tool: Tool) -> None:
    (tool.folder / "d.csv").write_bytes(b"\xff\xfe\x00\x01")
    for name in ("d.csv", "none.csv", "."):
        result = tool("eval", baked.bundle(), "--directions", name)
        assert result.code == 3, name
        assert "cannot be read as text" in result.errors[0]


def test_outside_the_scene_is_said(tool: Tool) -> None:
    scene = {"lights": [{"theta_deg": 0}], "views": {"theta_max_deg": 20}}
    config = tool.config(scene=scene)
    assert xyz(ask(tool, config, text="0,0,15,0\n")).shape == (1, 3)
    result = ask(tool, config, text="0,0,15,0\n0,0,70,0\n60,0,70,0\n")
    assert result.code == 3
    assert result.stdout == ""
    assert "2 of the directions of - are outside the [scene]" in result.errors[0]
    rendered = tool("render", config, "--theta", "70")
    assert rendered.code == 3
    assert "the light 70°, 0° are outside the [scene]" in rendered.errors[0]
    assert not tool.out.exists()


def test_a_bundle_has_no_reference(baked: Tool) -> None:
    result = ask(baked, baked.bundle(), "--exact", text="0,0,10,0\n")
    assert result.code == 2
    assert "--exact needs a config" in result.stderr
