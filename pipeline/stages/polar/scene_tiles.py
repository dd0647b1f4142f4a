"""The tables of a scene from tiles in the store: only those that no run has made are baked."""

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import dft_stack
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles, thinned
from pipeline.optics.brdf import Radiometry
from pipeline.scene.lights import Parallel
from pipeline.scene.model import Scene
from pipeline.stages.polar import power_spectrum
from pipeline.stages.stage import kernel_digest, light_parameters, material_parameters
from pipeline.store import digest
from pipeline.store.store import Store, writing
from pipeline.store.tiles import Place
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import Places
from pipeline.tables.polar.planning import plan, trial
from pipeline.tables.polar.planning.plan import Plan
from pipeline.tables.polar.reach import reach
from pipeline.tables.polar.tile_bake import Samples, TileBake, TileTable, assemble

_VERSION = 1
_KERNELS = ("polar_power_spectrum.cl", "dft_stack.cl", "spectral_operator.cl")


@dataclass(frozen=True)
class Savings:
    """Shares of a full bake that a scene saves.

    texels: of the thinned grid. values: of a texel. azimuths, radii: of E. frequencies: of the stack.
    """

    texels: float
    values: float
    azimuths: float
    radii: float
    frequencies: float


@dataclass(frozen=True)
class StoredTiles:
    """The tiles of a surface under one light, or of polynomials in |w| for all lights.

    key: their address in the store. tile: the bake. field: the surface. places: positions of the coherence window.
    """

    key: str
    tile: TileBake
    field: HeightField
    places: Places

    def bake(self, missing: NDArray[np.bool_]) -> Samples:
        """Bakes tiles (bands, sectors); the stack reaches no further than they need.

        Raises the errors of `PolarBake.stack`.
        """
        if not missing.any():
            return {}
        bake, field = self.tile.bake, self.field
        reach_per_um = float(bake.radius_per_um[self.tile.radii(np.flatnonzero(missing.any(axis=1)))][-1])
        nearer = replace(bake, rho_max=min(bake.rho_max, reach_per_um * 1e-3 * bake.lambda_min_nm))
        if trial.serves_all(bake, field.extent, self.places):
            return self.tile.samples(nearer.stack(field, whole=True), missing, self.places)
        seen = dft_stack.samples_seen(field.extent, bake.sigma_um, bake.tolerance)
        mean: Samples = {}
        for place in self.places.pairs():
            stack = nearer.stack(windows.around(field, place, seen))
            for tile, samples in self.tile.samples(stack, missing).items():
                mean[tile] = mean.get(tile, np.float32(0.0)) + samples / np.float32(self.places.count)
        return mean

    def savings(self, tiles: Tiles) -> Savings:
        """Computes what is saved beside polynomials in |w| on all tiles."""
        bake, grid = self.tile.bake, self.tile.grid
        radius, radii = bake.radius_per_um, self.tile.radii(np.flatnonzero(tiles.covered.any(axis=1)))
        return Savings(
            texels=1.0 - tiles.texels / thinned(grid).texels,
            values=1.0 - self.tile.outputs / (3 * bake.w_terms),
            azimuths=1.0 - len(self.tile.half_turn(tiles.covered)) / (grid.azimuths.count // 2),
            radii=1.0 - len(radius[radii]) / len(radius),
            frequencies=1.0 - float(radius[radii][-1] / radius[-1]) ** 2,
        )


@dataclass(frozen=True)
class Found:
    """A table, and the number of its tiles that were baked for it; others came from the store."""

    table: TileTable
    baked: int


@dataclass(frozen=True)
class SceneTable:
    """The tables of a scene: one of polynomials in |w|, or one of each light.

    tables: where two lights have the same (u, v) and |w|, they have the same value. baked: how many tiles were baked.
    """

    tables: tuple[TileTable, ...]
    baked: int

    @property
    def nbytes(self) -> int:
        """Bytes of the samples of all tables."""
        return sum(each.nbytes for each in self.tables)

    def look_up(self, uvw: Array) -> Array:
        """Computes XYZ / (C cos ti) (directions, 3) at `uvw` (directions, 3); NaN where no table has them."""
        found = self.tables[0].look_up(uvw)
        for other in self.tables[1:]:
            unknown = np.isnan(found[:, 0])
            found[unknown] = other.look_up(uvw[unknown])
        return found

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (directions,) for unit vectors wi, wr (directions, 3), as a polar table does."""
        return self.tables[0].direction_factor(radiometry, wi, wr)


def scene_table(store: Store, config: Config, field: HeightField, surface_key: str, planned: Plan) -> SceneTable:
    """Makes the tables that the scene of a config needs, of one light each where these take fewer bytes.

    store: where tiles are read and written. field: the surface, with its address. planned: the plan of a table
    without a scene. Raises the errors of `table`.
    """

    def stored_of(wi: Array | None) -> StoredTiles:
        return stored_tiles(config, field, surface_key, planned, wi)

    every = stored_of(None)
    tiles = reach(config.scene, every.tile.grid).tiles()
    by_light = [(stored_of(wi), reach(alone, every.tile.grid).tiles()) for wi, alone in _by_light(config.scene)]
    bytes_by_light = sum(each.tile.outputs * its.texels for each, its in by_light)
    if by_light and bytes_by_light < every.tile.outputs * tiles.texels:
        found = [table(store, each, its) for each, its in by_light]
    else:
        found = [table(store, every, tiles)]
    return SceneTable(tuple(each.table for each in found), sum(each.baked for each in found))


def _by_light(scene: Scene | None) -> list[tuple[Array, Scene]]:
    """Splits a scene of parallel light on a flat sample, where (u, v) determines |w|, into those of one light.

    Returns each light's unit vector (3,) and scene; nothing for other scenes. Lights below the horizon light nothing.
    """
    if scene is None or scene.mesh is not None:
        return []
    parallel = [light for light in scene.lights if isinstance(light, Parallel)]
    if len(parallel) < len(scene.lights):
        return []
    above = [light for light in parallel if light.centre[2] > 0.0]
    return [(light.centre, scene.model_copy(update={"lights": [light]})) for light in above]


def stored_tiles(
    config: Config, field: HeightField, surface_key: str, planned: Plan, wi: Array | None
) -> StoredTiles:
    """Returns the stored tiles of a light, or of polynomials in |w| for all lights.

    config: its coherence, light, material and budget are read, and no scene. field: the surface, with its address.
    planned: the plan of a table without a scene. wi: unit vector towards the light (3,), None for all lights.
    """
    budget, layout = power_spectrum.budget(config), power_spectrum.layout_of(config)
    bake = planned.bake(config.radiometry, budget, layout)
    w_terms = partial(
        plan.w_terms_within, half_range_um=field.half_range_um, light=config.light, budget=budget, layout=layout
    )
    tile = TileBake(bake, PolarGrid(planned.rings, planned.azimuths), wi, w_terms)
    key = digest.of_json(_parameters(config, surface_key, planned, wi))
    return StoredTiles(key, tile, field, windows.places(field.extent, config.coherence))


def table(store: Store, found: StoredTiles, tiles: Tiles) -> Found:
    """Makes the table of some tiles.

    store: where tiles are read and written. found: their surface, light and bake. tiles: those that the table covers.
    Raises StorageError where tiles cannot be written, DeviceError if no device works.
    """
    folder, places = store.tiles(found.key), [(int(b), int(k)) for b, k in np.argwhere(tiles.covered)]
    samples = {place: _samples(content, place, tiles) for place, content in folder.read(places).items()}
    missing = tiles.covered.copy()
    for place in samples:
        missing[place] = False
    baked = found.bake(missing)
    with writing(store.root):
        if baked:
            folder.write({place: tile.tobytes() for place, tile in baked.items()})
        folder.touch()
    return Found(assemble(samples | baked, tiles, found.tile), len(baked))


def _samples(content: bytes, place: Place, tiles: Tiles) -> NDArray[np.float32]:
    rings = min(RINGS, tiles.grid.rings.count - RINGS * place[0])
    return np.frombuffer(content, np.float32).reshape(rings, -1, AZIMUTHS)


def _parameters(config: Config, surface_key: str, planned: Plan, wi: Array | None) -> dict[str, Any]:
    """Returns all that a tile's samples depend on, but for its place."""
    return {
        "version": _VERSION,
        "kernels": kernel_digest(*_KERNELS),
        "surface": surface_key,
        "coherence": config.coherence.model_dump(mode="json"),
        "spectrum": light_parameters(config),
        "material": material_parameters(config),
        "plan": asdict(planned),
        "delta_e": config.budget_delta_e,
        "form": power_spectrum.layout_of(config).form,
        # far below the width of any lobe
        "light": None if wi is None else [round(float(x), 9) + 0.0 for x in wi],
    }
