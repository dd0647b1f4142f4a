"""Small bakes of both layouts, made once per session: the artifacts of a sinusoid."""

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from pipeline.bundle import checksums
from pipeline.config.models import Config
from pipeline.config.read import parse
from pipeline.progress import silent
from pipeline.stages import bundle as bundle_stage
from pipeline.stages import run
from pipeline.stages.stage import Inputs
from pipeline.store.store import Artifact, Store

LAYOUTS = ("taylor", "polar")
# the polar table is coarse, within a large budget, so that the bake is quick
TABLES: dict[str, dict[str, Any]] = {
    "taylor": {"layout": "taylor", "resolution": 41, "power": 3.0, "tolerance": 1e-2},
    "polar": {"layout": "polar", "rings": 80, "azimuths": 256, "w_terms": 12},
}
SMALL: dict[str, Any] = {
    "name": "small",
    "surface": {"recipe": {"kind": "sinusoid", "period_um": 2.0, "size_um": 16.0, "pitch_um": 0.1}},
    "coherence": {"sigma_um": 3.0},
    "render": {"size": 16},
}
# one light, and views around the normal
SCENE: dict[str, Any] = {"lights": [{"theta_deg": 30.0}], "views": {"theta_max_deg": 45.0}}
LENIENT = 100.0  # a budget that every small table meets


def small(layout: str = "taylor", **sections: Any) -> Config:
    """Returns the small config of a layout, with some keys of its sections replaced."""
    document = {**SMALL, "table": TABLES[layout]}
    if layout == "polar":
        document["accuracy"] = {"delta_e": LENIENT}
    for name, keys in sections.items():
        before = document.get(name)
        document[name] = {**before, **keys} if isinstance(before, dict) and name != "surface" else keys
    return parse(document, "test", Path())


class Baker:
    """Bakes configs into one store; equal artifacts are made once."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def __call__(self, config: Config) -> dict[str, Artifact]:
        made: dict[str, Artifact] = {}
        *baked, validate, _ = run.stages(config)
        for stage in baked:
            key = stage.key(config, {name: artifact.key for name, artifact in made.items()})
            if not self._store.has(stage.name, key):
                with self._store.create(stage.name, key, {"version": stage.version}) as (folder, record):
                    record["summary"] = stage.produce(config, Inputs(made, address=key), folder, silent)
                    record["provenance"] = {
                        "numpy": "2.0.0",
                        "device": "a device",
                        "driver": "1.0",
                        "seconds": 1.5,
                    }
            made[stage.name] = self._store.open(stage.name, key)
        made[validate.name] = self._validated(made["render"].key)
        return made

    def _validated(self, key: str) -> Artifact:
        if not self._store.has("validate", key):
            with self._store.create("validate", key, {"version": 1}) as (folder, record):
                (folder / "report.html").write_text("<p>measured</p>", encoding="utf-8")
                record["summary"] = {"random": {"power": {"median": 1e-3}}}
        return self._store.open("validate", key)


def publish(config: Config, artifacts: Mapping[str, Artifact], out: Path) -> Path:
    """Makes the bundle of these artifacts by its stage, and copies it to `out`."""
    *_, stage = run.stages(config)
    with tempfile.TemporaryDirectory() as folder:
        summary = stage.produce(config, Inputs(artifacts), Path(folder), silent)
        return bundle_stage.place(Artifact(Path(folder), {"summary": summary}), out)


@pytest.fixture(scope="session")
def bake(tmp_path_factory: pytest.TempPathFactory) -> Baker:
    return Baker(Store(tmp_path_factory.mktemp("store")))


@pytest.fixture(scope="session")
def published(bake: Baker, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The small bundle of each layout: read it, change nothing."""
    return {
        layout: publish(small(layout), bake(small(layout)), tmp_path_factory.mktemp(layout)) for layout in LAYOUTS
    }


@pytest.fixture(scope="session")
def whole(published: dict[str, Path]) -> Path:
    return published["taylor"]


@pytest.fixture
def bundle(whole: Path, tmp_path: Path) -> Path:
    """A copy that a test may damage."""
    return Path(shutil.copytree(whole, tmp_path / whole.name))


@pytest.fixture
def polar_bundle(published: dict[str, Path], tmp_path: Path) -> Path:
    """A copy that a test may damage."""
    return Path(shutil.copytree(published["polar"], tmp_path / published["polar"].name))


def forged(folder: Path, damage: Callable[[Path], None]) -> Path:
    """Changes a bundle and renames it to its new digest, so that only the manifest contradicts."""
    damage(folder)
    (folder / checksums.SUMS).unlink()
    return folder.rename(folder.parent / f"{folder.name.rpartition('+')[0]}+{checksums.write(folder)}")


def with_values(**changes: Any) -> Callable[[Path], None]:
    """Returns a function that sets values of the manifest: keys are paths with "__" between their parts."""

    def damage(folder: Path) -> None:
        path = folder / "manifest.json"
        manifest = json.loads(path.read_text(encoding="utf-8"))
        for name, value in changes.items():
            *parents, last = (int(part) if part.isdigit() else part for part in name.split("__"))
            place = manifest
            for part in parents:
                place = place[part]
            assert isinstance(place, list) or last in place
            place[last] = value
        path.write_text(json.dumps(manifest), encoding="utf-8")

    return damage
