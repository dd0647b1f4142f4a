"""The interface of every method: directions in, XYZ out, and the bytes that it stores."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import integrate
from pipeline.optics import brdf, geometry
from pipeline.optics.light import Quadrature, trapezoid

# the step of [D14] sec. 5 and [S14] 1.3.2
PUBLISHED_STEP_NM = 5.0
# directions that are held with all their wavelengths
_AT_ONCE = 4096


class Method(ABC):
    """A method for the colour of one height field under one config's light and material.

    source: its publication. stored_bytes: of the data that it precomputes and keeps for its look-ups.
    """

    source: str
    stored_bytes: int

    @abstractmethod
    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""


class Monochromatic(Method):
    """A method that answers for single wavelengths as well; its XYZ is the integral in steps of `step_nm`."""

    def __init__(self, config: Config, step_nm: float = PUBLISHED_STEP_NM) -> None:
        self._config, self._step_nm = config, step_nm

    @abstractmethod
    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L), 1 of a mirror in its own reflection; NaN beyond the Nyquist limits."""

    def xyz(self, wi: Array, wr: Array) -> Array:
        return integrated(self.power, self._config, wi, wr, self._step_nm)


def integrated(
    power: Callable[[Array, Array], Array], config: Config, wi: Array, wr: Array, step_nm: float = PUBLISHED_STEP_NM
) -> Array:
    """XYZ (directions, 3) of a |P|^2 given for (uvw, lambda_nm), by the trapezoidal rule ([D14] eq. 9)."""
    quadrature, out = trapezoid(config.light, step_nm), np.empty((len(wr), 3))
    for first in range(0, len(wr), _AT_ONCE):
        tile = np.s_[first : first + _AT_ONCE]
        values = power(-wi[tile] - wr[tile], quadrature.lambda_nm)
        sigma_um = config.coherence.sigma_um
        out[tile] = integrate(values, quadrature, config.material, sigma_um, wi[tile], wr[tile])
    return out


def spread(row: NDArray[np.integer], at_nm: Array, light: Array, nodes_nm: Array, rows: int) -> Array:
    """|P|^2 (rows, nodes) whose trapezoidal rule over even `nodes_nm` is the given light.

    row, at_nm: of each share of the light (n,), |P|^2 times nm, at a wavelength; both neighbours get their parts.
    """
    cell_nm = np.gradient(nodes_nm)
    cell_nm[[0, -1]] *= 0.5
    position = np.interp(at_nm, nodes_nm, np.arange(len(nodes_nm)))
    below = np.minimum(position.astype(np.int64), len(nodes_nm) - 2)
    total = np.zeros(rows * len(nodes_nm))
    for node, part in ((below, below + 1 - position), (below + 1, position - below)):
        total += np.bincount(row * len(nodes_nm) + node, part * light / cell_nm[node], minlength=len(total))
    return total.reshape(rows, len(nodes_nm))


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
