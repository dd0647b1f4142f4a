"""`bench speed`: what it prints and writes, on small surfaces."""

import csv
import json

import pytest

from cli.sources import load
from pipeline.evaluation.speed.bench import built_in
from tests.cli.tool import Result, Tool, recipe

pytestmark = [pytest.mark.slow, pytest.mark.alone]


@pytest.fixture(scope="module")
def benched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Tool, Result]:
    folder = tmp_path_factory.mktemp("benched")
    tool = Tool(folder, folder / "store")
    result = tool("bench", "speed", tool.config(surface=recipe("gaussian")), "--quick", "--json", "--out", "figures")
    assert result.code == 0, result.stderr
    return tool, result


def test_it_writes_what_it_measured(benched: tuple[Tool, Result]) -> None:
    tool, result = benched
    folder = tool.folder / "figures"
    names = ["curve.csv", "curve.png", "speed.csv", "speed.json", "speed.png"]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in ("curve.png", "speed.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    document = json.loads((folder / "speed.json").read_text(encoding="utf-8"))
    assert document == {key: value for key, value in result.json.items() if key != "files"}
    rows = list(csv.DictReader((folder / "speed.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == len(document["surfaces"][0]["points"])
    assert all(float(row["seconds"]) > 0 and float(row["mean_delta_e"]) >= 0 for row in rows)


def test_the_algorithms_agree(benched: tuple[Tool, Result]) -> None:
    surface = benched[1].json["surfaces"][0]
    assert surface["agreement"]["numpy"]["median"] < 1e-3
    if surface["agreement"]["nufft"] is not None:
        assert surface["agreement"]["nufft"]["median"] < 1e-3


def test_the_stacks_transforms_are_the_same_by_every_library(benched: tuple[Tool, Result]) -> None:
    single, double = benched[1].json["surfaces"][0]["transforms"]
    assert (single["precision"], double["precision"]) == ("single", "double")
    for of, tolerance in ((single, 1e-6), (double, 1e-14)):
        assert min(of[f"{route}_s"] for route in ("kernel", "fftw", "scipy")) > 0.0
        assert max(of["fftw_difference"], of["scipy_difference"]) < tolerance


def test_every_criterion_has_a_verdict(benched: tuple[Tool, Result]) -> None:
    checks = benched[1].json["checks"]
    assert {check["source"] for check in checks} == {f"criterion {number}" for number in range(1, 8)}
    assert {check["verdict"] for check in checks} <= {"holds", "misses", "reported", "not measured"}
    assert all((check["value"] is None) == (check["verdict"] == "not measured") for check in checks)
    ids = [check["id"] for check in checks]
    assert len(set(ids)) == len(ids)
    assert {"small.speed.mean_error", "small.speed.second_light", "stability.taylor_float64_at_2_um"} <= set(ids)


def test_the_curve_has_the_cost_of_every_stage(benched: tuple[Tool, Result]) -> None:
    tool, result = benched
    (size,) = result.json["curve"]["sizes"]
    assert (size["side"], size["sigma_um"], size["windows"], size["growth"]) == (512, 6.25, 1, None)
    assert [stage["stage"] for stage in size["cost"]["stages"]] == ["surface", "power_spectrum", "table"]
    assert sum(stage["seconds"] for stage in size["cost"]["stages"]) < size["cost"]["seconds"]
    (row,) = csv.DictReader((tool.folder / "figures" / "curve.csv").read_text(encoding="utf-8").splitlines())
    for stage in size["cost"]["stages"]:
        assert 50.0 < float(row[f"{stage['stage']}_mib"]) < 1000.0
        assert float(row[f"{stage['stage']}_s"]) == pytest.approx(stage["seconds"], rel=1e-3)


def test_shares_are_shares(benched: tuple[Tool, Result]) -> None:
    timed = benched[1].json["surfaces"][0]["timed"]
    assert {"stack", "power spectrum", "apply_operator", "paper table"} <= {stage["stage"] for stage in timed}
    assert all(0.0 < stage["bound_share"] < 1.5 for stage in timed)


def test_a_tall_surface_has_no_paper_tables(tool: Tool) -> None:
    """They would lose their digits: that is said, and everything else is measured."""
    tall = recipe("gaussian", sigma_h_um=0.3)
    result = tool("bench", "speed", tool.config(surface=tall), "--quick")
    assert result.code == 0, result.stderr
    assert "no tables of the paper's" in result.stdout
    assert "polar table in plain numpy" in result.stdout
    assert "terms, single" in result.stdout
    assert "terms, double" in result.stdout
    assert "512^2, 25 um" in result.stdout


def test_built_in_surfaces_are_sound() -> None:
    with built_in() as paths:
        assert [load(path).name for path in paths] == ["elaphe", "xenopeltis", "blazed"]


def test_a_folder_that_cannot_be_written_is_told(tool: Tool) -> None:
    (tool.folder / "taken").write_text("", encoding="utf-8")
    result = tool("bench", "speed", tool.config(), "--quick", "--out", "taken")
    assert result.code in (2, 7)
    assert "taken" in result.stderr
