"""The certificate of a table: its errors on directions that its planning never saw.

The reference shares none of the table's approximations: a float64 stack with spare terms, gathered directly at every
direction and every nanometre. It is checked itself, in every bake, against sums over samples on a few directions.
"""

from dataclasses import dataclass

from pipeline.config import Config
from pipeline.errors import AccuracyError
from pipeline.evaluate import Evaluator
from pipeline.optics.colour_error import ColourError
from pipeline.progress import Progress, silent
from pipeline.reference import reference_of
from pipeline.surface.heightfield import HeightField
from pipeline.validation import RandomCheck, RelativeError, check_random, check_reference


@dataclass(frozen=True)
class Certificate:
    """What a table was promised to keep, and what it keeps.

    random: against the reference on random directions. reference: the reference against sums over samples.
    measured: the mean CIELAB error on them at `exposure_ru`, to be held against `delta_e`.
    """

    delta_e: float
    exposure_ru: float
    measured: float
    random: RandomCheck
    reference: RelativeError


def certify(evaluate: Evaluator, field: HeightField, config: Config, progress: Progress = silent) -> Certificate:
    """The certificate of a table (`evaluate`) of a height field.

    Raises AccuracyError where it misses its budget, or where the reference's two routes part.
    """
    reference = reference_of(field, config)
    checked = check_reference(reference.fields[0], reference.first, config)
    random = check_random(evaluate, reference, config, progress)
    exposure = config.accuracy.exposure_ru
    measured = _at(random.colour, exposure)
    budget = config.budget_delta_e
    if measured > budget:
        raise AccuracyError(
            f"the table misses its budget: on {random.directions} random directions its mean CIELAB error at "
            f"{exposure:g} RU is {measured:.3g}, and accuracy.delta_e allows {budget:g}. Raise it, or leave "
            'table.rings, azimuths, terms and w_terms on "auto".'
        )
    return Certificate(budget, exposure, measured, random, checked)


def _at(errors: list[ColourError], exposure_ru: float) -> float:
    return next(error.mean for error in errors if error.exposure_ru == exposure_ru)
