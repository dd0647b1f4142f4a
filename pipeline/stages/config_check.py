"""Faults of a config that the models alone cannot see, found before any work starts."""

from pipeline.config.models import Config
from pipeline.errors import BakeError, ConfigError
from pipeline.optics import brdf
from pipeline.optics.light import Light, trapezoid
from pipeline.surface.recipes.patch import patch_of


def check(config: Config, source: str) -> None:
    """Raises ConfigError where a recipe does not fit its patch or a light does not cover the wavelengths."""
    if config.surface.recipe is not None:
        try:
            patch_of(config.surface.recipe)
        except ConfigError as error:
            raise ConfigError(source, error.faults) from None
    # the default is known to be covered; looking at others costs colour-science's import
    if config.light == Light() and config.material.metal == "Au":
        return
    try:
        quadrature = trapezoid(config.light, config.table.mean_step_nm)
    except BakeError as error:
        raise ConfigError(source, [("spectrum", str(error))]) from None
    try:
        brdf.spectral_factor(config.material, quadrature, config.coherence.sigma_um)
    except BakeError as error:
        raise ConfigError(source, [("material.metal", str(error))]) from None
