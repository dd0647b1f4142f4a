"""The error of a table against each of its settings, measured on a coarse map under one light."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.optics.colour import delta_e
from pipeline.tables.evaluate import Evaluator, Map

_MAP_SIZE = 61


@dataclass(frozen=True)
class Curve:
    """Mean CIELAB error at one exposure against one setting, with all other settings as configured.

    setting, unit: of the setting. values: of the setting, ascending. errors: at each value.
    chosen: the configured or planned value.
    """

    setting: str
    unit: str
    values: list[float]
    errors: list[float]
    chosen: float


Study = Sequence[Callable[[], Curve]]


class CoarseMap:
    """A coarse map under one light, with the reference's XYZ."""

    def __init__(self, reference: Reference, config: Config, light: Array, radius: float) -> None:
        """Computes the reference on the map.

        reference: of the height field. config: its light, material and exposure are read.
        light: unit vector (3,) towards it. radius: sin(theta) of the outermost views; at most 0.98 is used.
        """
        self.config, self._unit = config, config.radiometry.unit
        self.wr = Map(_MAP_SIZE, min(MAP_RADIUS, radius)).views()
        self.wi = np.broadcast_to(light, self.wr.shape)
        self._truth = reference.xyz(config.light, config.material, self.wi, self.wr)

    def error(self, evaluate: Evaluator) -> float:
        """Computes the mean CIELAB error of an evaluator, which gives XYZ for pairs of directions."""
        xyz, exposure = evaluate(self.wi, self.wr), self.config.accuracy.exposure_ru
        return float(np.mean(delta_e(xyz / self._unit, self._truth / self._unit, exposure)))
