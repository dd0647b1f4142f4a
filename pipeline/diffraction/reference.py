"""The truth every other way is held against: |P|^2 by direct summation, and its spectral integral at 1 nm.

Two routes to the same number:

- `power_direct` adds up the samples one by one, float64, no series, no table. Slow and obviously right.
- `Reference` serves maps in bearable time. It expands exp(i k w h) in Chebyshev polynomials (Jacobi-Anger, terms to
  2e-11 of the mirror), transforms each once, and gathers the window's neighbourhood, cut at the same share, per
  direction and wavelength on the device, in float64. Directions of one v, such as a map's rows, share sums.
"""

from collections.abc import Callable, Iterator, Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from kernels import windowed_dft
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.upload import upload
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import folded_window
from pipeline.optics.light import FINE_STEP_NM, Light, Quadrature, trapezoid
from pipeline.optics.material import Material
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

STEP_NM = FINE_STEP_NM
# in amplitude; on 65 um it is 9 x 9 coefficients where 1e-12 needs 11 x 11
_TOLERANCE = 2e-11
_DIRECTIONS_AT_ONCE = 8192
_ROWS_AT_ONCE = 32


def power_direct(field: HeightField, sigma_um: float, uvw: Array, lambda_nm: float) -> Array:
    """|P|^2 (directions,) = |sum g p exp(+2 pi i f.x) / sum g|^2 at one wavelength, `uvw` (directions, 3).

    f = (u, v) / lambda, p = exp(i k w h) on a patch repeating under the window g (docs/conventions.md; [D14] eq. 1
    and 8). NaN beyond the scan's band.
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
        # a few rows at a time stay in a core's cache
        for first in range(0, ny, _ROWS_AT_ONCE):
            rows = slice(first, min(first + _ROWS_AT_ONCE, ny))
            phase = 2.0 * pi / lambda_um * w * heights[rows]
            # vecdot conjugates its first; a product of matrices would start threads that get in each other's way
            amplitude += np.sum(along_y[rows] * np.vecdot(np.cos(phase) - 1j * np.sin(phase), along_x))
        power[i] = np.abs(amplitude / total) ** 2
    power[~in_band(field, uvw, np.array([lambda_um]))[:, 0]] = np.nan
    return power


def in_band(field: HeightField, uvw: Array, lambda_um: Array) -> NDArray[np.bool_]:
    """Whether (u, v) / lambda lies within the scan's band limit along both axes, (directions, L)."""
    fx, fy = field.band_limit_per_um
    return np.asarray((np.abs(uvw[:, :1]) / lambda_um <= fx) & (np.abs(uvw[:, 1:2]) / lambda_um <= fy))


def xyz_direct(field: HeightField, sigma_um: float, light: Light, material: Material, wi: Array, wr: Array) -> Array:
    """XYZ (directions, 3) under 1 RU by `power_direct` at every nanometre; `wi`, `wr` (directions, 3)."""
    quadrature = trapezoid(light, STEP_NM)
    uvw = geometry.uvw(wi, wr)
    power = np.stack([power_direct(field, sigma_um, uvw, nm) for nm in quadrature.lambda_nm], axis=-1)
    return integrate(power, quadrature, material, sigma_um, wi, wr)


def integrate(
    power: Array, quadrature: Quadrature, material: Material, sigma_um: float, wi: Array, wr: Array
) -> Array:
    """XYZ (directions, 3) = C cos(ti) sum_l |P|^2 weights (docs/conventions.md) from |P|^2 (directions, L).

    What lies beyond the scan's band (NaN) is unknown and adds nothing. A metal's reflectance is taken at every
    wavelength and half angle.
    """
    if material.fresnel == "conductor":
        power = power * brdf.metal_reflectance(material, quadrature, geometry.cos_half(wi, wr))
        factor = brdf.geometry_factor(material, wi, wr)
    else:
        factor = brdf.direction_factor(material, quadrature, wi, wr)
    weights = quadrature.weights * brdf.window_area(material, quadrature, sigma_um)[:, None]
    sums = _sums(power, weights)
    # few directions reach beyond the band: only theirs are summed a second time, without what is unknown
    unknown = np.isnan(sums[:, 0])
    sums[unknown] = _sums(np.nan_to_num(power[unknown]), weights)
    return np.asarray(factor[:, None] * sums)


def _sums(power: Array, weights: Array) -> Array:
    """sum_l power_l weights_l (directions, channels) of `power` (directions, L) and `weights` (L, channels)."""
    # a product of matrices would start threads, which cost more than so few columns
    return np.stack([np.vecdot(power, channel) for channel in weights.T], axis=-1)


class Reference:
    """|P|^2 and XYZ of one height field for any directions, exact to 1e-9 of the mirror.

    stored_bytes: of the DFT of every term, which each answer gathers from.
    """

    def __init__(
        self, field: HeightField, sigma_um: float, lambda_min_nm: float, progress: Progress = silent
    ) -> None:
        z = expansion.largest_phase(field.half_range_um, lambda_min_nm)
        # whole vectors of terms cost the same and are shared with the device without a copy
        lanes = windowed_dft.LANES
        terms = lanes * -(-(expansion.chebyshev_order(z, _TOLERANCE) + 1) // lanes)
        reachable = expansion.W_MAX / (1e-3 * lambda_min_nm)
        built = dft_stack.build(field, "chebyshev", terms, sigma_um, reachable, _TOLERANCE, progress)
        self._sigma_um = sigma_um
        self._stack = upload(built)
        self.stored_bytes = built.coefficients.nbytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """|P|^2 (directions, L); NaN beyond the scan's band. Callers bound how many they ask for at once."""
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
        """XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
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
    """The mean of |P|^2 over several places of the window, each by a `Reference` of its own.

    One is in memory at a time: each answer makes all of them again but the first.
    """

    def __init__(
        self, fields: Sequence[HeightField], sigma_um: float, lambda_min_nm: float, progress: Progress = silent
    ) -> None:
        self.fields, self._sigma_um, self._lambda_min_nm, self._progress = fields, sigma_um, lambda_min_nm, progress
        self.first = Reference(fields[0], sigma_um, lambda_min_nm, progress)

    @property
    def nbytes(self) -> int:
        """Bytes of the height fields and of the one reference that stays in memory."""
        return self.first.stored_bytes + sum(field.nbytes for field in self.fields)

    def xyz(self, light: Light, material: Material, wi: Array, wr: Array, progress: Progress = silent) -> Array:
        """XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        return self._mean(lambda each: each.xyz(light, material, wi, wr, progress=progress))

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """|P|^2 (directions, L); NaN beyond the scan's band. Callers bound how many they ask for at once."""
        return self._mean(lambda each: each.power(uvw, lambda_nm))

    def _mean(self, answer: Callable[[Reference], Array]) -> Array:
        total = answer(self.first)
        for field in self.fields[1:]:
            total = total + answer(Reference(field, self._sigma_um, self._lambda_min_nm, self._progress))
        return total / len(self.fields)


def _tiles(count: int) -> Iterator[slice]:
    for first in range(0, count, _DIRECTIONS_AT_ONCE):
        yield slice(first, min(first + _DIRECTIONS_AT_ONCE, count))
