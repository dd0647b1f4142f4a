"""`bench scene`: what a scene saves, on a small surface."""

import pytest

from pipeline.config.models import Config
from pipeline.evaluation.scenes import bench
from pipeline.evaluation.scenes.bench import SceneResults
from pipeline.progress import silent
from tests.tables.planned import config


@pytest.fixture(scope="module")
def found() -> SceneResults:
    patched = pytest.MonkeyPatch()
    patched.setattr(bench, "_REPEATS", 1)
    patched.setattr(bench, "_SCREEN_SAMPLES", 300)
    patched.setattr(bench, "_DIRECTIONS", 400)
    small: Config = config()
    try:
        return bench.run([(small, "a.toml")], silent, lambda _: None)
    finally:
        patched.undo()


def test_values_are_those_of_the_full_table_and_no_tile_is_baked_twice(found: SceneResults) -> None:
    verdicts = {check.id: check for check in found.checks}
    assert len(verdicts) == 11
    for key in ("normal_difference", "normal_error", "laser_difference", "laser_error"):
        check = verdicts[f"a.scene.{key}"]
        assert check.verdict == "holds", f"{check.id}: {check.measured} {check.remark}"
    for key in ("first_light_again", "wider_views", "changed_back"):
        assert verdicts[f"a.scene.{key}"].value == 0.0


def test_each_table_has_its_cost(found: SceneResults) -> None:
    (surface,) = found.surfaces
    assert set(surface.costs) == {"full", "normal light", "laser, full", "laser on a screen"}
    assert all(cost.kernel_s > 0.0 for cost in surface.costs.values())
    assert surface.costs["normal light"].bytes < 0.2 * surface.costs["full"].bytes
    assert surface.costs["laser on a screen"].bytes < 0.1 * surface.costs["laser, full"].bytes


def test_results_are_a_document_of_checks(found: SceneResults) -> None:
    document = found.document()
    assert {check["id"] for check in document["checks"]} == {check.id for check in found.checks}
    assert list(found.files()) == ["scene.json"]
