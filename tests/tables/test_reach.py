"""The texels that a scene visits, and the tiles that hold them."""

import numpy as np
import pytest

from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import whole
from pipeline.optics import geometry
from pipeline.scene.cameras import Camera
from pipeline.scene.lights import Cone, Parallel, Sun
from pipeline.scene.model import Scene, Views
from pipeline.scene.pairs import random_pairs
from pipeline.tables.polar import reach as reaching

CAMERA = Camera(position=(100.0, -50.0, 200.0), fov_deg=20.0, size=(80, 60))
GRID = PolarGrid(Rings(150, 0.06), Azimuths(1664, 0.75, 0.1))


def cells_of(uvw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ring and the azimuth below each direction."""
    ring = GRID.rings.ring_from_rho(np.hypot(uvw[:, 0], uvw[:, 1]))
    return ring.astype(int), GRID.azimuths.azimuth_from_uv(uvw[:, :2]).astype(int)


@pytest.mark.parametrize(
    "scene",
    [
        Scene(lights=[Parallel(theta_deg=0)]),
        Scene(lights=[Parallel(theta_deg=45, phi_deg=170)], views=Views(theta_max_deg=30)),
        Scene(lights=[Parallel(theta_deg=20, phi_deg=10), Parallel(theta_deg=70)], views=Views(theta_max_deg=5)),
        Scene(lights=[Parallel(theta_deg=60, phi_deg=3)], views=Views(theta_max_deg=0.1)),
        Scene(lights=[Cone(kind="cone", theta_deg=30, phi_deg=80, diameter_deg=12)], views=Views(theta_max_deg=20)),
        Scene(lights=[Sun(kind="sun", theta_deg=25, phi_deg=300)], cameras=[CAMERA], sample=(50.0, 50.0)),
    ],
)
def test_every_direction_of_a_scene_interpolates_from_reached_texels_of_known_cells(scene: Scene) -> None:
    found = reaching.reach(scene, GRID)
    uvw = geometry.uvw(*random_pairs(scene, 5000, 3))
    ring, azimuth = cells_of(uvw)
    for i in (-1, 0, 1, 2):
        # below the first ring, a spline takes the opposite half turn
        turned = np.where(ring + i < 0, GRID.azimuths.count // 2, 0)
        inside = ring + i < GRID.rings.count
        for j in (-1, 0, 1, 2):
            place = np.abs(ring + i)[inside], ((azimuth + j + turned) % GRID.azimuths.count)[inside]
            assert found.texels[place].all()
    assert reaching.known_cells(found.tiles())[ring, azimuth].all()


def test_a_narrow_scene_needs_few_tiles_and_none_needs_all() -> None:
    scene = Scene(lights=[Parallel(theta_deg=45, phi_deg=180)], views=Views(theta_max_deg=30))
    assert reaching.reach(scene, GRID).tiles().covered.mean() < 0.4
    everything = reaching.reach(None, GRID)
    assert everything.share == 1.0
    assert everything.tiles().covered.all()


def test_sampled_directions_reach_what_the_cone_that_they_fill_reaches() -> None:
    scene = Scene(lights=[Parallel(theta_deg=45, phi_deg=180)], views=Views(theta_max_deg=30))
    sampled = reaching.of_directions(GRID, geometry.uvw(*random_pairs(scene, 400_000, 1)))
    exact = reaching.reach(scene, GRID)
    assert np.mean(sampled.texels & ~exact.texels) == 0.0
    assert np.mean(exact.texels & ~sampled.texels) < 0.02


def test_cells_beside_a_missing_tile_are_not_known() -> None:
    tiles = whole(GRID)
    assert reaching.known_cells(tiles).all()
    tiles.covered[4, 5] = False
    known = reaching.known_cells(tiles)
    assert not known[64 - reaching.MARGIN, 5 * 128 - reaching.MARGIN]
    assert known[64 - reaching.MARGIN - 3, 5 * 128 + 60]


def test_the_smooth_continuation_of_w_is_exact_away_from_the_horizon() -> None:
    wi = geometry.direction(np.radians(30.0), 0.4)
    wr = geometry.direction(np.radians(np.linspace(0.0, 89.9, 200)), 2.0)
    uvw = geometry.uvw(np.broadcast_to(wi, wr.shape), wr)
    np.testing.assert_allclose(reaching.w_of(wi, uvw[:, :2]), np.abs(uvw[:, 2]), atol=1e-12)
    smooth, step = reaching.smooth_w_of(wi, uvw[:, :2], 0.03), wr[:, 2] ** 2 >= 0.03
    np.testing.assert_allclose(smooth[step], np.abs(uvw[step, 2]), atol=1e-12)
    assert np.max(np.abs(smooth - np.abs(uvw[:, 2]))) < 0.5 * np.sqrt(0.03)
