"""The exact BRDF map over which the errors of tables are measured."""

import numpy as np

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.optics.colour import ColourError, colour_error
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Map, Table, table_evaluator

EXPOSURE_RU = 7500.0
_NORMAL = np.array([0.0, 0.0, 1.0])


class MapTruth:
    """The exact BRDF map of a surface under one window, lit at normal incidence, computed once.

    size: of the map in pixels, 301 (pipeline.accuracy.checks.MAP_SIZE) for errors that are to be quoted.
    """

    def __init__(self, field: HeightField, config: Config, size: int, progress: Progress = silent) -> None:
        self._radiometry = config.radiometry
        self._wr = Map(size, MAP_RADIUS).views()
        self._wi = np.broadcast_to(_NORMAL, self._wr.shape)
        reference = Reference(field, config.coherence.sigma_um, config.light.lambda_min_nm, progress)
        self._exact = reference.xyz(config.light, config.material, self._wi, self._wr, progress=progress)

    def error(self, table: Table, exposure_ru: float = EXPOSURE_RU) -> ColourError:
        """Return the CIELAB errors of a table's map at an exposure, RU."""
        found, unit = table_evaluator(table, self._radiometry)(self._wi, self._wr), self._radiometry.unit
        return colour_error(found / unit, self._exact / unit, exposure_ru)
