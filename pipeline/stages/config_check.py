"""Checks of a config that its models cannot make alone, run before any work starts."""

from pipeline.config.models import Config
from pipeline.errors import BakeError, ConfigError
from pipeline.optics import brdf
from pipeline.optics.light import Light, trapezoid
from pipeline.stages import forecast


def check(config: Config, source: str) -> None:
    """Checks that a recipe fits its patch, that its bake ends, and that light and metal cover the wavelengths.

    config: a valid config. source: its name for messages, such as the file.
    Raises ConfigError, with the key of each fault.
    """
    if config.surface.recipe is not None:
        try:
            forecast.require_an_end(config, source)
        except ConfigError as error:
            raise ConfigError(source, error.faults) from None
    # the default is covered; a check of another light may import colour-science, which takes a second
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
