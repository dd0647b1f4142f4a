"""The tiles that a bundle keeps of a table: those of its scene and of its maps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.config.read import parse
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import Tiles, thinned
from pipeline.optics import geometry
from pipeline.scene.maps import map_radius
from pipeline.scene.pairs import border_pairs, random_pairs
from pipeline.stages.polar.table import reached
from pipeline.tables.evaluate import Map

CAMERA = {"position": [100.0, -50.0, 200.0], "fov_deg": 12.0, "size": [80, 60]}
RANGE = {"kind": "range", "theta_deg": [50, 60], "phi_deg": [0, 30]}
NARROW: dict[str, Any] = {"lights": [{"theta_deg": 45, "phi_deg": 30}], "views": {"theta_max_deg": 20}}
SCENES: dict[str, dict[str, Any]] = {
    "narrow": NARROW,
    "patch": {**NARROW, "views": {"theta_min_deg": 10, "theta_max_deg": 40, "phi_deg": [20, 60]}},
    "sun": {"lights": [{"kind": "sun", "theta_deg": 60}], "views": {"theta_max_deg": 0.1}},
    "range": {
        "lights": [{"kind": "range", "theta_deg": [50, 60], "phi_deg": [0, 30]}],
        "views": {"theta_max_deg": 5},
    },
    "camera": {
        "lights": [{"theta_deg": 40}, {"theta_deg": 40, "phi_deg": 90}],
        "cameras": [CAMERA],
        "sample": [40, 40],
    },
}


def config(scene: dict[str, Any] | None) -> Config:
    recipe = {
        "kind": "gaussian",
        "sigma_h_um": 0.05,
        "correlation_um": 1.0,
        "size_um": 20.0,
        "pitch_um": 0.1,
        "seed": 1,
    }
    document: dict[str, Any] = {"name": "small", "surface": {"recipe": recipe}}
    return parse({**document, **({} if scene is None else {"scene": scene})}, "test", Path())


def grid_of(rings: int = 150, azimuths: int = 1664) -> PolarGrid:
    return PolarGrid(Rings(rings, 0.06), Azimuths(azimuths, 0.75, 0.1))


def covered(tiles: Tiles, wi: Array, wr: Array) -> np.ndarray:
    uvw, rings = geometry.uvw(wi, wr), tiles.grid.rings
    ring = np.clip(rings.ring_from_rho(np.hypot(uvw[:, 0], uvw[:, 1])), 0.0, rings.count - 1.0)
    return tiles.covers(ring, tiles.grid.azimuths.azimuth_from_uv(uvw[:, :2]))


@pytest.mark.parametrize("grid", [grid_of(), grid_of(60, 416)], ids=["fine", "narrower last sector"])
@pytest.mark.parametrize("name", SCENES)
def test_all_of_a_scene_and_of_its_maps_is_kept(name: str, grid: PolarGrid) -> None:
    found = config(SCENES[name])
    tiles = reached(found, grid)
    assert covered(tiles, *random_pairs(found.scene, 5000, 3)).all()
    assert covered(tiles, *border_pairs(found.scene, 100, 3)).all()
    for light in found.render.lights:
        wr = Map(301, map_radius(found.scene, light)).views()
        assert covered(tiles, np.broadcast_to(light.vector, wr.shape), wr).all()


@pytest.mark.parametrize(("name", "share"), [("narrow", 0.25), ("sun", 0.15), ("range", 0.25)])
def test_little_else_is_kept(name: str, share: float) -> None:
    tiles = reached(config(SCENES[name]), grid_of())
    assert tiles.texels < share * thinned(grid_of()).texels


def test_without_a_scene_all_is_kept() -> None:
    grid = grid_of()
    assert reached(config(None), grid).texels == thinned(grid).texels
