"""The order of several configs, the stages that they share, and the objects that they hold in memory."""

from collections import Counter
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import pytest

from pipeline.batch.turns import turns
from pipeline.config import read
from pipeline.config.models import Config
from pipeline.errors import InputError
from pipeline.stages import run
from pipeline.stages.polar import power_spectrum
from pipeline.stages.session import Session
from pipeline.store import digest
from pipeline.store.store import Store

# 100 x 100 samples, whose table takes a tenth of a second
SMALL: dict[str, Any] = {
    "surface": {"recipe": {"kind": "sinusoid", "amplitude_um": 0.02, "size_um": 10, "pitch_um": 0.1}},
    "coherence": {"sigma_um": 2.0, "windows": "centre"},
    "spectrum": {"range_nm": [540, 560]},
    "table": {"layout": "polar", "rings": 24, "azimuths": 32},
    "accuracy": {"delta_e": 90.0},
}


def small(name: str, amplitude_um: float = 0.02, **sections: dict[str, Any]) -> Config:
    document = {"name": name, **{key: {**SMALL.get(key, {}), **keys} for key, keys in {**SMALL, **sections}.items()}}
    document["surface"] = {"recipe": {**SMALL["surface"]["recipe"], "amplitude_um": amplitude_um}}
    return read.parse(document, name, Path.cwd())


def plans(configs: Sequence[Config], store: Store, until: str = "bundle") -> list[tuple[Config, list[run.Step]]]:
    return [(config, run.plan(config, store, until)) for config in configs]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


def test_configs_of_one_surface_and_of_one_power_spectrum_follow_each_other(store: Store) -> None:
    """By name, but behind the first one with which they share; the order in which they are given does not matter."""
    configs = [
        small("a"),
        small("b", amplitude_um=0.03),
        small("c", accuracy={"delta_e": 80.0}),
        small("d", material={"fresnel": "none"}),
        small("e", amplitude_um=0.03, spectrum={"illuminant": "A"}),
        small("f", accuracy={"delta_e": 80.0}, spectrum={"illuminant": "A"}),
    ]
    for given in list(permutations(configs))[::7]:
        assert "".join(turn.config.name for turn in turns(plans(given, store), store)) == "adcfbe"
    assert [(turn.number, turn.count) for turn in turns(plans(configs[:2], store), store)] == [(1, 2), (2, 2)]


@pytest.mark.parametrize(
    ("sections", "shares"),
    [
        ({"spectrum": {"illuminant": "A"}}, True),
        ({"spectrum": {"observer": "CIE 1964 10 Degree Standard Observer"}}, True),
        ({"material": {"fresnel": "conductor", "metal": "Au", "normalisation": "relative"}}, True),
        ({"material": {"ior": 1.3, "shadowing": False}}, True),
        ({"render": {"size": 64, "exposure_ru": 10.0}, "publish": {"precision": "half"}}, True),
        ({"spectrum": {"range_nm": [530, 560]}}, False),
        ({"scene": {"lights": [{"theta_deg": 0}]}}, False),
        ({"table": {"rings": 32}}, False),
        ({"accuracy": {"delta_e": 80.0}}, False),
        ({"accuracy": {"exposure_ru": 100.0}}, False),
        ({"coherence": {"windows": "auto"}}, False),
    ],
)
def test_one_power_spectrum_serves_every_illuminant_observer_and_material(
    store: Store, sections: dict[str, Any], shares: bool
) -> None:
    keys = [run.plan(config, store, "power_spectrum")[-1].key for config in (small("a"), small("b", **sections))]
    assert (keys[0] == keys[1]) == shares


def test_ten_lights_and_materials_make_one_surface_and_one_power_spectrum(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The power spectrum passes from each to the next in memory, and is dropped before another surface's is made."""
    configs = [small("other", amplitude_um=0.03)]
    configs += [small(f"n{i}", spectrum={"illuminant": name}) for i, name in enumerate(("A", "D50", "D65", "E"))]
    configs += [small(f"m{i}", material={"ior": 1.3 + 0.1 * i}) for i in range(6)]
    made: Counter[str] = Counter()
    alive: WeakValueDictionary[str, Any] = WeakValueDictionary()
    keep = Session.keep

    def keep_and_watch(session: Session, address: str, value: Any) -> None:
        alive[address] = value
        keep(session, address, value)

    monkeypatch.setattr(Session, "keep", keep_and_watch)
    monkeypatch.setattr(power_spectrum, "load", lambda _: pytest.fail("read from the store"))
    for turn in turns(plans(configs, store, "table"), store):
        assert set(alive) <= {step.key for step in turn.steps}
        run.execute(
            turn.config,
            turn.steps,
            store,
            on_step=lambda step, seconds: made.update([step.stage.name] * (seconds is not None)),
            session=turn.session,
        )
    # "D65" and an index of 1.5 are the defaults, so one table is made for both
    assert made == {"surface": 2, "power_spectrum": 2, "table": 10}


def test_a_scan_is_hashed_once_and_refused_where_it_changes_after_the_plan(
    tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The address of its artifacts has its digest, and the run of another config may lie between plan and bake."""
    scan, hashed = tmp_path / "scan.npy", Counter[Path]()
    of_file = digest.of_file
    monkeypatch.setattr(digest, "of_file", lambda path: hashed.update([path]) or of_file(path))
    rng = np.random.default_rng(1)
    np.save(scan, rng.normal(0.0, 0.02, (64, 64)))
    document = {**SMALL, "name": "scan", "surface": {"path": str(scan), "pitch_um": 0.1, "height_unit": "um"}}
    config = read.parse(document, "scan", Path.cwd())
    (turn,) = turns(plans([config], store, "power_spectrum"), store)
    run.execute(turn.config, turn.steps, store, session=turn.session)
    run.plan(config, store)
    assert hashed[scan] == 1
    np.save(scan, rng.normal(0.0, 0.02, (64, 64)))
    steps = run.plan(config, store, "surface")
    assert hashed[scan] == 2
    np.save(scan, rng.normal(0.0, 0.02, (64, 64)))
    with pytest.raises(InputError, match="the scan has changed since the bake began"):
        run.execute(config, steps, store)
