"""Predictions of time: what a store keeps of a machine, and what they learn."""

import math
from pathlib import Path

import pytest

from pipeline.resources import Need
from pipeline.stages import cost
from pipeline.store.store import Store

NEED = Need({"table": 1}, 2.0)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


def test_more_work_is_predicted_to_take_longer_and_none_hardly_any_time() -> None:
    machine = cost.Pace()
    assert machine.seconds("table", NEED) < machine.seconds("table", Need({"table": 1}, 4.0))
    assert machine.seconds("textures", Need({})) <= 0.01
    assert machine.seconds("of a third layout", NEED) > 0.0


def test_a_slower_machine_takes_longer_in_proportion() -> None:
    assert cost.Pace(3.0).seconds("table", NEED) == pytest.approx(3.0 * cost.Pace().seconds("table", NEED))


def test_a_run_corrects_the_next_prediction_of_its_stage_alone() -> None:
    before = cost.Pace()
    after = before.learned("table", NEED, 2.5 * before.seconds("table", NEED))
    assert after.seconds("table", NEED) == pytest.approx(2.5 * before.seconds("table", NEED))
    assert after.seconds("render", NEED) == before.seconds("render", NEED)


def test_old_runs_are_forgotten_and_a_stray_one_changes_no_prediction_more_than_tenfold() -> None:
    machine = cost.Pace()
    first = machine.seconds("table", NEED)
    for _ in range(20):
        machine = machine.learned("table", NEED, 3.0 * first)
    for _ in range(8):
        machine = machine.learned("table", NEED, first)
    assert machine.seconds("table", NEED) == pytest.approx(first)
    assert cost.Pace().learned("table", NEED, 1e9).seconds("table", NEED) <= 10.001 * first


def test_the_pace_is_measured_once_and_kept_with_what_was_learned(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = cost.machine(store)
    assert 0.1 <= found.pace <= 10.0
    monkeypatch.setattr(cost, "_pace", lambda: pytest.fail("measured again"))
    cost.keep(found.learned("table", NEED, 1.0), store)
    assert math.isclose(cost.machine(store).seconds("table", NEED), 1.0)


@pytest.mark.parametrize("text", ["", "{}", "[" * 9999, '{"pace": "x", "ratios": {}}', '{"pace": NaN, "ratios": {}}'])
def test_a_damaged_record_is_measured_anew(store: Store, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    cost.machine(store)
    next((store.root / "costs").iterdir()).write_text(text)
    monkeypatch.setattr(cost, "_pace", lambda: 2.0)
    assert cost.machine(store).pace == 2.0


def test_a_store_that_cannot_be_written_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(cost, "_pace", lambda: 2.0)
    assert cost.machine(Store(tmp_path / "file" / "store")).pace == 2.0
