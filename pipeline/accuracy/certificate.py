"""The certificate of a table: its errors on directions that its planning did not use.

The reference shares no approximation with the table: it gathers a float64 stack with more terms than needed, directly
at every direction and every nanometre. Every bake compares the reference itself with sums over samples, on a few
directions.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.accuracy.checks import (
    MIRROR_FLOOR,
    RandomCheck,
    RelativeError,
    check_random,
    check_reference,
    relative_error,
)
from pipeline.config.models import Config
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.diffraction.reference import MeanReference
from pipeline.errors import AccuracyError
from pipeline.optics import geometry
from pipeline.optics.colour import ColourError
from pipeline.optics.light import trapezoid
from pipeline.optics.random_directions import random_pairs
from pipeline.progress import Progress, silent
from pipeline.tables.evaluate import Evaluator
from pipeline.tables.planning import plan
from pipeline.tables.polar import spectral

CERTIFIES = "the table of the heights that were baked, not that these heights are those of the surface"
_SPECTRAL_DIRECTIONS, _SPECTRAL_STEP_NM, _SEED = 500, 50.0, 77003


@dataclass(frozen=True)
class Certificate:
    """The errors of a table on random directions, and its error budget.

    delta_e: allowed mean CIELAB error; None where no budget is set. exposure_ru: exposure of both errors, RU.
    measured: mean CIELAB error at `exposure_ru`. random: the table against the reference on random directions.
    reference: the reference against sums over samples. certifies: what these errors are of, in words.
    """

    delta_e: float | None
    exposure_ru: float
    measured: float
    random: RandomCheck
    reference: RelativeError
    certifies: str = CERTIFIES


def measure(
    interpolate: Evaluator, reference: MeanReference, config: Config, progress: Progress = silent
) -> Certificate:
    """Measures a table against the exact reference of its height field, and the reference against plain sums.

    interpolate: computes the table's XYZ for pairs of directions, negative values included.
    reference: of the height field.
    config: its light, material, scene and [accuracy] are read.
    progress: called with a step's name and its completed share, 0 to 1.
    Returns the certificate, with the budget that [accuracy] sets.
    Raises AccuracyError where the two algorithms of the reference differ, or where setting negative values to 0
    changes colours by more than the budget.
    """
    found = _measured(interpolate, reference, config, progress)
    refuse_clamping(found.random, config)
    return found


def _measured(interpolate: Evaluator, reference: MeanReference, config: Config, progress: Progress) -> Certificate:
    checked = check_reference(reference.fields[0], reference.first, config)
    random = check_random(interpolate, reference, config, progress)
    exposure = config.accuracy.exposure_ru
    return Certificate(config.accuracy.delta_e, exposure, _at(random.colour, exposure), random, checked)


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


def certify(
    interpolate: Evaluator, reference: MeanReference, config: Config, progress: Progress = silent
) -> Certificate:
    """Measures a table that was planned for an error budget, as `measure` does, and enforces the budget.

    Returns the certificate, with the budget of the plan.
    Raises AccuracyError where the table misses it, or where the two algorithms of the reference differ.
    """
    found = replace(_measured(interpolate, reference, config, progress), delta_e=config.budget_delta_e)
    if found.measured > config.budget_delta_e:
        raise AccuracyError(
            f"the table misses its budget: on {found.random.directions} random directions its mean CIELAB error at "
            f"{found.exposure_ru:g} RU is {found.measured:.3g}, and accuracy.delta_e allows "
            f"{config.budget_delta_e:g}. {_remedy(reference, config)}"
        )
    refuse_clamping(found.random, config)
    return found


def _remedy(reference: MeanReference, config: Config) -> str:
    """Suggests what to do about a missed budget; a grid cannot resolve the hard cut at the scan's Nyquist limit."""
    text = 'Raise accuracy.delta_e, or leave table.rings, azimuths, terms and w_terms on "auto".'
    band = min(reference.fields[0].band_limit_per_um)
    if band >= plan.rho_max(config.scene) / (1e-3 * config.light.lambda_min_nm):
        return text
    return (
        f"{text} If light is still bright at {band:.3g} per um, the scan's Nyquist limit, no table resolves the hard "
        "cut there: rescan with a finer pitch, or narrow spectrum.range_nm or scene.views."
    )


def certify_spectral(power: PolarPowerSpectrum, reference: MeanReference, config: Config) -> RelativeError:
    """Measures |P|^2 of single wavelengths, by the spectral form of a table, on random directions.

    power: the power spectrum E. reference: of the same height field. config: its light and scene are read.
    Returns relative errors, over max(|P|^2, 1e-7 of the mirror).
    """
    wi, wr = random_pairs(config.scene, _SPECTRAL_DIRECTIONS, _SEED)
    uvw = geometry.uvw(wi, wr)
    wavelengths = trapezoid(config.light, _SPECTRAL_STEP_NM).lambda_nm
    exact = np.nan_to_num(reference.power(uvw, wavelengths))
    return relative_error(spectral.look_up(spectral.build(power), uvw, wavelengths), exact, MIRROR_FLOOR)


def _at(errors: list[ColourError], exposure_ru: float) -> float:
    return next(error.mean for error in errors if error.exposure_ru == exposure_ru)
