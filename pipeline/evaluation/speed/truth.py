"""The exact BRDF map over which the errors of tables are measured."""

import numpy as np

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.optics import geometry
from pipeline.optics.colour import ColourError, delta_e
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Map, table_evaluator
from pipeline.tables.polar.compression import Textures
from pipeline.tables.polar.table import PolarTable
from pipeline.tables.taylor.table import TaylorTable

EXPOSURE_RU = 7500.0
_NORMAL = np.array([0.0, 0.0, 1.0])


class MapTruth:
    """The exact BRDF map of a surface under one window, lit at normal incidence, computed once.

    size: of the map in pixels, 301 (pipeline.accuracy.checks.MAP_SIZE) for errors that are to be quoted.
    """

    def __init__(self, field: HeightField, config: Config, size: int, progress: Progress = silent) -> None:
        self._config, self._unit = config, config.radiometry.unit
        self._wr = Map(size, MAP_RADIUS).views()
        self._wi = np.broadcast_to(_NORMAL, self._wr.shape)
        reference = Reference(field, config.coherence.sigma_um, config.light.lambda_min_nm, progress)
        exact = reference.xyz(config.light, config.material, self._wi, self._wr, progress=progress)
        self._exact = exact / self._unit

    def error(self, table: PolarTable | TaylorTable) -> ColourError:
        """Return the CIELAB errors of a table's map at 7500 RU."""
        return self._compare(table_evaluator(table, self._config.radiometry)(self._wi, self._wr))

    def error_of_textures(self, textures: Textures) -> ColourError:
        """Return the CIELAB errors of a compressed table's map at 7500 RU."""
        uv = geometry.uvw(self._wi, self._wr)[:, :2]
        g = textures.envelope.at(np.hypot(uv[:, 0], uv[:, 1]))
        return self._compare(
            g[:, None] * table_evaluator(textures.table(), self._config.radiometry)(self._wi, self._wr)
        )

    def _compare(self, found: Array) -> ColourError:
        difference = delta_e(found / self._unit, self._exact, EXPOSURE_RU)
        tail = float(np.percentile(difference, 99.0))
        return ColourError(EXPOSURE_RU, float(difference.mean()), tail, float(difference.max()))
