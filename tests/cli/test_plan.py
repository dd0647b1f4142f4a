"""`plan`: what run would do, and that it does nothing of it."""

import math

from tests.cli.tool import Tool

STAGES = ["surface", "stack", "table", "textures", "render", "validate", "bundle"]


def test_of_an_empty_store_all_is_to_do_and_nothing_is_written(tool: Tool) -> None:
    result = tool("plan", tool.config())
    assert result.code == 0
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines[0] == "small:"
    assert lines[1].split() == ["stage", "state", "time", "peak", "bytes", "work"]
    assert [line.split()[:3] for line in lines[2:9]] == [[stage, "to", "do"] for stage in STAGES]
    assert lines[9:16] == [f"{stage}: not made before" for stage in STAGES]
    assert lines[16].startswith("in all: about ")
    assert "unknown" not in result.stdout
    # nothing but the pace of this machine is kept
    assert not tool.artifacts()


def test_after_a_run_all_is_cached(baked: Tool) -> None:
    printed = baked("plan", "small.toml", "--json").json
    assert list(printed) == ["small"]
    assert [step["stage"] for step in printed["small"]] == STAGES
    assert {step["state"] for step in printed["small"]} == {"cached"}
    assert {step["stage"]: [step["key"]] for step in printed["small"]} == baked.artifacts()


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


def test_every_stage_has_a_prediction_before_it_was_ever_made(tool: Tool) -> None:
    steps = {step["stage"]: step for step in tool("plan", tool.config(), "--json").json["small"]}
    for step in steps.values():
        assert step["seconds"] > 0.0
        assert step["bytes"] >= 0
        assert step["peak_bytes"] > 2**20
    assert steps["table"]["bytes"] > 0


def test_a_run_shows_predicted_beside_actual_cost_and_the_next_prediction_learns_of_it(tool: Tool) -> None:
    path = tool.config()
    found = tool("run", path, "--explain", "--json").json[0]["stages"]
    took = {stage: each["actual"]["seconds"] for stage, each in found.items()}
    assert all(each["predicted"]["seconds"] > 0.0 for each in found.values())
    assert found["surface"]["actual"]["bytes"] > 0
    for step in tool("plan", path, "--json").json["small"]:
        before, now = found[step["stage"]]["predicted"]["seconds"], step["seconds"]
        # a correction is limited to a factor of ten
        assert math.isclose(now, min(10.0 * before, max(0.1 * before, took[step["stage"]])), rel_tol=0.05)
    lines = tool("run", path, "--explain").stdout.splitlines()
    assert lines[0].split()[:3] == ["stage", "predicted", "actual"]
    assert sum("cached" in line for line in lines) == len(STAGES)
