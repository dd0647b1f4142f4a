"""Polar tables that are baked tile by tile: only the tiles that a scene reaches.

A texel holds X, Y and Z as polynomials in |w|, for any light and view. On a flat sample under one directional light,
(u, v) determines the view and so |w| = cos(ti) + cos(tr): a texel then holds one value for each of X, Y and Z, and
one value in all under a laser line, whose X and Z are constant multiples of Y. A tile depends on its grid, on light
and material, never on the tiles that are baked with it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray

from kernels import cubic_spline, spectral_operator
from kernels.programs import LANES, ORDER
from kernels.spectral_operator import LinePoints, RingIntegrals, RingQuadratures, Span
from pipeline.arrays import Array
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.polar_grid import PolarGrid
from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles
from pipeline.optics.brdf import Radiometry
from pipeline.surface.windows import MIDDLE, Places
from pipeline.tables.polar import line_points
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.reach import known_cells, smooth_w_of, w_of
from pipeline.tables.polar.spectral_integral import Integrand, on_rings
from pipeline.tables.polar.table import direction_factor, w_position

_VECTORS = AZIMUTHS // LANES  # of a sector
# radii of E beyond those of a band's wavelengths, for Lagrange's polynomials
_SPARE_RADII = ORDER
# rings beyond the horizon of views that are computed; the last is repeated, and a look-up at the horizon feels that
# by a weight of 0.268^3 / 6
_BEYOND_HORIZON = 3
# largest difference of |w| at which a direction belongs to the light of a table
_SAME_W = 1e-4

# samples of tiles by band and sector, float32 (rings of the band, outputs, AZIMUTHS)
Samples = dict[tuple[int, int], NDArray[np.float32]]


@dataclass(frozen=True)
class TileBake:
    """The bake of tiles.

    bake: the settings. grid: the texels. wi: unit vector towards the light (3,), None for polynomials in |w|, which
    serve all lights. w_terms: computes the number of nodes in |w| for half the width of the interval of one light.
    """

    bake: PolarBake
    grid: PolarGrid
    wi: Array | None
    w_terms: Callable[[float], int]

    @cached_property
    def rules(self) -> RingQuadratures:
        """Wavelengths of all rings of the grid."""
        return self.bake.rules(self.grid.rings.rho())

    @property
    def primaries(self) -> Array:
        """XYZ of one unit of every channel, (channels, 3): Y alone is stored for a laser line and one light."""
        if not self._is_luminance:
            return np.eye(3)
        weights = self.bake.radiometry.illumination(1.0).weights
        return np.asarray(weights / weights[:, 1:2])

    @property
    def _is_luminance(self) -> bool:
        return self.wi is not None and self.bake.radiometry.light.is_line

    @property
    def outputs(self) -> int:
        """Number of values of a texel."""
        return 3 * self.bake.w_terms if self.wi is None else len(self.primaries)

    def radii(self, of_bands: NDArray[np.intp]) -> slice:
        """Returns the radii of E that bands need, as a part of `PolarBake.radius_per_um`."""
        radius, rho = self.bake.radius_per_um, self.grid.rings.rho()
        first, last = rho[self._rings(of_bands[0])][0], rho[self._rings(of_bands[-1])][-1]
        low, high = self.rules.kappa_ends_per_um
        start, stop = np.searchsorted(radius, [first * low.min(), last * high.max()])
        return slice(max(0, int(start) - _SPARE_RADII), min(len(radius), int(stop) + _SPARE_RADII))

    def half_turn(self, tiles: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Lists the azimuths of half a turn at which E serves tiles (bands, sectors), with those half a turn on."""
        half = self.grid.azimuths.count // (2 * LANES)
        vectors = np.unique(_vectors(np.flatnonzero(tiles.any(axis=0))) % half)
        return np.asarray((LANES * vectors[:, None] + np.arange(LANES)).ravel())

    @cached_property
    def _last_ring(self) -> int:
        """The last ring that is computed: under one light, a few beyond the horizon of all views."""
        last = self.grid.rings.count - 1
        if self.wi is None:
            return last
        horizon = self.grid.rings.ring_from_rho(np.asarray(1.0 + np.hypot(self.wi[0], self.wi[1])))
        return min(last, ceil(float(horizon)) + _BEYOND_HORIZON)

    def _rings(self, band: int) -> NDArray[np.intp]:
        """Returns the ring of each row of a band; the last one that is computed serves those beyond it."""
        rings = np.arange(RINGS * band, min(RINGS * (band + 1), self.grid.rings.count))
        return np.minimum(rings, self._last_ring)

    def samples(self, stack: Stack, missing: NDArray[np.bool_], places: Places = MIDDLE) -> Samples:
        """Computes the samples of tiles.

        stack: of the coherence window. missing: the tiles to bake (bands, sectors). places: positions of the window.
        Raises DeviceError if no device works.
        """
        if not missing.any():
            return {}
        radius = self.bake.radius_per_um[self.radii(np.flatnonzero(missing.any(axis=1)))]
        half, azimuths = self.grid.azimuths.count // (2 * LANES), self.half_turn(missing)
        phi, vectors = self.grid.azimuths.phi()[azimuths], azimuths[::LANES] // LANES
        lambda_min, nodes = self.bake.lambda_min_nm, self.bake.s_nodes
        values = power_spectrum.gather(stack, phi, radius, lambda_min, nodes, places)
        at = np.full(2 * half, -1)
        at[vectors], at[vectors + half] = np.arange(len(vectors)), len(vectors) + np.arange(len(vectors))
        found: Samples = {}
        for band in np.flatnonzero(missing.any(axis=1)):
            found |= self._band(int(band), np.flatnonzero(missing[band]), values, radius, at)
        return found

    def _band(
        self,
        band: int,
        sectors: NDArray[np.intp],
        values: NDArray[np.float32],
        radius: Array,
        at: NDArray[np.intp],
    ) -> Samples:
        """Integrates E (values) on some of its radii over wavelengths, for the tiles of one band.

        at: where in E the vectors of azimuths of the whole turn lie.
        """
        rings, row = np.unique(self._rings(band), return_inverse=True)
        rho, rules = self.grid.rings.rho()[rings], _of_rings(self.rules, rings)
        s_max = power_spectrum.s_max(self.bake.lambda_min_nm)
        points = line_points.choose(radius, self.bake.s_nodes, s_max, rho, rules)
        wanted = _vectors(sectors)
        vectors = _paired(wanted, len(at) // 2) if (points.place < 0).any() else wanted.reshape(2, -1)
        azimuths = (LANES * vectors.ravel()[:, None] + np.arange(LANES)).ravel()
        of = _Band(values, at[vectors].T, radius, s_max, rho, points, rules)
        kept = self._polynomials(of) if self.wi is None else self._values(of, self.wi, azimuths)
        place = np.empty(len(at), int)
        place[vectors.ravel()] = np.arange(vectors.size)
        by_vector = kept.reshape(*kept.shape[:2], -1, LANES)
        of_sector = {int(k): by_vector[:, :, place[_vectors(np.array([k]))]] for k in sectors}
        return {(band, k): tile[row].reshape(len(row), -1, AZIMUTHS) for k, tile in of_sector.items()}

    def _polynomials(self, of: "_Band") -> NDArray[np.float32]:
        """Computes the Chebyshev terms in |w| (n_rings, 3 w terms, azimuths)."""
        light = self._on_rings(of, spectral_operator.whole_span(of.rho, of.points), self.bake.w_terms)
        (found,) = spectral_operator.integrate(of.values, of.radius, of.s_max, of.rho, [light], of.pairs)
        return np.asarray(found)

    def _values(self, of: "_Band", wi: Array, azimuths: NDArray[np.intp]) -> NDArray[np.float32]:
        """Computes X, Y and Z, or Y alone, at |w| of the light (n_rings, channels, azimuths); azimuths: by index."""
        phi = self.grid.azimuths.phi()
        uv = np.stack([np.outer(of.rho, np.cos(phi)), np.outer(of.rho, np.sin(phi))], axis=-1)
        # over the whole turn, so that nodes do not depend on the tiles that are baked
        w = smooth_w_of(wi, uv, self.grid.rings.step)
        span = _span(w, of.points)
        light = self._on_rings(of, span, self.w_terms(0.5 * float(np.max(span.high - span.low))))
        found = spectral_operator.integrate_at(
            of.values, of.radius, of.s_max, of.rho, light, of.pairs, w[:, azimuths]
        )
        return found[:, 1:2] if self._is_luminance else found

    def _on_rings(self, of: "_Band", span: Span, w_terms: int) -> RingIntegrals:
        return on_rings(of.rho, of.points, span, Integrand(of.rules, self.bake.radiometry.reflectance), w_terms)


@dataclass(frozen=True)
class _Band:
    """The rings of a band and E for them: the arguments of the spectral operator, as `integrate` there has them."""

    values: NDArray[np.float32]
    pairs: NDArray[np.intp]
    radius: Array
    s_max: float
    rho: Array
    points: LinePoints
    rules: RingQuadratures


@dataclass(frozen=True)
class TileTable:
    """Coefficients of bicubic B-splines of some tiles.

    values: float32 (rings, outputs, azimuths), to the last covered band; they continue samples that are repeated from
    the nearest covered texel where no tile is. tiles: those that were baked. primaries: XYZ of one unit of every
    channel (channels, 3). wi: unit vector towards the light (3,), None for polynomials in |w|.
    """

    values: NDArray[np.float32]
    tiles: Tiles
    primaries: Array
    wi: Array | None

    @property
    def nbytes(self) -> int:
        """Bytes of the samples of all tiles."""
        return int(4 * self.tiles.texels * self.values.shape[1])

    @cached_property
    def _known(self) -> NDArray[np.bool_]:
        return known_cells(self.tiles)

    @cached_property
    def _xyz(self) -> NDArray[np.float32]:
        if len(self.primaries) == 3:
            return self.values
        return np.ascontiguousarray(np.einsum("rca,cx->rxa", self.values, self.primaries.astype(np.float32)))

    def look_up(self, uvw: Array) -> Array:
        """Computes XYZ / (C cos ti) (directions, 3) at `uvw` (directions, 3).

        NaN where no tile covers the look-up, and where |w| is not that of the table's one light.
        """
        grid, uv = self.tiles.grid, uvw[:, :2]
        rho = np.hypot(uv[:, 0], uv[:, 1])
        ring = np.clip(grid.rings.ring_from_rho(rho), 0.0, grid.rings.count - 1.0)
        azimuth = grid.azimuths.azimuth_from_uv(uv)
        known = self._known[ring.astype(int), azimuth.astype(int)]
        if self.wi is not None:
            known &= np.abs(np.abs(uvw[:, 2]) - w_of(self.wi, uv)) <= _SAME_W
        # one value a texel is a polynomial of one term
        of = np.minimum(ring, len(self.values) - 1.0), azimuth, w_position(rho, uvw[:, 2])
        found = cubic_spline.look_up(self._xyz, *of)
        return np.asarray(np.where(known[:, None], found.astype(np.float64), np.nan))

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (directions,) for unit vectors wi, wr (directions, 3), as a polar table does."""
        return direction_factor(radiometry, wi, wr)


def assemble(samples: Mapping[tuple[int, int], NDArray[np.float32]], tiles: Tiles, bake: TileBake) -> TileTable:
    """Puts splines through the samples of tiles.

    samples: of all covered tiles, by band and sector. tiles: which these are, at least one. bake: their bake.
    """
    grid = tiles.grid
    last = int(np.flatnonzero(tiles.covered.any(axis=1))[-1])
    rings = min(RINGS * (last + 1), grid.rings.count)
    values = np.empty((rings, bake.outputs, grid.azimuths.count), np.float32)
    for (band, sector), tile in samples.items():
        values[RINGS * band : RINGS * band + len(tile), :, AZIMUTHS * sector : AZIMUTHS * (sector + 1)] = tile
    _fill(values, tiles.covered[: last + 1])
    coefficients = cubic_spline.coefficients(values, tiles.every_of_ring[:rings])
    return TileTable(coefficients, tiles, bake.primaries, bake.wi)


def _fill(values: NDArray[np.float32], covered: NDArray[np.bool_]) -> None:
    """Continues samples (rings, channels, azimuths) into tiles that are not covered, from the nearest that is."""
    by_band = [slice(RINGS * b, min(RINGS * (b + 1), len(values))) for b in range(len(covered))]
    filled, turn = covered.any(axis=1), covered.shape[1]
    for band in np.flatnonzero(filled & ~covered.all(axis=1)):
        have = np.flatnonzero(covered[band])
        for sector in np.flatnonzero(~covered[band]):
            # the turn is periodic
            away = (have - sector + turn // 2) % turn - turn // 2
            nearest = int(away[np.argmin(np.abs(away))])
            end = AZIMUTHS * ((sector + nearest) % turn) + (0 if nearest > 0 else AZIMUTHS - 1)
            part = values[by_band[band]]
            part[:, :, AZIMUTHS * sector : AZIMUTHS * (sector + 1)] = part[:, :, end : end + 1]
    have = np.flatnonzero(filled)
    for band in np.flatnonzero(~filled):
        nearest = int(have[np.argmin(np.abs(have - band))])
        ring = by_band[nearest].start if nearest > band else by_band[nearest].stop - 1
        values[by_band[band]] = values[ring]


def _vectors(of_sectors: NDArray[np.intp]) -> NDArray[np.intp]:
    """Lists the vectors of LANES azimuths of sectors."""
    return np.asarray((_VECTORS * of_sectors[:, None] + np.arange(_VECTORS)).ravel())


def _paired(vectors: NDArray[np.intp], half: int) -> NDArray[np.intp]:
    """Pairs vectors of azimuths with those half a turn on, (2, pairs); half: vectors of half a turn."""
    first = np.unique(vectors % half)
    return np.stack([first, first + half])


def _of_rings(rules: RingQuadratures, rings: NDArray[np.intp]) -> RingQuadratures:
    of_rings = rules.first[rings], rules.count[rings], rules.usual[rings]
    return RingQuadratures(rules.lambda_um, rules.weights, *of_rings)


def _span(w: Array, points: LinePoints) -> Span:
    """Finds the interval of |w| of the first ring of every group that serves all its rings.

    w: |w| of the rings (rings, azimuths).
    """
    stretch = points.stretch[:, None]
    low, high = (w / stretch).min(axis=1), (w / stretch).max(axis=1)
    return Span(np.minimum.reduceat(low, points.first_ring), np.maximum.reduceat(high, points.first_ring))
