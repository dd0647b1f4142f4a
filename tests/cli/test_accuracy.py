"""Accuracy that cannot be had, or was not: code 4, with the error and the way out."""

import re

from tests.cli.tool import Tool, recipe


def test_a_surface_too_tall_for_the_series_is_refused(tool: Tool) -> None:
    result = tool("run", tool.config(surface=recipe("elaphe", height_um=1.0)))
    assert result.code == 4
    assert result.stdout == ""
    (line,) = result.errors
    assert re.search(r"would err by [0-9.]+e[+-]\d+ of \|P\|\^2", line)
    assert "table.tolerance asks for 1.0e-04" in line
    assert "Lower the heights" in line
    assert "Traceback" not in result.stderr
    # what was made before the refusal is sound and stays; nothing is shown
    assert list(tool.artifacts()) == ["surface"]
    assert not tool.out.exists()
    assert list(tool.store.glob("tmp/*")) == []


def test_too_few_terms_are_refused_with_the_other_remedy(tool: Tool) -> None:
    result = tool("run", tool.config(table={"terms": 2}))
    assert result.code == 4
    assert 'Set table.terms = "auto", or a higher number' in result.errors[0]


def test_a_missed_budget_fails_after_all_is_written(copy: Tool) -> None:
    result = copy("run", copy.config(accuracy={"delta_e": 0.001}), "--out", "missed")
    assert result.code == 4
    (line,) = result.errors
    assert re.search(
        r"small: accuracy\.delta_e asks for 0\.001 at 7500 RU, measured [0-9.]+\. Raise the budget", line
    )
    shown = {path.name for path in (copy.folder / "missed" / "small").iterdir()}
    assert {"map_theta0_phi0.exr", "map_theta0_phi0.png", "report.html"} < shown
    assert any(name.startswith("small-1.0.0+") for name in shown)
    assert "report.html" in result.stdout
    # a second run finds all cached and still fails
    again = copy("run", "small.toml", "--out", "missed", "--json")
    assert again.code == 4
    assert again.json[0]["stages"]["validate"]["summary"]["budget"]["met"] is False
    assert again.errors == result.errors


def test_a_budget_that_is_met_passes(baked: Tool) -> None:
    budget = baked("run", "small.toml", "--json").json[0]["stages"]["validate"]["summary"]["budget"]
    assert budget["met"] is True
    assert 0.0 < budget["measured"] < budget["delta_e"] == 50.0
