"""The exact reference of a config: what its tables are measured against."""

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import MeanReference
from pipeline.progress import Progress, silent
from pipeline.surface import windows
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Evaluator


def reference_of(field: HeightField, config: Config, progress: Progress = silent) -> MeanReference:
    """The reference of a config: the mean over windows where its table is one, else the middle window's."""
    fields = windows.places(field, config.coherence) if config.table.averages_windows else [field]
    return MeanReference(fields, config.coherence.sigma_um, config.light.lambda_min_nm, progress)


def reference_evaluator(field: HeightField, config: Config, progress: Progress = silent) -> Evaluator:
    """XYZ of pairs of directions by the exact reference under a config's light and material."""
    reference = reference_of(field, config, progress)

    def evaluate(wi: Array, wr: Array) -> Array:
        return reference.xyz(config.light, config.material, wi, wr, progress=progress)

    return evaluate
