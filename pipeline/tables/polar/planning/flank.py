"""The choice of innermost rings, terms in |w| and nodes in s for the flank of the specular lobe.

XYZ falls there by orders of magnitude from ring to ring, and the lobe of a grazing light is up to fifty times as
bright as that of a normal one: errors that a mean over all directions forgives are colours there.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from math import asinh, ceil, sinh
from typing import NamedTuple

import numpy as np

from pipeline.diffraction.polar_grid import BEYOND, TILE, Azimuths, Rings, last_ring
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.optics import geometry
from pipeline.optics.coherence import FLANK_DELTA_E, FLANK_RU, FLANK_WIDTHS, lobe_width
from pipeline.optics.colour import delta_e
from pipeline.scene.model import Scene
from pipeline.scene.pairs import flank_pairs
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning.exact import exact
from pipeline.tables.polar.planning.grids import DISTANCES, Grids
from pipeline.tables.polar.planning.trial import Trial

# share of the limit that the error of all but _RAREST of the test directions may take. A zero of a colour channel,
# beside which hues turn, can be anywhere near; a certificate draws a tenth of that number of directions
_SHARE, _RAREST = 0.75, 1.0 / 4096.0
# multiple of the least error, up to which fewer bytes are better where none keep the limit
_NEAR = 1.1
# terms in |w| and nodes in s beyond those of the mean error: those among which the planner chooses, and those of
# exact values
_MORE_W_TERMS, _MORE_S_NODES = (0, 4), (0, 2)
_SPARE_W_TERMS, _SPARE_S_NODES = 8, 4
# test directions: radii, and azimuths of half a turn
_RADII, _ANGLES = 48, 64
_SEED = 19991
# azimuths of the tables, a quarter of the lobe's width apart
_AZIMUTHS = 8 * TILE
# rings continue beyond the flank, because a spline feels the end of its rings
_MARGIN = 1.5


class FlankProbes:
    """Test directions on the flank, whose errors depend on the innermost rings alone."""

    def __init__(self, trial: Trial, scene: Scene | None) -> None:
        """Draws the directions and computes their XYZ from E with additional nodes in s and terms in |w|.

        trial: the window's stack and settings. scene: lights and views, None for all.
        """
        bake = trial.bake
        self._trial = trial
        reach = min(FLANK_WIDTHS * lobe_width(bake.radiometry.light.middle_nm, bake.sigma_um), bake.rho_max)
        self._end = min(_MARGIN * reach, last_ring(bake.rho_max))
        half, _ = trial.scattering.probing_angles(_ANGLES, np.random.default_rng(_SEED))
        angles = np.concatenate([half, half + np.pi])
        rho = reach * (np.arange(_RADII) + 0.5) / _RADII
        radius, phi = (grid.ravel() for grid in np.meshgrid(rho, angles, indexing="ij"))
        wi, wr = flank_pairs(scene, radius, phi, _SEED)
        seen = np.isfinite(wr[:, 2])
        # a view that is left aside has the |w| of a normal light, which every ring has
        w = np.where(seen, geometry.uvw(wi, wr)[:, 2], -1.0)
        rich = replace(
            bake, rho_max=self._end, s_nodes=bake.s_nodes + _SPARE_S_NODES, w_terms=bake.w_terms + _SPARE_W_TERMS
        )
        found = exact(rich, trial.stack, half, rho, w.reshape(len(rho), -1)).reshape(-1, 3)
        uvw = np.stack([radius * np.cos(phi), radius * np.sin(phi), w], axis=-1)
        factor = bake.radiometry.direction_factor(wi[seen], wr[seen])[:, None]
        self._uvw, self._factor, self._exact = uvw[seen], factor, factor * found[seen]
        self._power: dict[int, PolarPowerSpectrum] = {}

    def error(self, bake: PolarBake, rings: Rings) -> float:
        """Computes the CIELAB error at FLANK_RU that few directions exceed; 0 where the scene sees none of the flank.

        bake: the settings of a table. rings: of the whole table, of which the innermost ones are made.
        """
        if not len(self._uvw):
            return 0.0
        inner = replace(bake, rho_max=self._end)
        last = ceil(asinh(self._end / rings.r0) / rings.step)
        near = Rings(last + 1, rings.r0, rings.r0 * sinh(last * rings.step) / BEYOND)
        if inner.s_nodes not in self._power:
            self._power[inner.s_nodes] = inner.power_spectrum(self._trial.stack, Azimuths(_AZIMUTHS))
        table = inner.table(self._power[inner.s_nodes], near, inner.rules(near.rho()))
        found = self._factor * np.nan_to_num(table.look_up(self._uvw))
        errors = np.sort(delta_e(np.maximum(found, 0.0), self._exact, FLANK_RU))
        return float(errors[-1 - int(_RAREST * len(errors))])


class _Numbers(NamedTuple):
    """Terms in |w|, nodes in s, and the distance of the innermost rings in DISTANCES."""

    w_terms: int
    s_nodes: int
    distance: float


def choose(trial: Trial, layout: PolarLayout, scene: Scene | None, delta_e: float) -> tuple[PolarBake, float]:
    """Chooses the numbers of the fewest bytes of E and table whose errors keep the flank's limit.

    Where none keep it, the fewest bytes whose errors are near the least that was measured. Rings that the layout sets
    stay where they are, and the flank of a laser line, whose rings are close everywhere, asks for nothing.

    trial: the window's stack and settings. layout: numbers that are set. scene: lights and views, None for all.
    delta_e: mean CIELAB error allowed.
    Returns the settings with nodes in s and terms in |w|, and the distance of the innermost rings, in widths of the
    specular lobe at the shortest wavelength.
    """
    bake = trial.bake
    if bake.radiometry.light.is_line or layout.rings != "auto":
        return bake, DISTANCES[0]
    probes = FlankProbes(trial, scene)
    grids = {one: Grids(bake, layout, delta_e, one) for one in DISTANCES}
    errors: dict[_Numbers, float] = {}

    def error(numbers: _Numbers) -> float:
        if numbers not in errors:
            settings = replace(bake, w_terms=numbers.w_terms, s_nodes=numbers.s_nodes)
            errors[numbers] = probes.error(settings, grids[numbers.distance].innermost())
        return errors[numbers]

    allowed = _by_bytes(bake, layout, grids)

    def cheapest(limit: float) -> _Numbers | None:
        return _cheapest(allowed, lambda numbers: error(numbers) <= limit)

    numbers = cheapest(_SHARE * FLANK_DELTA_E) or cheapest(_NEAR * min(errors.values()))
    numbers = numbers or min(errors, key=errors.__getitem__)
    return replace(bake, w_terms=numbers.w_terms, s_nodes=numbers.s_nodes), numbers.distance


def _cheapest(allowed: list[_Numbers], kept: Callable[[_Numbers], bool]) -> _Numbers | None:
    """Finds the first choice that keeps the limit, None where none does.

    No terms and nodes mend the error of rings, and no rings mend that of terms and nodes: few choices are tried.
    """
    finest = DISTANCES[-1]
    richest = _Numbers(max(one.w_terms for one in allowed), max(one.s_nodes for one in allowed), finest)
    coarsest = bisect_left(DISTANCES, True, key=lambda one: kept(richest._replace(distance=one)))
    hopeless = set()
    for numbers in allowed:
        if numbers.distance not in DISTANCES[coarsest:] or numbers._replace(distance=finest) in hopeless:
            continue
        if kept(numbers):
            return numbers
        if not kept(numbers._replace(distance=finest)):
            hopeless.add(numbers._replace(distance=finest))
    return None


def _by_bytes(bake: PolarBake, layout: PolarLayout, grids: dict[float, Grids]) -> list[_Numbers]:
    """Lists all choices, by the bytes of E and of a table on the grid at which the search starts.

    bake: numbers for the mean error, at least. layout: numbers that are set. grids: those of each distance.
    """
    more_w_terms = _MORE_W_TERMS if layout.w_terms == "auto" else (0,)
    more = product(more_w_terms, _MORE_S_NODES, DISTANCES)
    rings = {distance: found.first()[0] for distance, found in grids.items()}

    def size(numbers: _Numbers) -> int:
        return len(bake.radius_per_um) * numbers.s_nodes + 3 * rings[numbers.distance] * numbers.w_terms

    return sorted((_Numbers(bake.w_terms + w, bake.s_nodes + s, distance) for w, s, distance in more), key=size)
