"""The picture in which a bundle stores the tiles of a polar table.

A tile is up to 16 x 128 texels, and rows are rings; it has a half or a quarter of the columns where its band keeps so
many azimuths. Tiles follow each other band by band and sector by sector on shelves of 16 rows; each stands at a
multiple of its own width, which divides the picture's, so that none is cut. A table that keeps everything fills a
picture as wide as its azimuths in its own order: the picture is the table.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles
from pipeline.tables.polar.knots import inserted, removed

# columns of the textures that any device has; a table without gaps keeps one column for each azimuth and may be wider
_MOST_WIDTH = 4096
ABSENT = -1


@dataclass(frozen=True)
class Atlas:
    """Places of a table's tiles in a picture.

    tiles: of the table. width, height: of the picture, texels.
    starts: int (bands, sectors), row * width + column of each tile's first texel, ABSENT for a tile without values.
    """

    tiles: Tiles
    width: int
    height: int
    starts: NDArray[np.int64]

    def packed(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Arranges a table's coefficients (rings, outputs, azimuths) as (outputs, height, width), 0 between tiles."""
        picture = np.zeros((values.shape[1], self.height, self.width), np.float32)
        for every, part, place in self._places():
            picture[:, *place] = removed(np.moveaxis(values[part[0], :, part[1]], 1, 0), every)
        return picture

    def unpacked(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Returns the coefficients (rings, outputs, azimuths) on all azimuths; absent tiles are 0 between knots."""
        grid = self.tiles.grid
        values = np.zeros((grid.rings.count, len(picture), grid.azimuths.count), np.float32)
        for every, part, place in self._places():
            # the first azimuths of a ring hold its knots until others are inserted
            knots = slice(part[1].start // every, part[1].stop // every)
            values[part[0], :, knots] = np.moveaxis(picture[:, *place], 0, 1)
        for band, every in enumerate(self.tiles.every):
            rings = np.s_[RINGS * band : RINGS * (band + 1)]
            values[rings] = inserted(values[rings, :, : grid.azimuths.count // every], every)
        return values

    def mask(self) -> NDArray[np.bool_]:
        """Marks the texels of the picture that belong to tiles, (height, width)."""
        found = np.zeros((self.height, self.width), bool)
        for _, _, place in self._places():
            found[place] = True
        return found

    def _places(self) -> Iterator[tuple[int, tuple[slice, slice], tuple[slice, slice]]]:
        """Yields of each tile `every`, its rings and azimuths in the table, its rows and columns in the picture."""
        rings, azimuths = self.tiles.grid.rings.count, self.tiles.grid.azimuths.count
        for band, sector in np.argwhere(self.starts != ABSENT).tolist():
            every, (row, column) = self.tiles.every[band], divmod(int(self.starts[band, sector]), self.width)
            part = _part(band, RINGS, rings), _part(sector, AZIMUTHS, azimuths)
            rows, columns = (axis.stop - axis.start for axis in part)
            yield every, part, (slice(row, row + rows), slice(column, column + columns // every))


def _part(index: int, size: int, count: int) -> slice:
    return slice(index * size, min((index + 1) * size, count))


def place(tiles: Tiles) -> Atlas:
    """Chooses the picture of a table's tiles: the table's shape if it keeps everything, else the smallest picture."""
    azimuths = tiles.grid.azimuths.count
    if tiles.covered.all() and set(tiles.every) == {1}:
        return _placed(tiles, azimuths)
    # a picture is at least as wide as high
    least = AZIMUTHS * ceil(min(sqrt(tiles.texels), _MOST_WIDTH) / AZIMUTHS)
    widths = range(least, min(max(2 * least, azimuths), _MOST_WIDTH) + 1, AZIMUTHS)
    return min((_placed(tiles, width) for width in widths), key=lambda one: one.width * one.height)


def _placed(tiles: Tiles, width: int) -> Atlas:
    """Places tiles on shelves of a width, a multiple of AZIMUTHS unless the picture is the table."""
    rings, azimuths = tiles.grid.rings.count, tiles.grid.azimuths.count
    starts = np.full(tiles.covered.shape, ABSENT, np.int64)
    shelf, used, height = 0, 0, 1
    for band, sector in np.argwhere(tiles.covered).tolist():
        every = tiles.every[band]
        rows, columns = (
            axis.stop - axis.start for axis in (_part(band, RINGS, rings), _part(sector, AZIMUTHS, azimuths))
        )
        own = AZIMUTHS // every
        column = own * ceil(used / own)
        if column + columns // every > width:
            shelf, column = shelf + 1, 0
        starts[band, sector] = RINGS * shelf * width + column
        used, height = column + columns // every, max(height, RINGS * shelf + rows)
    return Atlas(tiles, width, height, starts)
