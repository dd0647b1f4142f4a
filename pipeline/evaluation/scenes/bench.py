"""The bench of scenes: kernels' time, bytes and errors of tables of a fixed light, against the full table's.

All tables of a surface and a light have one grid, which is planned without a scene. The full bake is that of the
config without a scene, for all lights and views.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from kernels import device
from pipeline.accuracy.exact import reference_of
from pipeline.arrays import Array
from pipeline.config.models import Accuracy, Config
from pipeline.evaluation import results
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.screen import LIGHT, Screen
from pipeline.evaluation.sources import as_published
from pipeline.evaluation.texts import Texts
from pipeline.optics import geometry
from pipeline.optics.colour import delta_e
from pipeline.optics.light import LaserLine, Light
from pipeline.progress import Progress
from pipeline.scene.lights import Parallel
from pipeline.scene.model import Scene, Views
from pipeline.scene.pairs import random_pairs
from pipeline.stages.polar import power_spectrum, scene_tiles
from pipeline.stages.polar.scene_tiles import Savings, StoredTiles
from pipeline.stages.surface import field_of
from pipeline.store import digest, scratch
from pipeline.store.store import Store
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import Places
from pipeline.tables.evaluate import Table, interpolator
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import plan
from pipeline.tables.polar.planning.plan import Plan
from pipeline.tables.polar.reach import of_directions, reach
from pipeline.tables.polar.table import PolarTable
from pipeline.tables.polar.tile_bake import TileTable

_NORMAL = Parallel(theta_deg=0.0)
_SECOND = Parallel(theta_deg=30.0, phi_deg=180.0)
_LASER = Light(illuminant=LaserLine(lambda_nm=532.0))
_ON_NORMAL, _ON_SCREEN = "normal light", "laser on a screen"
_SCREEN_DEG, _SCREEN_SAMPLES = 60.0, 1500
_REPEATS, _DIRECTIONS, _EXPOSURE_RU, _SEED = 9, 2000, 7500.0, 15


@dataclass(frozen=True)
class TableCost:
    """The cost of one table: kernels' seconds from heights to coefficients or samples, the shortest of each kernel.

    bytes: of the table. tiles, of_tiles: those that were baked, and those of the grid. savings: beside the full bake
    of the same light, None for that.
    """

    kernel_s: float
    bytes: int
    tiles: int
    of_tiles: int
    savings: Savings | None = None


@dataclass(frozen=True)
class SceneCosts:
    """The costs of one surface, by the name of the table, and the checks that follow from them."""

    name: str
    costs: dict[str, TableCost]
    checks: list[Check]


@dataclass(frozen=True)
class SceneResults:
    """The results of all surfaces."""

    surfaces: list[SceneCosts]

    @property
    def checks(self) -> list[Check]:
        """The checks of all surfaces."""
        return [check for surface in self.surfaces for check in surface.checks]

    def document(self) -> dict[str, Any]:
        """Return all results for JSON."""
        return results.document(self.checks, surfaces={each.name: each.costs for each in self.surfaces})

    def files(self) -> dict[str, str | bytes]:
        """Return scene.json by name."""
        return {"scene.json": results.json_text(self.document())}


def run(configs: Sequence[tuple[Config, Path]], progress: Progress, note: Callable[[str], None]) -> SceneResults:
    """Measure all surfaces. note: called with the name of each."""
    found = []
    for config, _ in configs:
        note(f"{config.name}:")
        found.append(_surface(as_published(config), progress))
    return SceneResults(found)


class _Bench:
    """A surface's grid and full table under one light. A config's [scene], [table] and [accuracy] are left aside."""

    def __init__(self, config: Config, field: HeightField, light: Light) -> None:
        aside = {"scene": None, "table": PolarLayout(), "accuracy": Accuracy()}
        self.config = config.model_copy(update={"light": light, **aside})
        self.field, self._surface = field, digest.of_json(config.surface.model_dump(mode="json"))
        self.budget, layout = power_spectrum.budget(self.config), power_spectrum.layout_of(self.config)
        sigma_um = config.coherence.sigma_um
        trial = plan.start(field, self.places, sigma_um, light, None, self.budget, layout)
        self.plan: Plan = plan.choose(trial, None, self.budget, layout)
        self.full = self.bake_full()

    @property
    def places(self) -> Places:
        return windows.places(self.field.extent, self.config.coherence)

    @property
    def full_bytes(self) -> int:
        """Return the bytes of the full table as tiles have them: without knots that thinned rings do not have."""
        return 4 * 3 * self.full.w_terms * self.full.tiles.texels

    def stored_tiles(self, wi: Array) -> StoredTiles:
        return scene_tiles.stored_tiles(self.config, self.field, self._surface, self.plan, wi)

    def errors(self, table: Table, wi: Array, wr: Array, exact: Array) -> Array:
        """Return the CIELAB differences of a table from XYZ (directions, 3) at the exposure of all errors here."""
        unit = self.config.radiometry.unit
        found = interpolator(table, self.config.radiometry)(wi, wr)
        return np.asarray(delta_e(np.maximum(found, 0.0) / unit, exact / unit, _EXPOSURE_RU))

    def exact(self, wi: Array, wr: Array, progress: Progress) -> Array:
        reference = reference_of(self.field, self.config, progress)
        return reference.xyz(self.config.light, self.config.material, wi, wr)

    def bake_full(self) -> PolarTable:
        layout = power_spectrum.layout_of(self.config)
        bake = self.plan.bake(self.config.radiometry, self.budget, layout)
        power = bake.power_spectrum(bake.stack(self.field, whole=True), self.plan.azimuths, self.places)
        return bake.table(power, self.plan.rings, bake.rules(self.plan.rings.rho()))


def _kernel_seconds(works: dict[str, Callable[[], Any]]) -> dict[str, float]:
    """Measure the seconds of the kernels of several works, by name.

    They are the sum of the shortest time of each kernel in several runs, in which the works take turns: other
    processes only add, in bursts that seldom spare a whole run.
    """
    least: dict[str, dict[str, float]] = {name: {} for name in works}
    for _ in range(_REPEATS):
        for name, work in works.items():
            with device.default_device().timing() as launches:
                work()
            seconds: dict[str, float] = {}
            for launch in launches:
                seconds[launch.kernel] = seconds.get(launch.kernel, 0.0) + launch.seconds
            least[name] = {kernel: min(least[name].get(kernel, np.inf), each) for kernel, each in seconds.items()}
    return {name: sum(kernels.values()) for name, kernels in least.items()}


def _surface(config: Config, progress: Progress) -> SceneCosts:
    texts, field, checks = Texts(__package__, "scenes", surface=config.name), field_of(config)[0], []
    white, laser = _Bench(config, field, config.light), _Bench(config, field, _LASER)
    normal, (wi, wr) = Scene(lights=[_NORMAL]), _screen()
    of_normal, of_screen = reach(normal, white.full.grid), of_directions(laser.full.grid, geometry.uvw(wi, wr))
    stored = {_ON_NORMAL: white.stored_tiles(_NORMAL.centre), _ON_SCREEN: laser.stored_tiles(LIGHT.vector)}
    tiles = {_ON_NORMAL: of_normal.tiles(), _ON_SCREEN: of_screen.tiles()}
    works: dict[str, Callable[[], Any]] = {"full": white.bake_full, "laser, full": laser.bake_full}
    works |= {name: partial(each.bake, tiles[name].covered) for name, each in stored.items()}
    seconds = _kernel_seconds(works)
    costs = {
        name: TableCost(seconds[name], bench.full_bytes, *2 * (tiles[of].covered.size,))
        for name, bench, of in (("full", white, _ON_NORMAL), ("laser, full", laser, _ON_SCREEN))
    }

    def check(key: str, value: float, remark: str = "", **bound: float) -> None:
        checks.append(texts.check("{surface}.scene." + key, value, remark=remark, **bound))

    with scratch.temporary() as folder:
        store = Store(folder)
        for name, key, bench, pairs in (
            (_ON_NORMAL, "normal", white, random_pairs(normal, _DIRECTIONS, _SEED)),
            (_ON_SCREEN, "laser", laser, _random(wi, wr)),
        ):
            found = scene_tiles.table(store, stored[name], tiles[name]).table
            covered = tiles[name].covered
            costs[name] = TableCost(
                seconds[name], found.nbytes, int(covered.sum()), covered.size, stored[name].savings(tiles[name])
            )
            _check_light(check, key, bench, found, costs[name], costs["full"], pairs, progress)
        _check_reuse(check, white, store)
    return SceneCosts(config.name, costs, checks)


def _screen() -> tuple[Array, Array]:
    """Return wi and wr (directions, 3) of the screen's pixels above the horizon."""
    screen = Screen(LIGHT, _SCREEN_SAMPLES, side_mm=200.0 * np.tan(np.radians(0.5 * _SCREEN_DEG)))
    wi, wr = screen.directions()
    seen = geometry.above_horizon(wi, wr)
    return wi[seen], wr[seen]


def _random(wi: Array, wr: Array) -> tuple[Array, Array]:
    """Draw from pairs those on which errors are stated, 2 degrees or more above the horizon as random ones are."""
    seen = np.flatnonzero(wr[:, 2] > np.cos(np.radians(88.0)))
    chosen = np.random.default_rng(_SEED).choice(seen, _DIRECTIONS)
    return wi[chosen], wr[chosen]


def _check_light(
    check: Callable[..., None],
    name: str,
    bench: _Bench,
    found: TileTable,
    cost: TableCost,
    full: TableCost,
    pairs: tuple[Array, Array],
    progress: Progress,
) -> None:
    """Check cost, errors and values of one light's table."""
    budget, exact = bench.budget.delta_e, bench.exact(*pairs, progress)
    of_full = bench.errors(bench.full, *pairs, exact)
    of_light = bench.errors(found, *pairs, exact)
    full_xyz = np.maximum(interpolator(bench.full, bench.config.radiometry)(*pairs), 0.0)
    between = bench.errors(found, *pairs, full_xyz)
    ms = f"{1e3 * cost.kernel_s:.0f} of {1e3 * full.kernel_s:.0f} ms"
    check(f"{name}_time", cost.kernel_s / full.kernel_s, f"{ms}; {cost.tiles} of {cost.of_tiles} tiles")
    check(f"{name}_bytes", cost.bytes / full.bytes, f"{cost.bytes / 1e6:.2f} of {full.bytes / 1e6:.1f} MB")
    check(f"{name}_error", of_light.mean(), f"the full table's {of_full.mean():.3g}", bound=budget)
    check(f"{name}_difference", between.mean(), f"maximum {between.max():.2g}", bound=budget)


def _check_reuse(check: Callable[..., None], bench: _Bench, store: Store) -> None:
    """Check which tiles are baked when a scene changes."""
    narrow = Scene(lights=[_SECOND], views=Views(theta_max_deg=20.0))
    wide, grid = Scene(lights=[_SECOND], views=Views(theta_max_deg=40.0)), bench.full.grid
    first = scene_tiles.table(store, bench.stored_tiles(_NORMAL.centre), reach(Scene(lights=[_NORMAL]), grid).tiles())
    tiles = reach(narrow, grid).tiles()
    second = scene_tiles.table(store, bench.stored_tiles(_SECOND.centre), tiles)
    check("first_light_again", first.baked, f"the second light's own: {second.baked}")
    wider = reach(wide, grid).tiles()
    added = scene_tiles.table(store, bench.stored_tiles(_SECOND.centre), wider)
    new = int(np.sum(wider.covered & ~tiles.covered))
    check("wider_views", added.baked - new, f"{added.baked} baked, {int(wider.covered.sum())} covered")
    back = scene_tiles.table(store, bench.stored_tiles(_SECOND.centre), tiles)
    check("changed_back", back.baked, f"{int(tiles.covered.sum())} covered")
