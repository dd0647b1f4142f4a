"""The picture of a polar table's tiles: places, thinned bands, and tiles that are absent."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kernels import cubic_spline
from pipeline.arrays import Array
from pipeline.bundle.polar import atlas, look_up, storage
from pipeline.bundle.polar.prepare import grid_entry
from pipeline.diffraction import tiles
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import Tiles
from pipeline.tables.polar.compression import compress, whole
from pipeline.tables.polar.table import PolarTable

GRID = PolarGrid(Rings(60, 0.2, 1.6), Azimuths(640, 0.8, 0.4))
SECTORS = np.array([True, True, False, False, True])


def table_on(places: Tiles, seed: int = 5) -> PolarTable:
    """A table of smooth noise, whose absent tiles hold nothing that is known."""
    rings, azimuths = places.grid.rings.count, places.grid.azimuths.count
    samples = np.random.default_rng(seed).normal(size=(rings, 12, azimuths)).astype(np.float32)
    values = cubic_spline.coefficients(samples, places.every_of_ring)
    return PolarTable(values.reshape(rings, 3, 4, azimuths), places)


def with_holes(table: PolarTable, covered: NDArray[np.bool_]) -> PolarTable:
    places = replace(table.tiles, covered=covered)
    return PolarTable(np.where(places.mask()[:, None, None], table.values, np.float32(0.0)), places)


def directions(count: int = 20_000) -> Array:
    """(u, v, w) over the disc, a quarter of them near its centre and its rim."""
    rng = np.random.default_rng(8)
    rho, phi = 1.6 * np.sqrt(rng.random(count)), 2.0 * np.pi * rng.random(count)
    rho[: count // 8], rho[count // 8 : count // 4] = (
        0.05 * rng.random(count // 8),
        1.6 - 0.02 * rng.random(count // 8),
    )
    return np.stack([rho * np.cos(phi), rho * np.sin(phi), -np.sqrt(4.0 - rho**2) * rng.random(count)], axis=-1)


def evaluator(stored: storage.Stored) -> look_up.PolarTextures:
    planes = [np.moveaxis(stored.values[4 * q : 4 * q + 4], 0, -1) for q in range(stored.textures.count)]
    scale = [stored.scale[4 * q : 4 * q + 4].tolist() for q in range(stored.textures.count)]
    return look_up.PolarTextures(grid_entry(stored.textures, stored.atlas).model_dump(), planes, scale)


def supported(places: Tiles, uvw: Array) -> NDArray[np.bool_]:
    """Whether all 4 x 4 knots about each direction are in covered tiles, knot by knot."""
    grid, mask = places.grid, places.mask()
    ring, azimuth = (
        grid.rings.ring_from_rho(np.hypot(uvw[:, 0], uvw[:, 1])),
        grid.azimuths.azimuth_from_uv(uvw[:, :2]),
    )
    last, count, found = grid.rings.count - 1, grid.azimuths.count, np.ones(len(uvw), bool)
    for n, (r, a) in enumerate(zip(np.minimum(ring, last), azimuth, strict=True)):
        for row in range(int(r) - 1, int(r) + 3):
            at = last - abs(last - abs(row))
            every = places.every[at // 16]
            for knot in range(int(a / every) - 1, int(a / every) + 3):
                found[n] &= mask[at, (knot * every + (count // 2 if row < 0 else 0)) % count]
    return found


def test_a_table_that_keeps_everything_is_its_own_picture() -> None:
    values = np.random.default_rng(1).random((40, 4, 384), np.float32)
    found = atlas.place(tiles.whole(PolarGrid(Rings(40, 0.3), Azimuths(384))))
    np.testing.assert_array_equal(np.moveaxis(found.packed(values), 0, 1), values)
    assert (found.width, found.height) == (384, 40)


@pytest.mark.parametrize(("rings", "azimuths"), [(60, 640), (146, 1792), (157, 2304), (700, 8192)])
def test_tiles_neither_meet_nor_waste_the_picture(rings: int, azimuths: int) -> None:
    places = tiles.thinned(PolarGrid(Rings(rings, 0.06), Azimuths(azimuths)))
    found = atlas.place(places)
    assert found.mask().sum() == places.texels
    assert places.texels > 0.92 * found.width * found.height
    assert found.width <= 4096
    assert found.width % tiles.AZIMUTHS == 0


@pytest.mark.parametrize("every", [1, 2, 4])
def test_a_tiles_knots_follow_from_the_tile_alone(every: int) -> None:
    table = table_on(Tiles(GRID, np.ones((4, 5), bool), (every,) * 4)).values.reshape(60, 12, 640)
    holes = np.array([SECTORS] * 4)
    found = atlas.place(Tiles(GRID, holes, (every,) * 4))
    mask = found.tiles.mask()
    hidden = np.where(mask[:, None], table, np.float32(np.nan))
    picture = found.packed(hidden)
    np.testing.assert_array_equal(picture, found.packed(table))
    back = found.unpacked(picture)
    # the first and the last azimuths of a sector lean on the knots of the next
    inner = np.s_[:, :, 8:248]
    np.testing.assert_allclose(back[inner], table[inner], atol=2e-5)


@pytest.mark.parametrize("textures", ["all", 2])
@pytest.mark.parametrize("precision", ["float", "half"])
@pytest.mark.parametrize("where", ["sectors", "bands", "scattered"])
def test_absent_tiles_are_nan_and_leave_the_others_as_they_are(where: str, precision: str, textures: object) -> None:
    table, uvw = table_on(tiles.thinned(GRID)), directions(3000)
    assert table.tiles.every == (4, 2, 1, 1)
    covered = {
        "sectors": np.array([SECTORS] * 4),
        "bands": np.repeat([[True], [True], [False], [True]], 5, axis=1),
        "scattered": np.random.default_rng(3).random((4, 5)) < 0.8,
    }[where]
    part, known = with_holes(table, covered), supported(replace(table.tiles, covered=covered), uvw)
    assert 0.1 < known.mean() < 0.9
    np.testing.assert_array_equal(np.isfinite(part.look_up(uvw)).all(axis=1), known)
    np.testing.assert_array_equal(part.look_up(uvw)[known], table.look_up(uvw)[known])
    stored = storage.store(whole(part) if textures == "all" else compress(part, 2, None), precision)
    found = evaluator(stored).value(*uvw.T)
    np.testing.assert_array_equal(np.isfinite(found).all(axis=1), known)
    expected = stored.textures.look_up(uvw)
    np.testing.assert_array_equal(np.isfinite(expected).all(axis=1), known)
    np.testing.assert_allclose(found[known], expected[known], atol=2e-4)
    if textures == "all" and precision == "float":
        np.testing.assert_allclose(found[known], table.look_up(uvw)[known], atol=2e-4)


def test_the_evaluator_of_thinned_bands_is_the_tools_look_up() -> None:
    table, uvw = table_on(tiles.thinned(GRID)), directions()
    stored = storage.store(whole(table), "float")
    assert stored.values.shape[1] * stored.values.shape[2] < 0.8 * 60 * 640
    np.testing.assert_allclose(evaluator(stored).value(*uvw.T), table.look_up(uvw), atol=2e-4)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"every": [4, 2, 1]}, "not those of 4 bands and 5 sectors"),
        ({"every": [3, 2, 1, 1]}, "every is 1, or 2 or 4"),
        ({"starts": [[0] * 5, [0] * 5, [0] * 5, [10**6] * 5]}, r"starts\[3\]\[0\] is 1000000"),
    ],
)
def test_an_impossible_index_is_refused(changes: dict[str, object], fault: str) -> None:
    stored = storage.store(whole(table_on(tiles.thinned(GRID))), "float")
    entry = grid_entry(stored.textures, stored.atlas)
    with pytest.raises(ValueError, match=fault):
        type(entry).model_validate({**entry.model_dump(), **changes})
