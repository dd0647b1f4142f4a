"""The exact reference of a config, with which its tables are compared."""

from pipeline.accuracy.shared import SharedReference
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.progress import Progress, silent
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Evaluator


def reference_of(field: HeightField, config: Config, progress: Progress = silent) -> SharedReference:
    """Makes the reference of a config: the mean over all coherence windows if its table is one, else the middle one.

    field: the height field. config: its window, light and layout are read.
    progress: called with a step's name and its completed share, 0 to 1.
    """
    places = windows.places(field.extent, config.coherence) if config.table.averages_windows else windows.MIDDLE
    return SharedReference(field, config.coherence.sigma_um, config.light.lambda_min_nm, progress, places)


def reference_evaluator(field: HeightField, config: Config, progress: Progress = silent) -> Evaluator:
    """Makes a function that computes XYZ for pairs of directions by the exact reference.

    field: the height field. config: its window, light, material and layout are read.
    Returns the function: unit vectors wi, wr (directions, 3) -> XYZ (directions, 3).
    """
    reference = reference_of(field, config, progress)

    def evaluate(wi: Array, wr: Array) -> Array:
        return reference.xyz(config.light, config.material, wi, wr, progress=progress)

    return evaluate
