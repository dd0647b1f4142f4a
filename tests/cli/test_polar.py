"""The polar layout through the command line: what is cached, what is reused, what is refused."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.tool import SMALL, Tool, temporary_files, toml

pytestmark = pytest.mark.slow

STAGES = ["surface", "power_spectrum", "table", "textures", "render", "validate", "bundle"]
POLAR: dict[str, Any] = {
    **SMALL,
    "surface": {"recipe": {"kind": "elaphe", "size_um": 10, "pitch_um": 0.1}},
    "coherence": {"sigma_um": 2.0, "windows": "centre"},
    "spectrum": {"range_nm": [500, 600]},
    "table": {"layout": "polar"},
    "accuracy": {"delta_e": 0.5},
}


def write(tool: Tool, **sections: Any) -> Path:
    document = {**POLAR}
    for name, keys in sections.items():
        document[name] = {**POLAR.get(name, {}), **keys}
    path = tool.folder / "small.toml"
    path.write_text(toml(document), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Tool:
    folder = tmp_path_factory.mktemp("polar")
    tool = Tool(folder, folder / "store")
    result = tool("run", write(tool))
    assert result.code == 0, result.stderr
    return tool


@pytest.fixture
def polar(first: Tool, tmp_path: Path) -> Tool:
    folder = tmp_path / "copy"
    shutil.copytree(first.folder, folder)
    return Tool(folder, folder / "store")


def test_a_bake_with_a_cold_kernel_cache_writes_progress_alone(tool: Tool) -> None:
    """No compiler's warnings and no library's lines; and that kernels are compiled is said in the first run only."""
    config, cold = write(tool), {"XDG_CACHE_HOME": str(tool.folder / "cache")}
    printed = "  compiling kernels for this processor, once ..."
    result = tool.process("run", config, environment=cold)
    assert result.code == 0, result.stderr
    progress = r"small:|  \w+ +([\d.]+ s|cached)|  [\w ]+: \d+ % after \d+ s \.\.\.|" + re.escape(printed)
    assert [line for line in result.stderr.splitlines() if not re.fullmatch(progress, line)] == []
    assert result.stderr.splitlines().count(printed) == 1
    again = tool.process("run", config, "--store", tool.folder / "another", environment=cold)
    assert again.code == 0, again.stderr
    assert printed not in again.stderr


def states(tool: Tool, path: Path) -> dict[str, str]:
    return {step["stage"]: step["state"] for step in tool("plan", path, "--json").json["small"]}


def test_a_run_leaves_maps_a_report_and_a_bundle(first: Tool) -> None:
    assert sorted(first.artifacts()) == sorted(STAGES)
    assert first.bundle().is_dir()
    assert first("verify", first.bundle()).code == 0
    assert "certificate" in (first.out / "small" / "report.html").read_text(encoding="utf-8")


def test_validation_tells_the_errors_of_the_certificate(first: Tool) -> None:
    """The table was put to the checks on random directions once, for its certificate, and not again."""
    made = first("run", first.folder / "small.toml", "--json").json[0]["stages"]
    certified, printed = made["table"]["summary"]["certificate"], made["validate"]["summary"]
    assert printed["random"] == certified["random"]
    assert printed["reference"] == certified["reference"]
    at_exposure = [e["mean"] for e in printed["random"]["colour"] if e["exposure_ru"] == certified["exposure_ru"]]
    assert at_exposure == [certified["measured"]]


def test_a_second_illuminant_reuses_the_power_spectrum(polar: Tool) -> None:
    printed = states(polar, write(polar, spectrum={"illuminant": "A"}))
    assert [printed[stage] for stage in STAGES] == ["cached", "cached", *["to do"] * 5]
    observer = "CIE 1964 10 Degree Standard Observer"
    assert states(polar, write(polar, spectrum={"observer": observer}))["power_spectrum"] == "cached"
    material = {"fresnel": "conductor", "metal": "Au"}
    assert states(polar, write(polar, material=material))["power_spectrum"] == "cached"
    assert states(polar, write(polar, spectrum={"range_nm": [480, 600]}))["power_spectrum"] == "to do"


def test_a_run_may_stop_at_the_certified_table(tool: Tool) -> None:
    result = tool("run", write(tool), "--until", "table")
    assert result.code == 0
    assert sorted(tool.artifacts()) == ["power_spectrum", "surface", "table"]
    assert not tool.out.exists()
    assert "on 2000 random directions, 0.5 allowed" in result.stdout
    printed = tool("run", write(tool), "--until", "table", "--json").json[0]["stages"]["table"]["summary"]
    assert printed["certificate"]["measured"] <= 0.5
    assert printed["certificate"]["reference"]["maximum"] < 1e-6


def test_a_bake_that_misses_its_budget_says_so_and_fails(tool: Tool) -> None:
    result = tool("run", write(tool, table={"rings": 12, "azimuths": 32}))
    assert result.code == 4
    (line,) = result.errors
    assert "misses its budget" in line
    assert "accuracy.delta_e allows 0.5" in line
    assert "table" not in tool.artifacts()
    assert not tool.out.exists()
    assert temporary_files(tool) == []


def test_table_and_reference_agree_through_eval(first: Tool) -> None:
    asked = "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in [(0, 0, 0, 0), (10, 0, 30, 200), (60, 90, 50, 260)])
    (first.folder / "asked.csv").write_text(asked, encoding="utf-8")
    table, exact = (
        np.loadtxt(
            first("eval", "small.toml", "--directions", "asked.csv", *more).stdout.splitlines()[1:], delimiter=","
        )
        for more in ([], ["--exact"])
    )
    np.testing.assert_allclose(table, exact, rtol=0.1, atol=1e-7)
    bundle = first("eval", first.bundle(), "--directions", "asked.csv").stdout.splitlines()[1:]
    np.testing.assert_allclose(np.loadtxt(bundle, delimiter=","), table, rtol=1e-4, atol=1e-9)


def test_single_wavelengths_need_the_spectral_form(polar: Tool) -> None:
    (polar.folder / "asked.csv").write_text("0,0,20,0\n10,30,50,70\n", encoding="utf-8")
    asked = ("eval", "small.toml", "--directions", "asked.csv", "--wavelengths", "510,560.5")
    refused = polar(*asked)
    assert refused.code == 2
    assert 'table.form = "spectral"' in refused.stderr
    write(polar, table={"form": "spectral"})
    table, exact = (polar(*asked, *more).stdout.splitlines() for more in ([], ["--exact"]))
    assert table[0] == exact[0] == "I_510,I_560.5"
    values = [np.loadtxt(lines[1:], delimiter=",") for lines in (table, exact)]
    np.testing.assert_allclose(*values, rtol=0.01, atol=1e-6)
    assert polar(*asked[:-1], "nm").code == 2
    assert polar(*asked[:-1], "100").code == 2


def test_directions_outside_the_scene_are_omitted(tool: Tool) -> None:
    scene = {"lights": [{"theta_deg": 20}], "views": {"theta_max_deg": 30}}
    path = write(tool, scene=scene)
    assert tool("run", path, "--until", "table").code == 0
    (tool.folder / "in.csv").write_text("20,0,29,180\n", encoding="utf-8")
    (tool.folder / "out.csv").write_text("70,0,70,0\n", encoding="utf-8")
    assert tool("eval", path, "--directions", "in.csv").code == 0
    refused = tool("eval", path, "--directions", "out.csv")
    assert refused.code == 3
    assert "outside the [scene]" in refused.stderr
