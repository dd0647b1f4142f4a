"""Tables that are baked tile by tile, against the whole table of the same grid."""

from functools import cache, partial

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.optics import geometry
from pipeline.scene.lights import Parallel
from pipeline.scene.model import Scene, Views
from pipeline.scene.pairs import random_pairs
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.reach import reach
from pipeline.tables.polar.table import PolarTable
from pipeline.tables.polar.tile_bake import TileBake, TileTable, assemble
from tests.tables.planned import SIGMA, config, field_of

GRID = PolarGrid(Rings(96, 0.5), Azimuths(640, 0.9, 0.2))
OBLIQUE = Scene(lights=[Parallel(theta_deg=40, phi_deg=150)], views=Views(theta_max_deg=20))
NORMAL = Scene(lights=[Parallel(theta_deg=0)])
LINE = {"spectrum": {"illuminant": {"lambda_nm": 532}}}
GOLD = {"material": {"fresnel": "conductor", "metal": "Au"}}


def settings(found: Config, scene: Scene | None) -> TileBake:
    budget = plan.Budget(0.02, 7500.0)
    numbers = plan.numbers(field_of(found).half_range_um, SIGMA, found.light, None, budget, found.table)
    made = plan.Plan(numbers.terms, numbers.s_nodes, numbers.w_terms, GRID.azimuths, GRID.rings, None)
    bake = made.bake(found.radiometry, budget, found.table)
    terms = partial(
        plan.w_terms_within,
        half_range_um=field_of(found).half_range_um,
        light=found.light,
        budget=budget,
        layout=found.table,
    )
    return TileBake(bake, GRID, None if scene is None else scene.lights[0].centre, terms)


@cache
def whole_of(kind: str) -> tuple[Config, Stack, PolarTable]:
    found = config(**{"white": {}, "line": LINE, "gold": GOLD}[kind])
    bake = settings(found, NORMAL).bake
    stack = bake.stack(field_of(found))
    power = bake.power_spectrum(stack, GRID.azimuths)
    return found, stack, bake.table(power, GRID.rings, bake.rules(GRID.rings.rho()))


def lit_of(kind: str, scene: Scene) -> tuple[TileTable, PolarTable]:
    found, stack, table = whole_of(kind)
    lit, tiles = settings(found, scene), reach(scene, GRID).tiles()
    return assemble(lit.samples(stack, tiles.covered), tiles, lit), table


@pytest.mark.parametrize("kind", ["white", "line", "gold"])
def test_it_gives_what_the_whole_table_gives(kind: str) -> None:
    lit, table = lit_of(kind, OBLIQUE)
    uvw = geometry.uvw(*random_pairs(OBLIQUE, 3000, 5))
    found, expected = lit.look_up(uvw), table.look_up(uvw)
    assert np.isfinite(found).all()
    scale = np.sqrt(np.mean(expected**2, axis=0))
    assert np.sqrt(np.mean((found - expected) ** 2, axis=0)) == pytest.approx(0.0, abs=4e-3 * scale.max())
    assert lit.nbytes < 0.12 * table.nbytes


def test_a_normal_light_needs_a_tenth_of_the_bytes_up_to_the_horizon() -> None:
    lit, table = lit_of("white", NORMAL)
    wi, wr = random_pairs(NORMAL, 3000, 5)
    seen = wr[:, 2] > 0.3
    uvw = geometry.uvw(wi, wr)
    found, expected = lit.look_up(uvw), table.look_up(uvw)
    assert np.isfinite(found).all()
    error = np.sqrt(np.mean((found[seen] - expected[seen]) ** 2, axis=0))
    assert np.all(error < 4e-3 * np.sqrt(np.mean(expected[seen] ** 2, axis=0)))
    assert lit.nbytes < 0.125 * table.nbytes


def test_a_tile_does_not_depend_on_those_that_are_baked_with_it() -> None:
    found, stack, _ = whole_of("white")
    lit, covered = settings(found, OBLIQUE), reach(OBLIQUE, GRID).tiles().covered
    together = lit.samples(stack, covered)
    for place in list(together)[::7]:
        alone = np.zeros_like(covered)
        alone[place] = True
        (made,) = lit.samples(stack, alone).values()
        np.testing.assert_allclose(made, together[place], rtol=2e-5, atol=1e-6 * np.abs(made).max())


def test_what_no_tile_covers_and_what_another_light_lights_is_unknown() -> None:
    lit, _ = lit_of("white", OBLIQUE)
    wi = OBLIQUE.lights[0].centre
    outside = geometry.direction(np.radians(70.0), np.radians(150.0))
    assert np.isnan(lit.look_up(-(wi + outside)[None])).all()
    normal = np.array([0.0, 0.0, 1.0])
    uvw = -(wi + normal)[None]
    assert np.isfinite(lit.look_up(uvw)).all()
    assert np.isnan(lit.look_up(uvw * [1.0, 1.0, 0.9])).all()


@pytest.mark.parametrize("kind", ["white", "gold"])
def test_polynomials_of_tiles_are_those_of_the_whole_table(kind: str) -> None:
    found, stack, table = whole_of(kind)
    bake, tiles = settings(found, None), reach(OBLIQUE, GRID).tiles()
    made = assemble(bake.samples(stack, tiles.covered), tiles, bake)
    uvw = geometry.uvw(*random_pairs(OBLIQUE, 3000, 5))
    # any |w| is known where (u, v) is
    uvw[:, 2] *= np.linspace(0.2, 1.0, len(uvw))
    expected = table.look_up(uvw)
    scale = np.sqrt(np.mean(expected**2, axis=0)).max()
    np.testing.assert_allclose(made.look_up(uvw), expected, atol=2e-3 * scale)
    assert np.isnan(made.look_up(geometry.uvw(*random_pairs(NORMAL, 3000, 5)))).any()


def test_nothing_missing_bakes_nothing() -> None:
    found, stack, _ = whole_of("white")
    assert settings(found, OBLIQUE).samples(stack, np.zeros((6, 5), bool)) == {}
