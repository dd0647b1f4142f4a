"""The interface of every method: directions in, XYZ out, and the bytes that it stores."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import integrate
from pipeline.optics import brdf, geometry
from pipeline.optics.light import Quadrature, trapezoid
from pipeline.surface.heightfield import HeightField

# the step of [D14] sec. 5 and [S14] 1.3.2
PUBLISHED_STEP_NM = 5.0


class Method(Protocol):
    """A method for the colour of one height field under one config's light and material.

    source: its publication. stored_bytes: of the data that it precomputes and keeps for its look-ups.
    """

    @property
    def source(self) -> str: ...

    @property
    def stored_bytes(self) -> int: ...

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        ...


@runtime_checkable
class Monochromatic(Method, Protocol):
    """A method that answers for single wavelengths as well."""

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L), 1 of a mirror in its own reflection; NaN beyond the Nyquist limits."""
        ...


Maker = Callable[[HeightField, Config], Method]


def integrated(
    power: Callable[[Array, Array], Array], config: Config, wi: Array, wr: Array, step_nm: float = PUBLISHED_STEP_NM
) -> Array:
    """XYZ (directions, 3) of a |P|^2 given for (uvw, lambda_nm), by the trapezoidal rule ([D14] eq. 9)."""
    quadrature = trapezoid(config.light, step_nm)
    values = power(-wi - wr, quadrature.lambda_nm)
    return integrate(values, quadrature, config.material, config.coherence.sigma_um, wi, wr)


def monochromatic_brdf(method: Monochromatic, config: Config, wi: Array, wr: Array, lambda_nm: Array) -> Array:
    """f_l (directions, L) at single wavelengths in the config's normalisation ([D14] eq. 2 or 4).

    In 1/sr for `absolute`. NaN beyond the Nyquist limits.
    """
    material, light = config.material, trapezoid(config.light, PUBLISHED_STEP_NM)
    single = Quadrature(lambda_nm, np.ones((len(lambda_nm), 3)))
    inside = config.radiometry.reflectance(lambda_nm, geometry.cos_half(wi, wr))
    inside = inside * brdf.window_area(material, single, config.coherence.sigma_um)
    if material.fresnel == "conductor":
        outside = brdf.geometry_factor(material, wi, wr)
    else:
        outside = brdf.direction_factor(material, light, wi, wr)
    return np.asarray((outside / wi[:, 2])[:, None] * inside * method.power(geometry.uvw(wi, wr), lambda_nm))
