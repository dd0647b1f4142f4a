"""Rigorous order efficiencies of a grating, by the coupled-wave solver of `meent` (MIT), an extra.

Its planar equations are the enhanced transmittance matrices of Moharam et al. (JOSA A 12, 1077, 1995) under Li's
rules of factorisation, without which TM of metals hardly converges. A grating is a staircase here: columns of equal
width, each as high as the profile at its middle. A layer lies between two neighbouring heights; its modes do not know
how thick it is, so all depths of a profile share them.

Two conventions of meent 0.13: absorption is n - ik, and a substrate that absorbs is given the growing wave. So the
material is a film here, thick enough for a metal to be opaque, on a substrate of its index' real part. Without
absorption there is no interface between them.

Lengths are in wavelengths. Orders count as in [D14] eq. 13: u = m lambda / period.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from math import ceil, pi, sin
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array

# heights in [0, 1] at positions in periods
Profile = Callable[[Array], Array]
# E along the grooves, or H
Polarisation = Literal["TE", "TM"]
POLARISATIONS: tuple[Polarisation, Polarisation] = ("TE", "TM")

# of wavelengths: exp(-4 pi k) of the light comes back from the film's far side
_FILM = 1.0
# keeps pairs of orders apart that normal light makes degenerate; meent's own
_PERTURBATION = 1e-20
# Fourier orders of the coarser resolution: at least, and beyond those that propagate
_ORDERS, _EVANESCENT = 12, 4
# where corners of a metal slow the normal field of TM down: at least, and by period
_ORDERS_SLOW, _BY_PERIOD_SLOW = 28, 2.0


def available() -> bool:
    """Return whether the solver, an extra, is installed."""
    return find_spec("meent") is not None


@dataclass(frozen=True)
class RigorousGrating:
    """A profile under light that travels towards +x at `theta`, radians.

    index: n + ik. k is a metal's, above 0.5, or next to nothing: 0 itself makes modes degenerate, 1e-6 does not.
    """

    profile: Profile
    period: float
    theta: float
    index: complex

    @property
    def metal(self) -> bool:
        return self.index.imag > 0.5


@dataclass(frozen=True)
class Resolution:
    """How finely a grating is solved: Fourier orders on either side of the zeroth, columns of the staircase."""

    orders: int
    columns: int

    @property
    def doubled(self) -> "Resolution":
        return Resolution(2 * self.orders, 2 * self.columns)


@dataclass(frozen=True)
class Staircase:
    """A profile in columns, from above: solid (layers, columns), thickness (layers,) of a height of 1."""

    solid: NDArray[np.bool_]
    thickness: Array


def staircase(profile: Profile, columns: int) -> Staircase:
    """Sample the profile at the middles of columns of equal width, in layers between neighbouring heights."""
    # equal heights may differ in their last digits
    heights = np.round(profile((np.arange(columns) + 0.5) / columns), 12)
    levels = np.unique(heights)[::-1]
    return Staircase(heights >= levels[:-1, None], -np.diff(levels))


def solve(grating: RigorousGrating, depths: Array, polarisation: Polarisation, resolution: Resolution) -> Array:
    """Return the reflected efficiencies (depths, orders -M..M) at one resolution; 0 of evanescent orders."""
    from meent.on_numpy.emsolver import transfer_method as transfer

    stairs, substrate = staircase(grating.profile, resolution.columns), grating.index.real
    tm, orders = int(polarisation == "TM"), np.arange(-resolution.orders, resolution.orders + 1)
    kx = sin(grating.theta) + _PERTURBATION + orders / grating.period + 0j
    convolutions = _convolutions(stairs, np.conj(grating.index), resolution.orders)
    modes = [transfer.transfer_1d_2(tm, kx, *layer) for layer in convolutions]
    found = []
    for depth in depths:
        kz_above, kz_below, *field = transfer.transfer_1d_1(tm, kx, 1.0, substrate)
        for mode, thickness in zip(reversed(modes), [_FILM, *reversed(depth * stairs.thickness)], strict=True):
            field = transfer.transfer_1d_3(2.0 * pi, *mode, thickness, *field)[1:4]
        result = transfer.transfer_1d_4(tm, len(kx), *field, kz_above, kz_below, grating.theta, 1.0, substrate)[0]
        # kx rises with meent's orders; u = -wi - wr falls with it
        found.append(result["res"]["de_ri"][0, ::-1])
    return np.array(found)


def _convolutions(stairs: Staircase, index: complex, orders: int) -> Any:
    """By layer, the film last: Toeplitz matrices of 1 / (1 / eps), of eps, and the inverse of the latter."""
    from meent.on_numpy.emsolver.convolution_matrix import to_conv_mat_raster_continuous

    film = np.ones((1, stairs.solid.shape[1]), bool)
    cells = np.where(np.concatenate([stairs.solid, film]), index, 1.0)
    return zip(*to_conv_mat_raster_continuous(cells[:, None, :], orders, 0), strict=True)


def resolution_of(grating: RigorousGrating, polarisation: Polarisation, columns: int) -> Resolution:
    """Return the coarser of the two resolutions that are extrapolated: all orders that propagate, and more."""
    if _slow(grating, polarisation):
        return Resolution(max(_ORDERS_SLOW, ceil(_BY_PERIOD_SLOW * grating.period)), columns)
    propagating = ceil(grating.period * (1.0 + abs(sin(grating.theta))))
    return Resolution(max(_ORDERS, propagating + _EVANESCENT), columns)


def _slow(grating: RigorousGrating, polarisation: Polarisation) -> bool:
    return grating.metal and polarisation == "TM"


def limit(grating: RigorousGrating, depths: Array, polarisation: Polarisation, resolution: Resolution) -> Array:
    """Extrapolate efficiencies (depths, orders -M..M) to the smooth profile, from a resolution and its double.

    The staircase's error falls as 1 / columns^2, in TM of a metal as 1 / columns while orders grow with them
    (measured against a boundary integral's values: tests).
    """
    coarse, fine = (solve(grating, depths, polarisation, each) for each in (resolution, resolution.doubled))
    fine = fine[:, resolution.orders : -resolution.orders]
    ratio = 2.0 if _slow(grating, polarisation) else 4.0
    return np.asarray(fine + (fine - coarse) / (ratio - 1.0))


def both_polarisations(grating: RigorousGrating, depths: Array, columns: int, order: int) -> Array:
    """Return efficiencies (2, depths) of TE and TM in one order, extrapolated."""
    found = []
    for polarisation in POLARISATIONS:
        resolution = resolution_of(grating, polarisation, columns)
        found.append(limit(grating, depths, polarisation, resolution)[:, resolution.orders + order])
    return np.array(found)
