"""The certificate of a polar table, which was planned for an error budget, and the error of its spectral form."""

from dataclasses import replace

import numpy as np

from pipeline.accuracy.certificate import Certificate, errors_of, refuse_clamping
from pipeline.accuracy.checks import MIRROR_FLOOR, RelativeError, relative_error
from pipeline.config.models import Config
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.diffraction.reference import Reference
from pipeline.errors import AccuracyError
from pipeline.optics import geometry
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress, silent
from pipeline.scene.pairs import random_pairs
from pipeline.scene.visited import rho_max
from pipeline.tables.evaluate import Evaluator
from pipeline.tables.polar import spectral

_SPECTRAL_DIRECTIONS, _SPECTRAL_STEP_NM, _SEED = 500, 50.0, 77003


def certify(interpolate: Evaluator, reference: Reference, config: Config, progress: Progress = silent) -> Certificate:
    """Measures a table as `pipeline.accuracy.certificate.measure` does, and enforces the budget of its plan.

    Returns the certificate, with the budget of the plan.
    Raises AccuracyError where the table misses it, or where the two algorithms of the reference differ.
    """
    found = replace(errors_of(interpolate, reference, config, progress), delta_e=config.budget_delta_e)
    if found.measured > config.budget_delta_e:
        raise AccuracyError(
            f"the table misses its budget: on {found.random.directions} random directions its mean CIELAB error at "
            f"{found.exposure_ru:g} RU is {found.measured:.3g}, and accuracy.delta_e allows "
            f"{config.budget_delta_e:g}. {_remedy(reference, config)}"
        )
    refuse_clamping(found.random, config)
    return found


def _remedy(reference: Reference, config: Config) -> str:
    """Suggests what to do about a missed budget; a grid cannot resolve the hard cut at the scan's Nyquist limit."""
    text = 'Raise accuracy.delta_e, or leave table.rings, azimuths, terms and w_terms on "auto".'
    band = min(reference.field.band_limit_per_um)
    if band >= rho_max(config.scene) / (1e-3 * config.light.lambda_min_nm):
        return text
    return (
        f"{text} If light is still bright at {band:.3g} per um, the scan's Nyquist limit, no table resolves the hard "
        "cut there: rescan with a finer pitch, or narrow spectrum.range_nm or scene.views."
    )


def certify_spectral(power: PolarPowerSpectrum, reference: Reference, config: Config) -> RelativeError:
    """Measures |P|^2 of single wavelengths, by the spectral form of a table, on random directions.

    power: the power spectrum E. reference: of the same height field. config: its light and scene are read.
    Returns relative errors, over max(|P|^2, 1e-7 of the mirror).
    """
    wi, wr = random_pairs(config.scene, _SPECTRAL_DIRECTIONS, _SEED)
    uvw = geometry.uvw(wi, wr)
    wavelengths = trapezoid(config.light, _SPECTRAL_STEP_NM).lambda_nm
    exact = np.nan_to_num(reference.power(uvw, wavelengths))
    return relative_error(spectral.look_up(spectral.build(power), uvw, wavelengths), exact, MIRROR_FLOOR)
