"""Several configs in one command: one that fails among them, the summary, and the exit code."""

import re
import subprocess
from typing import Any

import pytest

from pipeline.config.models import Config
from pipeline.stages import run
from pipeline.store.store import Artifact
from tests.cli.tool import REPOSITORY, Tool, recipe

COLUMNS = ["config", "verdict", "mean dE", "seconds", "made", "cached", "result"]
# too high for the paper's tables, which the stage after the surface finds
HIGH = recipe("sinusoid", amplitude_um=0.6)
LOW = recipe("sinusoid", amplitude_um=0.01)


def rows(stdout: str) -> list[list[str]]:
    return [re.split(r" {2,}", line) for line in stdout.splitlines()]


def test_a_config_that_fails_between_others_stops_none_of_them(copy: Tool) -> None:
    """Its line is printed where it fails, with its name, and again in the summary, which keeps the order given."""
    later, high = copy.config("u.toml", name="u", surface=LOW), copy.config("t.toml", name="t", surface=HIGH)
    result = copy("run", later, high, "small.toml", "--until", "table")
    assert result.code == 4
    (error,) = result.errors
    assert error.startswith("error: t: ")
    begun = [line for line in result.stderr.splitlines() if re.fullmatch(r"\w+ \(.*\):|error: t: .*", line)]
    assert begun == ["small (1 of 3):", "t (2 of 3):", error, "u (3 of 3):"]
    header, *shown = rows(result.stdout)
    assert header == COLUMNS
    assert [row[:2] for row in shown] == [["u", "ok"], ["t", "failed"], ["small", "ok"]]
    assert [row[4:] for row in shown] == [
        ["3", "0", "-"],
        ["1", "0", f"exit code 4: {error.removeprefix('error: t: ')}"],
        ["0", "3", "-"],
    ]
    assert float(shown[0][2]) > 0.0
    assert not (copy.out / "t").exists()

    printed = copy("run", "small.toml", high, later, "--until", "table", "--json")
    assert printed.code == 4
    assert [document["name"] for document in printed.json] == ["small", "t", "u"]
    assert [document["error"] for document in printed.json] == [
        None,
        {"code": 4, "lines": [error.removeprefix("error: t: ")]},
        None,
    ]
    assert [list(document["stages"]) for document in printed.json] == [
        ["surface", "stack", "table"],
        ["surface"],
        ["surface", "stack", "table"],
    ]
    assert all(stage["cached"] for document in printed.json for stage in document["stages"].values())
    assert all(document["seconds"] >= 0.0 for document in printed.json)


def test_a_missed_budget_has_results_and_the_first_failure_given_decides_the_exit_code(
    copy: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What goes wrong inside one config is a line, too."""
    execute = run.execute

    def executed(config: Config, *arguments: Any) -> dict[str, Artifact]:
        return execute(config, *arguments) if config.name != "z" else {}[config.name]

    monkeypatch.setattr(run, "execute", executed)
    strict = copy.config("strict.toml", name="strict", accuracy={"delta_e": 1e-3})
    broken = copy.config("z.toml", name="z")
    result = copy("run", broken, strict, "small.toml")
    assert result.code == 1
    fault, missed = result.errors
    assert fault.startswith("error: z: internal fault, please report it: KeyError: 'z' (")
    assert missed.startswith("error: strict: accuracy.delta_e asks for 0.001 at 7500 RU, measured ")
    verdicts = {row[0]: row for row in rows(result.stdout)}
    assert [verdicts[name][1] for name in ("z", "strict", "small")] == ["failed", "missed", "ok"]
    assert verdicts["small"][-1] == f"out/small/{copy.bundle().name}"
    assert copy("verify", copy.bundle("strict")).code == 0
    assert copy("run", strict, broken, "small.toml").code == 4


def test_a_faulty_config_stops_all_before_any_work(tool: Tool) -> None:
    good, faulty = tool.config(), tool.config("faulty.toml", name="faulty", coherence={"sigma_um": -1})
    result = tool("run", good, faulty)
    assert result.code == 2
    assert result.stdout == ""
    assert tool.artifacts() == {}
    again = tool("run", good, tool.config("again.toml"))
    assert again.code == 2
    assert "'small' is also the name of" in again.errors[0]


def test_make_pipeline_without_a_config_bakes_all() -> None:
    command = ["make", "-C", str(REPOSITORY), "-n", "pipeline"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    (line,) = [line for line in printed.splitlines() if "diffract-bake run" in line]
    configs = sorted(path.relative_to(REPOSITORY).as_posix() for path in (REPOSITORY / "configs").glob("*.toml"))
    assert line.split()[2:-2] == configs
