"""The look-up shader of [D14] sec. 5: tables I_p(u, v) of the spectrally integrated Taylor series, bilinear."""

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.methods.paper_reference import TOLERANCE, taylor_stack
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.taylor import table as taylor

# [D14] sec. 5: "up to 501 x 501" nodes 2 |t|^5 sign(t)
PUBLISHED_RESOLUTION, PUBLISHED_POWER = 501, 5.0


class PaperLookUp:
    """sum_p w^p I_p(u, v) ([D14] eq. 10) from float32 tables. They know no single wavelength."""

    source = "[D14] sec. 5, look-up shader"

    def __init__(
        self,
        field: HeightField,
        config: Config,
        resolution: int = PUBLISHED_RESOLUTION,
        power: float = PUBLISHED_POWER,
        tolerance: float = TOLERANCE,
    ) -> None:
        """Raises AccuracyError where float32 tables would lose their digits, or not fit."""
        rule = config.radiometry.integrand(PUBLISHED_STEP_NM)
        self._table = taylor.build(taylor_stack(field, config, tolerance), rule, resolution, power)
        self._look_up = table_evaluator(self._table, config.radiometry)

    @property
    def stored_bytes(self) -> int:
        """Of all tables I_p, p = 0 .. 2 N, in X, Y and Z."""
        return self._table.values.nbytes

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        return self._look_up(wi, wr)
