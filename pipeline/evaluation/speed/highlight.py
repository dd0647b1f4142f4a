"""Errors that no mean shows: of a planned table beside mirror directions, and of few textures in them."""

from dataclasses import dataclass

import numpy as np

from pipeline.accuracy.checks import FlankCheck, check_flank
from pipeline.accuracy.exact import reference_of
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.speed import setting
from pipeline.evaluation.speed.truth import MapTruth
from pipeline.optics import geometry
from pipeline.optics.coherence import FLANK_RU
from pipeline.optics.colour import ColourError
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Table, table_evaluator
from pipeline.tables.polar.layout import PolarLayout

_LIGHTS_DEG = (0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 75.0, 80.0, 85.0)
_AZIMUTH_RAD = 0.7


@dataclass(frozen=True)
class PlannedTable:
    """The table that the planner makes, and its largest errors.

    texels: of its grid. flank: its errors on the flank of the specular lobe; None where there is none. map_error: of
    the map, at the flank's exposure.
    """

    texels: int
    flank: FlankCheck | None
    map_error: ColourError


def planned(field: HeightField, config: Config, truth: MapTruth, reference: Reference) -> PlannedTable:
    """Plan and make the table of a surface, and measure its largest errors."""
    power, chosen = setting.first_bake(field, config, PolarLayout())
    table = chosen.table(power)
    flank = check_flank(table_evaluator(table, config.radiometry), reference, config)
    return PlannedTable(chosen.plan.texels, flank, truth.error(table, FLANK_RU))


class MirrorTruth:
    """The exact XYZ in the mirror directions of lights at 0 to 85 degrees."""

    def __init__(self, field: HeightField, config: Config, progress: Progress = silent) -> None:
        """Make the reference of the surface, which `reference` keeps."""
        self.reference, self._config = reference_of(field, config, progress), config
        self._exact = self.reference.xyz(config.light, config.material, *self._directions)

    @property
    def _directions(self) -> tuple[Array, Array]:
        light = geometry.direction(np.radians(_LIGHTS_DEG), np.full(len(_LIGHTS_DEG), _AZIMUTH_RAD))
        return light, light * [-1.0, -1.0, 1.0]

    def largest_error(self, table: Table) -> float:
        """Return the largest relative error of X, Y or Z."""
        found = table_evaluator(table, self._config.radiometry)(*self._directions)
        return float(np.max(np.abs(found / self._exact - 1.0)))
