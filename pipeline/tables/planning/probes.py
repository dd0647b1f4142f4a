"""Directions between any table's texels, with the exact values there: what a grid leaves is measured at them."""

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction import power_spectrum
from pipeline.optics import geometry
from pipeline.optics.colour import delta_e
from pipeline.optics.random_directions import random_pairs
from pipeline.optics.scene import Scene
from pipeline.tables.planning.anisotropy import probing_angles
from pipeline.tables.planning.trial import Trial
from pipeline.tables.polar import spectral_integral
from pipeline.tables.polar import table as polar

# rings of probes: of so many that share all directions evenly, the innermost and one of every few beyond. Few
# directions lie on the flank of the mirror's lobe, and their errors are a hundred times the mean's
_SHARES, _INNERMOST, _EVERY = 192, 8, 4
_ANGLES = 64
_SPARE_W_TERMS = 8
_SEED = 19991


class Probes:
    """Exact means: from E at the probes' own rings and azimuths, with spare terms in |w|."""

    def __init__(self, trial: Trial, scene: Scene | None, exposure_ru: float) -> None:
        bake = trial.bake
        half, counts = probing_angles(trial.stack, _ANGLES, np.random.default_rng(_SEED))
        # angles of half a turn serve its other half as well
        angles = np.concatenate([half, half + np.pi])
        wi, wr = random_pairs(scene, _SHARES * len(angles), _SEED)
        uvw = geometry.uvw(wi, wr)
        beyond = np.arange(_INNERMOST + _EVERY // 2, _SHARES, _EVERY)
        order = np.argsort(np.hypot(uvw[:, 0], uvw[:, 1])).reshape(_SHARES, len(angles))
        order = order[np.concatenate([np.arange(_INNERMOST), beyond])]
        stands_for = np.where(np.arange(len(order)) < _INNERMOST, 1, _EVERY)[:, None]
        # the pairs of a ring share its radius and keep their own w
        rho = np.minimum(np.median(np.hypot(uvw[order, 0], uvw[order, 1]), axis=1), bake.rho_max)
        w = uvw[order, 2]
        along_x, along_y = np.outer(rho, np.cos(angles)), np.outer(rho, np.sin(angles))
        self._uvw = np.stack([along_x, along_y, w], axis=-1).reshape(-1, 3)
        factor = bake.radiometry.direction_factor(wi[order], wr[order])
        self._factor = factor.reshape(-1, 1)
        self._exact = _exact(trial, half, rho, w).reshape(-1, 3)
        self._counts = (stands_for * np.tile(counts, 2)).ravel()
        self._exposure_ru = exposure_ru

    def error(self, table: polar.PolarTable) -> float:
        """Mean CIELAB error of a table."""
        found = np.nan_to_num(table.look_up(self._uvw))
        error = delta_e(self._factor * found, self._factor * self._exact, self._exposure_ru)
        return float(np.average(error, weights=self._counts))


def _exact(trial: Trial, half_turn: Array, rho: Array, w: Array) -> Array:
    """XYZ / (C cos ti) (rhos, angles, 3) on rings `rho` at both half turns' angles, for `w` (rhos, angles)."""
    bake = trial.bake
    found = power_spectrum.gather(trial.stack, half_turn, bake.radius_per_um, bake.lambda_min_nm, bake.s_nodes)
    s_max, w_terms = power_spectrum.s_max(bake.lambda_min_nm), bake.w_terms + _SPARE_W_TERMS
    terms = spectral_integral.integrate(found, bake.radius_per_um, s_max, rho, bake.rules(rho), w_terms)
    x = polar.w_position(rho[:, None], w)
    cosines = np.cos(np.arange(terms.shape[2]) * np.arccos(x)[..., None])
    return np.asarray(np.einsum("rcka,rak->rac", terms, cosines))
