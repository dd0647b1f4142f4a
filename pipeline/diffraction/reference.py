"""The ground truth: |P|^2 by two algorithms ([D14] eq. 1 and 8), and its spectral integral in steps of 1 nm.

- `power_direct` sums over all samples in float64, without a series or a table. It is slow and easy to verify.
- `Reference` is fast enough for maps. It expands exp(i k w h) in Chebyshev polynomials (Jacobi-Anger expansion),
  transforms each term once, and sums the coefficients under the window's transform for each direction and wavelength,
  on the device in float64. The series and the window are cut at 2e-11 of the mirror. Directions with the same v, such
  as the rows of a map, share sums.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from kernels import windowed_dft
from pipeline import resources
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.upload import upload
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import folded_window
from pipeline.optics.light import FINE_STEP_NM, Light, Quadrature, trapezoid
from pipeline.optics.material import Material
from pipeline.progress import Progress, silent
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField

STEP_NM = FINE_STEP_NM
# relative amplitude at which the series and the window are cut; on 65 um the window takes 9 x 9 coefficients, where
# 1e-12 would take 11 x 11
_TOLERANCE = 2e-11
_DIRECTIONS_AT_ONCE = 8192
_ROWS_AT_ONCE = 32


def power_direct(field: HeightField, sigma_um: float, uvw: Array, lambda_nm: float) -> Array:
    """Computes |P|^2 = |sum g p exp(+2 pi i f.x) / sum g|^2 by summing over all samples ([D14] eq. 1 and 8).

    f = (u, v) / lambda and p = exp(i k w h); the patch repeats periodically under the window g (docs/conventions.md).

    field: heights. sigma_um: standard deviation of the coherence window, um. uvw: (directions, 3).
    lambda_nm: one wavelength, nm.
    Returns |P|^2 (directions,), NaN beyond the scan's Nyquist limits.
    """
    lambda_um = 1e-3 * lambda_nm
    heights = field.centred().heights_um
    ny, nx = field.shape
    px, py = field.pitch_um
    total = np.sum(folded_window(nx, px, sigma_um, 0.0)) * np.sum(folded_window(ny, py, sigma_um, 0.0))
    power = np.empty(len(uvw))
    for i, (u, v, w) in enumerate(uvw):
        along_x = folded_window(nx, px, sigma_um, u / lambda_um)
        along_y = folded_window(ny, py, sigma_um, v / lambda_um)
        amplitude = 0.0j
        # blocks of a few rows remain in the cache of a core
        for first in range(0, ny, _ROWS_AT_ONCE):
            rows = slice(first, min(first + _ROWS_AT_ONCE, ny))
            phase = 2.0 * pi / lambda_um * w * heights[rows]
            # vecdot conjugates its first argument; a matrix product would start competing threads
            amplitude += np.sum(along_y[rows] * np.vecdot(np.cos(phase) - 1j * np.sin(phase), along_x))
        power[i] = np.abs(amplitude / total) ** 2
    power[~in_band(field, uvw, np.array([lambda_um]))[:, 0]] = np.nan
    return power


def in_band(field: HeightField, uvw: Array, lambda_um: Array) -> NDArray[np.bool_]:
    """Whether (u, v) / lambda lies within the scan's Nyquist limits along both axes.

    uvw: (directions, 3). lambda_um: (L,), um. Returns bool (directions, L).
    """
    fx, fy = field.band_limit_per_um
    return np.asarray((np.abs(uvw[:, :1]) / lambda_um <= fx) & (np.abs(uvw[:, 1:2]) / lambda_um <= fy))


def xyz_direct(field: HeightField, sigma_um: float, light: Light, material: Material, wi: Array, wr: Array) -> Array:
    """Computes XYZ by `power_direct`, in steps of 1 nm.

    wi, wr: unit vectors (directions, 3). The other parameters are those of `power_direct` and `integrate`.
    Returns (directions, 3).
    """
    quadrature = trapezoid(light, STEP_NM)
    uvw = geometry.uvw(wi, wr)
    power = np.stack([power_direct(field, sigma_um, uvw, nm) for nm in quadrature.lambda_nm], axis=-1)
    return integrate(power, quadrature, material, sigma_um, wi, wr)


def integrate(
    power: Array, quadrature: Quadrature, material: Material, sigma_um: float, wi: Array, wr: Array
) -> Array:
    """Computes XYZ = C cos(ti) sum_l |P|^2 weights (docs/conventions.md).

    NaN, beyond the scan's Nyquist limits, counts as 0. A metal's reflectance is taken at every wavelength and half
    angle.

    power: |P|^2 (directions, L). quadrature: wavelengths (L,), nm, and weights (L, 3) of light and observer.
    sigma_um: standard deviation of the coherence window, um. wi, wr: unit vectors (directions, 3).
    Returns (directions, 3).
    """
    if material.fresnel == "conductor":
        power = power * brdf.metal_reflectance(material, quadrature, geometry.cos_half(wi, wr))
        factor = brdf.geometry_factor(material, wi, wr)
    else:
        factor = brdf.direction_factor(material, quadrature, wi, wr)
    weights = quadrature.weights * brdf.window_area(material, quadrature, sigma_um)[:, None]
    sums = _sums(power, weights)
    # few directions exceed the Nyquist limits; only their sums are repeated, with 0 for NaN
    unknown = np.isnan(sums[:, 0])
    sums[unknown] = _sums(np.nan_to_num(power[unknown]), weights)
    return np.asarray(factor[:, None] * sums)


def _sums(power: Array, weights: Array) -> Array:
    """Computes sum_l power_l weights_l (directions, channels); power: (directions, L), weights: (L, channels)."""
    # a matrix product would start threads, which cost more than the sum over three columns
    return np.stack([np.vecdot(power, channel) for channel in weights.T], axis=-1)


class Reference:
    """|P|^2 and XYZ of one height field for any directions, exact to 1e-9 of the mirror.

    stored_bytes: size of the DFT stack.
    """

    def __init__(
        self, field: HeightField, sigma_um: float, lambda_min_nm: float, progress: Progress = silent
    ) -> None:
        """Transforms the Chebyshev terms of the height field.

        sigma_um: standard deviation of the coherence window, um. lambda_min_nm: shortest wavelength, nm.
        Raises AccuracyError if the samples do not resolve the window, ResourceError if the stack does not fit into
        memory, and DeviceError if no device works.
        """
        terms = _terms(field.half_range_um, lambda_min_nm)
        reachable = expansion.W_MAX / (1e-3 * lambda_min_nm)
        built = dft_stack.build(field, "chebyshev", terms, sigma_um, reachable, _TOLERANCE, progress)
        self._sigma_um = sigma_um
        self._stack = upload(built)
        self.stored_bytes = built.coefficients.nbytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Computes |P|^2 (directions, L), NaN beyond the scan's Nyquist limits.

        uvw: (directions, 3), as many as fit into memory with L. lambda_nm: (L,), nm.
        """
        return np.asarray(windowed_dft.exact_power(self._stack, uvw, 1e-3 * lambda_nm))

    def xyz(
        self,
        light: Light,
        material: Material,
        wi: Array,
        wr: Array,
        step_nm: float = STEP_NM,
        progress: Progress = silent,
    ) -> Array:
        """Computes XYZ (directions, 3) for unit vectors wi, wr (directions, 3).

        step_nm: step of the spectral integral, nm.
        """
        quadrature = trapezoid(light, step_nm)
        uvw = geometry.uvw(wi, wr)
        order, out = windowed_dft.line_order(uvw), np.empty((len(wr), 3))
        for tile in _tiles(len(wr)):
            these = order[tile]
            power = self.power(uvw[these], quadrature.lambda_nm)
            out[these] = integrate(power, quadrature, material, self._sigma_um, wi[these], wr[these])
            progress("reference", tile.stop / len(wr))
        return out


class MeanReference:
    """The mean of |P|^2 over several positions of the coherence window, each computed by its own `Reference`.

    Only the first stays in memory; the others are built again for every call.
    """

    def __init__(
        self, fields: Sequence[HeightField], sigma_um: float, lambda_min_nm: float, progress: Progress = silent
    ) -> None:
        """Builds the reference of the first window.

        fields: one height field per position of the window (pipeline.surface.windows).
        sigma_um: standard deviation of the window, um. lambda_min_nm: shortest wavelength, nm.
        Raises AccuracyError and DeviceError as `Reference` does.
        """
        self.fields, self._sigma_um, self._lambda_min_nm, self._progress = fields, sigma_um, lambda_min_nm, progress
        self.first = Reference(fields[0], sigma_um, lambda_min_nm, progress)

    @property
    def nbytes(self) -> int:
        """Size in bytes of the height fields and of the reference in memory."""
        return self.first.stored_bytes + sum(field.nbytes for field in self.fields)

    def xyz(self, light: Light, material: Material, wi: Array, wr: Array, progress: Progress = silent) -> Array:
        """Computes XYZ (directions, 3) for unit vectors wi, wr (directions, 3)."""
        return self._mean(lambda each: each.xyz(light, material, wi, wr, progress=progress))

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Computes |P|^2 (directions, L), NaN beyond the scan's Nyquist limits.

        uvw: (directions, 3), as many as fit into memory with L. lambda_nm: (L,), nm.
        """
        return self._mean(lambda each: each.power(uvw, lambda_nm))

    def _mean(self, answer: Callable[[Reference], Array]) -> Array:
        total = answer(self.first)
        for field in self.fields[1:]:
            total = total + answer(Reference(field, self._sigma_um, self._lambda_min_nm, self._progress))
        return total / len(self.fields)


def _terms(half_range_um: float, lambda_min_nm: float) -> int:
    """Computes the number of terms: whole vectors cost the same, and the device uses them without a copy."""
    z = expansion.largest_phase(half_range_um, lambda_min_nm)
    return windowed_dft.LANES * -(-(expansion.chebyshev_order(z, _TOLERANCE) + 1) // windowed_dft.LANES)


@dataclass(frozen=True)
class ReferenceSize:
    """The size of a `MeanReference`, known before it is made.

    terms: of its series. stack: size of its stacks. windows: positions of the coherence window. extent: of the
    height field.
    """

    terms: int
    stack: dft_stack.StackSize
    windows: int
    extent: Extent

    @property
    def nbytes(self) -> int:
        """Bytes of its stack and of the height field of every window."""
        return self.stack.stack_bytes(self.terms, 8) + self.windows * self.extent.bytes

    def making(self) -> resources.Arrays:
        """Lists the arrays while the first stack is made."""
        return {
            "height fields of the reference": self.windows * self.extent.bytes,
            **self.stack.chebyshev_bytes(self.terms, 8),
        }

    def answering(self, directions: int, wavelengths: int, material: Material) -> resources.Arrays:
        """Lists the arrays while it answers for directions: stacks, |P|^2 of a tile, a metal's reflectance there.

        The stacks of other windows are made while the answer of the first is kept.
        """
        tile = min(directions, _DIRECTIONS_AT_ONCE)
        units = os.cpu_count() or 1
        power = windowed_dft.exact_power_bytes(tile, wavelengths, self.stack.reach[0], self.terms, units)
        # four complex arrays of Fresnel's equations, R and its product with |P|^2
        metal = (4 * 16 + 2 * 8) * tile * wavelengths if material.fresnel == "conductor" else 0
        others = self.stack.chebyshev_bytes(self.terms, 8) if self.windows > 1 else {}
        return {
            "reference": self.nbytes,
            "|P|^2 of directions": power,
            "reflectances of directions": metal,
            "reference of another window": sum(others.values()),
        }

    def seconds(self, directions: float, wavelengths: int) -> float:
        """Estimates the time of an answer: the coefficients under the window, of all terms, in double precision."""
        taps = (2 * self.stack.reach[0] + 1) * (2 * self.stack.reach[1] + 1)
        return resources.seconds(2.0 * self.windows * directions * wavelengths * taps * 2 * self.terms)


def size(extent: Extent, sigma_um: float, lambda_min_nm: float, windows: int) -> ReferenceSize:
    """Computes the size of a `MeanReference` of a height field before it is made.

    extent: of the height field. sigma_um: standard deviation of the coherence window, um. lambda_min_nm: shortest
    wavelength, nm. windows: number of positions of the window.
    """
    reachable = expansion.W_MAX / (1e-3 * lambda_min_nm)
    chosen = dft_stack.size(extent, sigma_um, reachable, _TOLERANCE)
    return ReferenceSize(_terms(extent.half_range_um, lambda_min_nm), chosen, windows, extent)


def _tiles(count: int) -> Iterator[slice]:
    for first in range(0, count, _DIRECTIONS_AT_ONCE):
        yield slice(first, min(first + _DIRECTIONS_AT_ONCE, count))
