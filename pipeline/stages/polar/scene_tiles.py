"""Tables of the lights of a flat scene, from tiles in the store: only those that no run has made are baked."""

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import dft_stack
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles
from pipeline.optics.scene import Direction
from pipeline.stages.polar import power_spectrum
from pipeline.stages.stage import kernel_digest, light_parameters, material_parameters
from pipeline.store import digest
from pipeline.store.store import Store, writing
from pipeline.store.tiles import Place
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import Places
from pipeline.tables.polar.lit import LitBake, LitTable, Samples, assemble
from pipeline.tables.polar.planning import plan, trial
from pipeline.tables.polar.planning.plan import Plan
from pipeline.tables.polar.reach import unit_vector

_VERSION = 1
_KERNELS = ("polar_power_spectrum.cl", "dft_stack.cl", "spectral_operator.cl")


@dataclass(frozen=True)
class Shelf:
    """The tiles of one light on a surface.

    key: their address in the store. lit: the bake. field: the surface. places: positions of the coherence window.
    """

    key: str
    lit: LitBake
    field: HeightField
    places: Places

    def bake(self, missing: NDArray[np.bool_]) -> Samples:
        """Bakes tiles (bands, sectors); the stack reaches no further than they need.

        Raises the errors of `PolarBake.stack`.
        """
        if not missing.any():
            return {}
        bake, field = self.lit.bake, self.field
        reach_per_um = float(bake.radius_per_um[self.lit.radii(np.flatnonzero(missing.any(axis=1)))][-1])
        nearer = replace(bake, rho_max=min(bake.rho_max, reach_per_um * 1e-3 * bake.lambda_min_nm))
        if trial.serves_all(bake, field.extent, self.places):
            return self.lit.samples(nearer.stack(field, whole=True), missing, self.places)
        seen = dft_stack.samples_seen(field.extent, bake.sigma_um, bake.tolerance)
        mean: Samples = {}
        for place in self.places.pairs():
            stack = nearer.stack(windows.around(field, place, seen))
            for tile, samples in self.lit.samples(stack, missing).items():
                mean[tile] = mean.get(tile, np.float32(0.0)) + samples / np.float32(self.places.count)
        return mean


@dataclass(frozen=True)
class Found:
    """The table of one light, and the number of its tiles that were baked for it; others came from the store."""

    table: LitTable
    baked: int


def shelf(config: Config, field: HeightField, surface_key: str, planned: Plan, light: Direction) -> Shelf:
    """Returns the shelf of a light.

    config: its coherence, light, material and budget are read, and no scene. field: the surface, with its address.
    planned: the plan of a table without a scene.
    """
    budget, layout = power_spectrum.budget(config), power_spectrum.layout_of(config)
    wi, bake = unit_vector(light), planned.bake(config.radiometry, budget, layout)
    w_terms = partial(
        plan.w_terms_within, half_range_um=field.half_range_um, light=config.light, budget=budget, layout=layout
    )
    lit = LitBake(bake, PolarGrid(planned.rings, planned.azimuths), wi, w_terms)
    key = digest.of_json(_parameters(config, surface_key, planned, wi))
    return Shelf(key, lit, field, windows.places(field.extent, config.coherence))


def table(store: Store, found: Shelf, tiles: Tiles) -> Found:
    """Makes the table of a light on some tiles.

    store: where tiles are read and written. found: the shelf of the light. tiles: those that the table covers.
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
    return Found(assemble(samples | baked, tiles, found.lit), len(baked))


def _samples(content: bytes, place: Place, tiles: Tiles) -> NDArray[np.float32]:
    rings = min(RINGS, tiles.grid.rings.count - RINGS * place[0])
    return np.frombuffer(content, np.float32).reshape(rings, -1, AZIMUTHS)


def _parameters(config: Config, surface_key: str, planned: Plan, wi: Array) -> dict[str, Any]:
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
        "light": [round(float(x), 9) + 0.0 for x in wi],
    }
