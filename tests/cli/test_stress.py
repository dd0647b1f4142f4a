"""`stress`: what it prints and writes, and its exit code where a cell is wrong."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.errors import AccuracyError
from pipeline.evaluation.stability import judging, sweep
from pipeline.evaluation.stability.cell import Cell
from tests.cli.tool import Tool, too_wide

_NOISE = Cell("height", "series", "chebyshev", "float32", "noise", 10.0, (40, 48), (0.1, 0.12), 1.2)
CELLS = [
    _NOISE,
    replace(_NOISE, basis="taylor", precision="float64", height_um=2.0),
    replace(_NOISE, family="window", way="device", precision="float64", sigma_um=0.1),
]


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep, "cells", lambda quick: CELLS[:2] if quick else CELLS)


@pytest.mark.usefixtures("few")
def test_it_prints_a_row_a_family_and_the_criterion(tool: Tool) -> None:
    result = tool("stress")
    assert result.code == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines()]
    assert rows[1][:4] == ["height", "1", "1", "0"]
    assert rows[2] == ["window", "0", "1", "0"]
    assert "Chebyshev float32 at 10 um: " in result.stdout
    assert too_wide(result.stdout) == []
    assert {path.name for path in (tool.out / "stress").iterdir()} == {"stress.json", "stress.csv", "stress.png"}


@pytest.mark.usefixtures("few")
def test_files_hold_every_cell(tool: Tool, tmp_path: Path) -> None:
    told = tool("stress", "--json", "--out", tmp_path / "here").json
    assert json.loads((tmp_path / "here" / "stress.json").read_text(encoding="utf-8")) == told
    with (tmp_path / "here" / "stress.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert (
        [row["verdict"] for row in rows]
        == [cell["verdict"] for cell in told["cells"]]
        == ["ok", "refused", "refused"]
    )
    assert (rows[0]["shape"], rows[0]["pitch_um"]) == ("40 x 48", "0.1 x 0.12")
    assert (tmp_path / "here" / "stress.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("few")
def test_quick_is_a_part(tool: Tool) -> None:
    assert len(tool("stress", "--quick", "--json").json["cells"]) == 2


@pytest.mark.usefixtures("few")
def test_a_wrong_cell_is_told_and_ends_in_code_4(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging, "CHEBYSHEV_TOLERANCE", 1e-9)
    result = tool("stress")
    assert result.code == AccuracyError.exit_code
    assert len(result.errors) == 1
    assert "series, chebyshev float32, noise of 10 um, 40 x 48 samples of 0.1 x 0.12 um" in result.errors[0]
    assert "promised 1.0e-09" in result.errors[0]
    # what was found is written all the same
    assert (tool.out / "stress" / "stress.csv").is_file()


def test_a_criterion_not_met_ends_in_code_4(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    low = [CELLS[0], replace(CELLS[1], height_um=2.0, kind="flat")]
    monkeypatch.setattr(sweep, "cells", lambda _quick: low)
    result = tool("stress")
    assert result.code == AccuracyError.exit_code
    assert "Taylor float64 has failed" in result.errors[0]
