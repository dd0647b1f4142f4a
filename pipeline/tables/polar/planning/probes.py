"""Test directions of the planner, with exact XYZ, at which the error of a grid is measured."""

from dataclasses import replace
from functools import cached_property
from math import ceil

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.polar_grid import TILE, Azimuths, Rings, last_ring
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.optics import geometry
from pipeline.optics.coherence import FLANK_RU, FLANK_WIDTHS, lobe_width
from pipeline.optics.colour import delta_e
from pipeline.scene.model import Scene
from pipeline.scene.pairs import flank_pairs, random_pairs
from pipeline.tables.polar import spectral_integral
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.planning.anisotropy import probing_angles
from pipeline.tables.polar.planning.trial import Trial

# random directions are sorted by rho and divided into _SHARES rings of equal number, of which the _INNERMOST and one
# of every _EVERY others are used: few directions lie on the flank of the specular lobe, where errors are a hundred
# times the mean
_SHARES, _INNERMOST, _EVERY = 192, 8, 4
_ANGLES = 64
_SPARE_W_TERMS = 8
_SEED = 19991
# of the flank: radii between its rings, and azimuths of its tables, a quarter of the lobe's width apart
_FLANK_RADII, _FLANK_AZIMUTHS = 24, 8 * TILE
# rings continue beyond the flank, because a spline feels the end of its rings
_FLANK_MARGIN = 1.5


class Probes:
    """Test directions; their exact XYZ come from E on their own rings and azimuths, with additional terms in |w|."""

    def __init__(self, trial: Trial, scene: Scene | None, exposure_ru: float) -> None:
        """Draws the directions and computes their XYZ.

        trial: the window's stack and settings. scene: lights and views, None for all.
        exposure_ru: exposure at which colour errors are measured, RU.
        """
        bake = trial.bake
        half, counts = probing_angles(trial.stack, _ANGLES, np.random.default_rng(_SEED))
        # the azimuths of half a turn are used in the other half as well
        angles = np.concatenate([half, half + np.pi])
        wi, wr = random_pairs(scene, _SHARES * len(angles), _SEED)
        uvw = geometry.uvw(wi, wr)
        beyond = np.arange(_INNERMOST + _EVERY // 2, _SHARES, _EVERY)
        order = np.argsort(np.hypot(uvw[:, 0], uvw[:, 1])).reshape(_SHARES, len(angles))
        order = order[np.concatenate([np.arange(_INNERMOST), beyond])]
        represented = np.where(np.arange(len(order)) < _INNERMOST, 1, _EVERY)[:, None]
        # the pairs of a ring get its median radius and keep their own w
        rho = np.minimum(np.median(np.hypot(uvw[order, 0], uvw[order, 1]), axis=1), bake.rho_max)
        w = uvw[order, 2]
        along_x, along_y = np.outer(rho, np.cos(angles)), np.outer(rho, np.sin(angles))
        self._uvw = np.stack([along_x, along_y, w], axis=-1).reshape(-1, 3)
        factor = bake.radiometry.direction_factor(wi[order], wr[order])
        self._factor = factor.reshape(-1, 1)
        self._exact = _exact(trial, half, rho, w).reshape(-1, 3)
        self._counts = (represented * np.tile(counts, 2)).ravel()
        self._exposure_ru = exposure_ru

    def error(self, table: polar.PolarTable) -> float:
        """Computes the mean CIELAB error of a table over the test directions."""
        found = np.nan_to_num(table.look_up(self._uvw))
        error = delta_e(self._factor * found, self._factor * self._exact, self._exposure_ru)
        return float(np.average(error, weights=self._counts))


class FlankProbes:
    """Test directions on the flank of the specular lobe, where XYZ falls by orders of magnitude from ring to ring.

    Their errors depend on the distance of the rings there alone, so tables of the innermost rings suffice.
    """

    def __init__(self, trial: Trial, scene: Scene | None) -> None:
        """Draws the directions and computes their XYZ.

        trial: the window's stack and settings. scene: lights and views, None for all.
        """
        self._trial, bake = trial, trial.bake
        self._reach = min(FLANK_WIDTHS * lobe_width(bake.radiometry.light.middle_nm, bake.sigma_um), bake.rho_max)
        half, _ = probing_angles(trial.stack, _ANGLES, np.random.default_rng(_SEED))
        angles = np.concatenate([half, half + np.pi])
        rho = self._reach * (np.arange(_FLANK_RADII) + 0.5) / _FLANK_RADII
        radius, phi = (grid.ravel() for grid in np.meshgrid(rho, angles, indexing="ij"))
        wi, wr = flank_pairs(scene, radius, phi, _SEED)
        seen = np.isfinite(wr[:, 2])
        # a view that is left aside has the |w| of a normal light, which every ring has
        w = np.where(seen, geometry.uvw(wi, wr)[:, 2], -1.0)
        exact = _exact(trial, half, rho, w.reshape(len(rho), -1)).reshape(-1, 3)
        uvw = np.stack([radius * np.cos(phi), radius * np.sin(phi), w], axis=-1)
        factor = bake.radiometry.direction_factor(wi[seen], wr[seen])[:, None]
        self._uvw, self._factor, self._exact = uvw[seen], factor, factor * exact[seen]

    def largest_error(self, distance: float) -> float:
        """Computes the largest CIELAB error at FLANK_RU of a table whose rings are `distance` apart in rho.

        It is 0 where the scene sees none of the flank.
        """
        if not len(self._uvw):
            return 0.0
        inner, power = self._inner
        rings = Rings(ceil(last_ring(inner.rho_max) / distance) + 1, 4.0 * inner.rho_max, inner.rho_max)
        table = inner.table(power, rings, inner.rules(rings.rho()))
        found = self._factor * np.nan_to_num(table.look_up(self._uvw))
        return float(delta_e(np.maximum(found, 0.0), self._exact, FLANK_RU).max())

    @cached_property
    def _inner(self) -> tuple[PolarBake, PolarPowerSpectrum]:
        """The settings of tables of the innermost rings, and E for them."""
        bake = self._trial.bake
        inner = replace(bake, rho_max=min(_FLANK_MARGIN * self._reach, bake.rho_max))
        return inner, inner.power_spectrum(self._trial.stack, Azimuths(_FLANK_AZIMUTHS))


def _exact(trial: Trial, half_turn: Array, rho: Array, w: Array) -> Array:
    """Computes XYZ / (C cos ti) from E itself.

    half_turn: azimuths (a,), radians; their opposites follow. rho: (n_rings,). w: (n_rings, 2 a).
    Returns (n_rings, 2 a, 3).
    """
    bake = trial.bake
    found = power_spectrum.gather(trial.stack, half_turn, bake.radius_per_um, bake.lambda_min_nm, bake.s_nodes)
    s_max, w_terms = power_spectrum.s_max(bake.lambda_min_nm), bake.w_terms + _SPARE_W_TERMS
    terms = spectral_integral.integrate(found, bake.radius_per_um, s_max, rho, bake.rules(rho), w_terms)
    x = polar.w_position(rho[:, None], w)
    cosines = np.cos(np.arange(terms.shape[2]) * np.arccos(x)[..., None])
    return np.asarray(np.einsum("rcka,rak->rac", terms, cosines))
