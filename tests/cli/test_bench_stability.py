"""`bench stability`: what it prints and writes, and its exit code where a test case misses its tolerance."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.errors import AccuracyError
from pipeline.evaluation.stability import sweep, verdict
from pipeline.evaluation.stability.sweep import StressCase
from tests.cli.tool import Tool, too_wide

_NOISE = StressCase("height", "series", "chebyshev", "float32", "noise", 10.0, (40, 48), (0.1, 0.12), 1.2)
CASES = [
    _NOISE,
    replace(_NOISE, basis="taylor", precision="float64", height_um=2.0),
    replace(_NOISE, family="window", algorithm="device", precision="float64", sigma_um=0.1),
]


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep, "cases", lambda quick: CASES[:2] if quick else CASES)


@pytest.mark.usefixtures("few")
def test_it_prints_a_row_a_family_and_the_criterion(tool: Tool) -> None:
    result = tool("bench", "stability")
    assert result.code == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines()]
    assert rows[1][:4] == ["height", "1", "1", "0"]
    assert rows[2] == ["window", "0", "1", "0"]
    assert "Chebyshev float32 at 10 um: " in result.stdout
    assert too_wide(result.stdout) == []
    assert {path.name for path in (tool.out / "stability").iterdir()} == {
        "stability.json",
        "stability.csv",
        "stability.png",
    }


@pytest.mark.usefixtures("few")
def test_files_hold_every_case(tool: Tool, tmp_path: Path) -> None:
    told = tool("bench", "stability", "--json", "--out", tmp_path / "here").json
    assert told.pop("files") == [str(tmp_path / "here" / f"stability.{kind}") for kind in ("json", "csv", "png")]
    assert json.loads((tmp_path / "here" / "stability.json").read_text(encoding="utf-8")) == told
    with (tmp_path / "here" / "stability.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert (
        [row["verdict"] for row in rows]
        == [case["verdict"] for case in told["cases"]]
        == ["holds", "refused", "refused"]
    )
    assert (rows[0]["shape"], rows[0]["pitch_um"]) == ("40 x 48", "0.1 x 0.12")
    assert (tmp_path / "here" / "stability.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("few")
def test_quick_is_a_part(tool: Tool) -> None:
    assert len(tool("bench", "stability", "--quick", "--json").json["cases"]) == 2


@pytest.mark.usefixtures("few")
def test_a_case_that_misses_ends_in_code_4(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdict, "CHEBYSHEV_TOLERANCE", 1e-9)
    result = tool("bench", "stability")
    assert result.code == AccuracyError.exit_code
    assert len(result.errors) == 1
    assert "series, chebyshev float32, noise of 10 um, 40 x 48 samples of 0.1 x 0.12 um" in result.errors[0]
    assert "expected ≤ 1e-09" in result.errors[0]
    # what was found is written all the same
    assert (tool.out / "stability" / "stability.csv").is_file()


def test_a_criterion_not_met_ends_in_code_4(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    low = [CASES[0], replace(CASES[1], height_um=2.0, kind="flat")]
    monkeypatch.setattr(sweep, "cases", lambda _quick: low)
    result = tool("bench", "stability")
    assert result.code == AccuracyError.exit_code
    assert "Taylor float64 at 2 um: " in result.errors[0]
