"""The certificate of a table: its errors on directions that its planning did not use, anywhere and beside mirrors.

The reference shares no approximation with the table: it gathers a float64 stack with more terms than needed, directly
at every direction and every nanometre. Every bake compares the reference itself with sums over samples, on a few
directions.
"""

from dataclasses import dataclass

from pipeline.accuracy.checks import FlankCheck, RandomCheck, RelativeError, check_table
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.errors import AccuracyError
from pipeline.optics.colour import ColourError
from pipeline.progress import Progress, silent
from pipeline.tables.evaluate import Evaluator

CERTIFIES = "the table of the heights that were baked, not that these heights are those of the surface"


@dataclass(frozen=True)
class Certificate:
    """The errors of a table on random directions, and its error budget.

    delta_e: allowed mean CIELAB error; None where no budget is set. exposure_ru: exposure of both errors, RU.
    measured: mean CIELAB error at `exposure_ru`. random: the table against the reference on random directions.
    flank: the same beside the mirror directions; None where a scene sees none of them. border: the same on the
    outermost directions of a scene; None without one. reference: the reference against sums over samples.
    certifies: what these errors are of, in words.
    """

    delta_e: float | None
    exposure_ru: float
    measured: float
    random: RandomCheck
    flank: FlankCheck | None
    border: RandomCheck | None
    reference: RelativeError
    certifies: str = CERTIFIES


def measure(interpolate: Evaluator, reference: Reference, config: Config, progress: Progress = silent) -> Certificate:
    """Measures a table against the exact reference of its height field, and the reference against plain sums.

    interpolate: computes the table's XYZ for pairs of directions, negative values included.
    reference: of the height field.
    config: its light, material, scene and [accuracy] are read.
    progress: called with a step's name and its completed share, 0 to 1.
    Returns the certificate, with the budget that [accuracy] sets.
    Raises AccuracyError where the two algorithms of the reference differ, or where setting negative values to 0
    changes colours by more than the budget.
    """
    found = errors_of(interpolate, reference, config, progress)
    refuse_clamping(found.random, config)
    return found


def errors_of(
    interpolate: Evaluator, reference: Reference, config: Config, progress: Progress = silent
) -> Certificate:
    """Measures a table as `measure` does, and refuses no error of the table."""
    random, flank, border, checked = check_table(interpolate, reference, config)
    progress("reference", 1.0)
    exposure = config.accuracy.exposure_ru
    return Certificate(
        config.accuracy.delta_e, exposure, _at(random.colour, exposure), random, flank, border, checked
    )


def refuse_clamping(random: RandomCheck, config: Config) -> None:
    """Raises AccuracyError where setting negative values to 0 changes colours by more than [accuracy] allows."""
    budget, clamped = config.accuracy.delta_e, random.clamped
    if budget is not None and clamped.cost.mean > budget:
        raise AccuracyError(
            f"the table's interpolation is negative in {100 * clamped.share:.3g} % of {random.directions} random "
            f"directions; setting these values to 0 changes colours by a mean CIELAB difference of "
            f"{clamped.cost.mean:.3g} at {clamped.cost.exposure_ru:g} RU, and accuracy.delta_e allows {budget:g}. "
            "Use a finer table, or raise accuracy.delta_e"
        )


def _at(errors: list[ColourError], exposure_ru: float) -> float:
    return next(error.mean for error in errors if error.exposure_ru == exposure_ru)
