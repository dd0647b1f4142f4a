"""Test directions of the planner, with exact XYZ, at which the error of a grid is measured."""

from dataclasses import replace

import numpy as np

from pipeline.optics import geometry
from pipeline.optics.colour import delta_e
from pipeline.scene.model import Scene
from pipeline.scene.pairs import random_pairs
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.planning.exact import exact
from pipeline.tables.polar.planning.trial import Trial

# random directions are sorted by rho and divided into _SHARES rings of equal number, of which the _INNERMOST and one
# of every _EVERY others are used: few directions lie on the flank of the specular lobe, where errors are a hundred
# times the mean
_SHARES, _INNERMOST, _EVERY = 192, 8, 4
_ANGLES = 64
_SPARE_W_TERMS = 8
_SEED = 19991


class Probes:
    """Test directions; their exact XYZ come from E on their own rings and azimuths, with additional terms in |w|."""

    def __init__(self, trial: Trial, scene: Scene | None, exposure_ru: float) -> None:
        """Draws the directions and computes their XYZ.

        trial: the window's stack and settings. scene: lights and views, None for all.
        exposure_ru: exposure at which colour errors are measured, RU.
        """
        bake = trial.bake
        half, counts = trial.scattering.probing_angles(_ANGLES, np.random.default_rng(_SEED))
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
        more = replace(bake, w_terms=bake.w_terms + _SPARE_W_TERMS)
        self._exact = exact(more, trial.stack, half, rho, w).reshape(-1, 3)
        self._counts = (represented * np.tile(counts, 2)).ravel()
        self._exposure_ru = exposure_ru

    def error(self, table: polar.PolarTable) -> float:
        """Computes the mean CIELAB error of a table over the test directions."""
        found = np.nan_to_num(table.look_up(self._uvw))
        error = delta_e(self._factor * found, self._factor * self._exact, self._exposure_ru)
        return float(np.average(error, weights=self._counts))
