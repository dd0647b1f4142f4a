"""The tables of a scene from tiles in the store: which are baked, and what the table answers."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.tiles import thinned
from pipeline.optics import geometry
from pipeline.scene.lights import Parallel
from pipeline.scene.model import Scene, Views
from pipeline.scene.pairs import random_pairs
from pipeline.stages.polar import scene_tiles
from pipeline.stages.polar.scene_tiles import SceneTable
from pipeline.store.store import Store
from pipeline.tables.polar.planning.plan import Plan
from pipeline.tables.polar.table import PolarTable
from tests.tables.planned import config, field_of, planned

ONE, OTHER = Parallel(theta_deg=20, phi_deg=100), Parallel(theta_deg=50, phi_deg=200)
VIEWS = Views(theta_max_deg=25)
MANY = [Parallel(theta_deg=2.0 * k, phi_deg=37.0 * k) for k in range(16)]


@cache
def full() -> tuple[Config, PolarTable, Plan]:
    found = config()
    return (found, *planned(found))


def table_of(store: Store, lights: list[Parallel], views: Views = VIEWS, surface: str = "s") -> SceneTable:
    found, _, chosen = full()
    scene = Scene(lights=lights, views=views)
    return scene_tiles.scene_table(store, found.model_copy(update={"scene": scene}), field_of(found), surface, chosen)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


@pytest.mark.parametrize("lights", [[ONE], [ONE, OTHER], MANY])
def test_it_answers_what_the_full_table_answers(store: Store, lights: list[Parallel]) -> None:
    made = table_of(store, lights)
    assert len(made.tables) == (1 if len(lights) == 16 else len(lights))
    uvw = geometry.uvw(*random_pairs(Scene(lights=lights, views=VIEWS), 2000, 9))
    expected = full()[1].look_up(uvw)
    scale = np.sqrt(np.mean(expected**2, axis=0)).max()
    error = np.sqrt(np.mean((made.look_up(uvw) - expected) ** 2, axis=0))
    assert np.all(error < 5e-3 * scale)
    assert made.nbytes < full()[1].nbytes


def test_a_second_light_bakes_its_own_tiles_and_a_scene_changed_back_none(store: Store) -> None:
    first = table_of(store, [ONE])
    assert first.baked == sum(int(each.tiles.covered.sum()) for each in first.tables) > 0
    both = table_of(store, [ONE, OTHER])
    assert both.baked == int(both.tables[1].tiles.covered.sum()) > 0
    assert table_of(store, [ONE]).baked == 0
    wider = table_of(store, [ONE], Views(theta_max_deg=60))
    new = wider.tables[0].tiles.covered & ~first.tables[0].tiles.covered
    assert wider.baked == int(new.sum()) > 0


def test_tiles_of_the_store_are_those_that_were_baked(store: Store) -> None:
    baked, read = table_of(store, [ONE]), table_of(store, [ONE])
    assert np.array_equal(baked.tables[0].values, read.tables[0].values)
    assert table_of(store, [ONE], surface="another").baked == baked.baked


def test_a_damaged_tile_is_baked_again(store: Store) -> None:
    before = table_of(store, [ONE])
    (folder,) = store.tile_folders()
    harmed = folder.files[0]
    harmed.write_bytes(harmed.read_bytes()[:-4])
    assert len(store.check()) == 1
    again = table_of(store, [ONE])
    assert again.baked == 1
    np.testing.assert_allclose(again.tables[0].values, before.tables[0].values, rtol=1e-4, atol=1e-6)
    assert store.check() == []


def test_savings_are_shares_of_the_full_bake(store: Store) -> None:
    found, _, chosen = full()
    stored = scene_tiles.stored_tiles(found, field_of(found), "s", chosen, ONE.centre)
    tiles = table_of(store, [ONE]).tables[0].tiles
    saved = stored.savings(tiles)
    assert saved.texels == pytest.approx(1.0 - tiles.texels / thinned(tiles.grid).texels)
    assert saved.values == pytest.approx(1.0 - 1.0 / stored.tile.bake.w_terms)
    assert all(0.0 <= share < 1.0 for share in vars(saved).values())
    assert saved.frequencies > 0.3
