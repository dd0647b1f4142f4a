"""`plan`: what run would do, and that it does nothing of it."""

from tests.cli.tool import Tool

STAGES = ["surface", "stack", "table", "textures", "render", "validate", "bundle"]


def test_of_an_empty_store_all_is_to_do_and_nothing_is_written(tool: Tool) -> None:
    result = tool("plan", tool.config())
    assert result.code == 0
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines[0] == "small:"
    assert lines[1].split() == ["stage", "state", "peak", "cost"]
    assert [line.split()[:3] for line in lines[2:9]] == [[stage, "to", "do"] for stage in STAGES]
    assert lines[9:16] == [f"{stage}: not made before" for stage in STAGES]
    assert sorted(path.name for path in tool.folder.iterdir()) == ["small.toml"]


def test_after_a_run_all_is_cached(baked: Tool) -> None:
    printed = baked("plan", "small.toml", "--json").json
    assert list(printed) == ["small"]
    assert [step["stage"] for step in printed["small"]] == STAGES
    assert {step["state"] for step in printed["small"]} == {"cached"}
    assert {step["stage"]: [step["key"]] for step in printed["small"]} == baked.artifacts()
    assert all("last time" in step["cost"] for step in printed["small"])


def test_a_changed_key_is_named_with_both_values_and_its_consequences(copy: Tool) -> None:
    before = copy.artifacts()
    steps = {s["stage"]: s for s in copy("plan", copy.config(table={"tolerance": 0.01}), "--json").json["small"]}
    assert [steps[stage]["state"] for stage in STAGES] == ["cached", *["to do"] * 6]
    assert steps["stack"]["reason"] == "changed: tolerance 0.0001 -> 0.01"
    assert steps["table"]["reason"] == "changed: table.tolerance 0.0001 -> 0.01"
    assert steps["render"]["reason"] == "its input will be made: table, textures"
    assert steps["validate"]["reason"] == "its input will be made: render, stack, table, textures"
    assert copy.artifacts() == before


def test_a_change_of_a_late_stage_keeps_the_early_ones(copy: Tool) -> None:
    printed = copy("plan", copy.config(render={"size": 48}))
    states = {line.split()[0]: line for line in printed.stdout.splitlines()[2:8]}
    assert all("cached" in states[stage] for stage in ("surface", "stack", "table"))
    assert "render: changed: render.size 32 -> 48" in printed.stdout.splitlines()


def test_several_configs(baked: Tool, tool: Tool) -> None:
    other = tool.config(name="other")
    assert list(baked("plan", "small.toml", other, "--json").json) == ["small", "other"]
