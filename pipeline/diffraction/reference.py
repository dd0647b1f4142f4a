"""The ground truth: |P|^2 by two algorithms ([D14] eq. 1 and 8), and its spectral integral in steps of 1 nm.

- `power_direct` sums over all samples in float64, without a series or a table. It is slow and easy to verify.
- `Reference` is fast enough for maps. It expands exp(i k w h) in Chebyshev polynomials (Jacobi-Anger expansion),
  transforms each term once, and sums the coefficients under the window's transform for each direction and wavelength,
  on the device in float64. The series and the window are cut at 2e-11 of the mirror. Directions with the same v, such
  as the rows of a map, share sums.
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from kernels import windowed_dft
from pipeline import resources
from pipeline.arrays import Array
from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.device import keeping_memory
from pipeline.diffraction.upload import upload
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import folded_window
from pipeline.optics.light import FINE_STEP_NM, Light, Quadrature, trapezoid
from pipeline.optics.material import Material
from pipeline.progress import Progress, silent
from pipeline.surface import windows
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import MIDDLE, Places

STEP_NM = FINE_STEP_NM
# relative amplitude at which the series and the window are cut; on 65 um the window takes 9 x 9 coefficients, where
# 1e-12 would take 11 x 11
_TOLERANCE = 2e-11
_DIRECTIONS_AT_ONCE = 8192
# a larger stack is made in parts of its terms, while P of some directions takes no more than _AMPLITUDE_BYTES
_HELD_BYTES, _AMPLITUDE_BYTES = 2**29, 2**28
_ROWS_AT_ONCE = 32
_METAL_AT_ONCE = 1024


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
            # a matrix product would start competing threads, and sums of complex numbers take twice as long
            (cos_x, cos_y), (sin_x, sin_y) = (
                (np.vecdot(wave, along_x.real), np.vecdot(wave, along_x.imag))
                for wave in (np.cos(phase), np.sin(phase))
            )
            amplitude += np.sum(along_y[rows] * (cos_x - sin_y + 1j * (cos_y + sin_x)))
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
    weights = quadrature.weights * brdf.window_area(material, quadrature, sigma_um)[:, None]
    if material.fresnel != "conductor":
        return brdf.direction_factor(material, quadrature, wi, wr)[:, None] * _known_sums(power, weights)
    cos_half, sums = geometry.cos_half(wi, wr), np.empty((len(power), 3))
    # Fresnel's equations for all directions at once leave the cache: five times slower
    for first in range(0, len(power), _METAL_AT_ONCE):
        part = np.s_[first : first + _METAL_AT_ONCE]
        reflected = power[part] * brdf.metal_reflectance(material, quadrature, cos_half[part])
        sums[part] = _known_sums(reflected, weights)
    return brdf.geometry_factor(material, wi, wr)[:, None] * sums


def _known_sums(power: Array, weights: Array) -> Array:
    """Computes `_sums` with 0 for the NaN of frequencies beyond the Nyquist limits."""
    sums = _sums(power, weights)
    # few directions exceed the limits; only their sums are repeated
    unknown = np.isnan(sums[:, 0])
    sums[unknown] = _sums(np.nan_to_num(power[unknown]), weights)
    return sums


def _sums(power: Array, weights: Array) -> Array:
    """Computes sum_l power_l weights_l (directions, channels); power: (directions, L), weights: (L, channels)."""
    # a matrix product would start threads, which cost more than the sum over three columns
    return np.stack([np.vecdot(power, channel) for channel in weights.T], axis=-1)


@dataclass(frozen=True)
class Query:
    """Directions and wavelengths at which |P|^2 is asked for, and the windows over which it is a mean.

    uvw: (directions, 3). lambda_nm: (L,), nm. places: positions of the window.
    """

    uvw: Array
    lambda_nm: Array
    places: Places


class Reference:
    """The mean of |P|^2 over windows of one height field, and XYZ, for any directions, exact to 1e-9 of the mirror.

    One stack of the whole patch serves all windows where that is less work than a stack of each. A stack of at most
    512 MiB stays in memory; a larger one is made for every answer, in parts of its terms.
    """

    def __init__(
        self,
        field: HeightField,
        sigma_um: float,
        lambda_min_nm: float,
        progress: Progress = silent,
        places: Places = MIDDLE,
    ) -> None:
        """Transforms the Chebyshev terms of the height field, if the stack stays in memory.

        field: the whole scan. sigma_um: standard deviation of the coherence window, um.
        lambda_min_nm: shortest wavelength, nm. places: positions of the window.
        Raises AccuracyError if the samples do not resolve the window, ResourceError if the stack does not fit into
        memory, and DeviceError if no device works.
        """
        self.field, self.places, self._sigma_um, self._lambda_min_nm = field, places, sigma_um, lambda_min_nm
        self._size, self._progress = size(field.extent, sigma_um, lambda_min_nm, places), progress
        self._held: tuple[dft_stack.Stack, windowed_dft.DeviceStack] | None = None
        if self._size.is_held:
            built = self._build(field, 0, self._size.terms)
            self._held = built, upload(built)

    @property
    def nbytes(self) -> int:
        """Size in bytes of the height field and of the stack in memory."""
        return self.field.nbytes + self.stack_bytes

    @property
    def stack_bytes(self) -> int:
        """Size in bytes of the stack in memory."""
        return 0 if self._held is None else self._held[0].coefficients.nbytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Computes the mean of |P|^2 over the windows, (directions, L), NaN beyond the scan's Nyquist limits.

        uvw: (directions, 3), as many as fit into memory with L. lambda_nm: (L,), nm.
        """
        return self._answers([Query(uvw, lambda_nm, self.places)])[0]

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
        return self.xyz_of([(light, material)], wi, wr, step_nm, progress)[0]

    def xyz_of(
        self,
        seen: Sequence[tuple[Light, Material]],
        wi: Array,
        wr: Array,
        step_nm: float = STEP_NM,
        progress: Progress = silent,
    ) -> list[Array]:
        """Computes XYZ (directions, 3) for each of several lights and materials: |P|^2 depends on neither.

        seen: lights of the same wavelengths, with a material each. The other parameters are those of `xyz`.
        """
        quadratures = [trapezoid(light, step_nm) for light, _ in seen]
        uvw, lambda_nm = geometry.uvw(wi, wr), quadratures[0].lambda_nm
        order, out = windowed_dft.line_order(uvw), [np.empty((len(wr), 3)) for _ in seen]
        for tile in self._size.tiles(len(wr), len(lambda_nm)):
            these = order[tile]
            power = self.power(uvw[these], lambda_nm)
            for xyz, quadrature, (_, material) in zip(out, quadratures, seen, strict=True):
                xyz[these] = integrate(power, quadrature, material, self._sigma_um, wi[these], wr[these])
            progress("reference", tile.stop / len(wr))
        return out

    def xyz_and_middle(
        self, seen: Sequence[tuple[Light, Material]], wi: Array, wr: Array, uvw: Array, lambda_nm: Array
    ) -> tuple[list[Array], Array]:
        """Computes XYZ of directions, and |P|^2 of the window in the middle at a few others, from one stack.

        seen, wi, wr: as in `xyz_of`, as many directions as fit into memory. uvw, lambda_nm: as in `power`.
        """
        quadratures = [trapezoid(light, STEP_NM) for light, _ in seen]
        many = Query(geometry.uvw(wi, wr), quadratures[0].lambda_nm, self.places)
        power, middle = self._answers([many, Query(uvw, lambda_nm, MIDDLE)])
        both = zip(quadratures, seen, strict=True)
        return [integrate(power, q, material, self._sigma_um, wi, wr) for q, (_, material) in both], middle

    def direct(self, uvw: Array, lambda_nm: Array) -> Array:
        """Computes |P|^2 (directions,) by plain sums, each direction at its own wavelength and in its own thread."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            one = partial(power_direct, self.field, self._sigma_um)
            found = pool.map(lambda at, nm: one(at[None], float(nm))[0], uvw, lambda_nm)
            return np.array(list(found))

    def _answers(self, queries: Sequence[Query]) -> list[Array]:
        """Computes |P|^2 (directions, L) for every query."""
        if self._size.serves_all:
            return self._from_one([(query, query.places) for query in queries], self.field)
        totals: list[Array | None] = [None] * len(queries)
        for place in dict.fromkeys(place for query in queries for place in query.places.pairs()):
            asked = [i for i, query in enumerate(queries) if place in query.places.pairs()]
            found = self._from_one([(queries[i], MIDDLE) for i in asked], self._part_of_patch(place))
            for i, power in zip(asked, found, strict=True):
                share = power / queries[i].places.count
                before = totals[i]
                totals[i] = share if before is None else before + share
        return [total for total in totals if total is not None]

    def _part_of_patch(self, place: tuple[int, int]) -> HeightField:
        return self.field if place == (0, 0) else windows.around(self.field, place, self._size.stack.samples)

    def _from_one(self, queries: Sequence[tuple[Query, Places]], field: HeightField) -> list[Array]:
        """Computes |P|^2 for queries at windows on one field, whose stack is held or made in parts."""
        is_held, terms = self._held is not None, self._size.terms
        exact: list[windowed_dft.ExactPower] = []
        with keeping_memory():
            for first in range(0, terms, self._size.terms_at_once):
                built, stack = self._held or self._uploaded(field, first)
                part = windowed_dft.PartOfTerms(first // windowed_dft.LANES, terms // windowed_dft.LANES)
                for query, places in queries[len(exact) :]:
                    modes = dft_stack.modes(built, places)
                    lambda_um = 1e-3 * query.lambda_nm
                    exact.append(windowed_dft.ExactPower(query.uvw, lambda_um, modes, in_parts=not is_held))
                for each in exact:
                    each.add(stack, part)
                # its memory serves the next part
                del built, stack
        return [each.power() for each in exact]

    def _uploaded(self, field: HeightField, first: int) -> tuple[dft_stack.Stack, windowed_dft.DeviceStack]:
        built = self._build(field, first, min(self._size.terms_at_once, self._size.terms - first))
        return built, upload(built)

    def _build(self, field: HeightField, first: int, terms: int) -> dft_stack.Stack:
        reachable = expansion.W_MAX / (1e-3 * self._lambda_min_nm)
        return dft_stack.build(
            field,
            "chebyshev",
            terms,
            self._sigma_um,
            reachable,
            _TOLERANCE,
            self._progress,
            whole=self._size.serves_all,
            first_term=first,
        )


def _terms(half_range_um: float, lambda_min_nm: float) -> int:
    """Computes the number of terms: whole vectors cost the same, and the device uses them without a copy."""
    z = expansion.largest_phase(half_range_um, lambda_min_nm)
    return windowed_dft.LANES * -(-(expansion.chebyshev_order(z, _TOLERANCE) + 1) // windowed_dft.LANES)


@dataclass(frozen=True)
class ReferenceSize:
    """The size of a `Reference`, known before it is made.

    terms: of its series. stack: size of its stack. serves_all: whether that is one of the whole patch for all
    windows. places: positions of the coherence window. extent: of the height field.
    """

    terms: int
    stack: dft_stack.StackSize
    serves_all: bool
    places: Places
    extent: Extent

    @property
    def is_held(self) -> bool:
        """Says whether the stack stays in memory."""
        is_one = self.serves_all or self.places == MIDDLE
        return is_one and self.stack.stack_bytes(self.terms, 8) <= _HELD_BYTES

    @property
    def terms_at_once(self) -> int:
        """Terms of a part of the stack: all, or one vector of them."""
        return self.terms if self.is_held else windowed_dft.LANES

    @property
    def part_bytes(self) -> int:
        """Bytes of a part of the stack."""
        return self.stack.stack_bytes(self.terms_at_once, 8)

    @property
    def nbytes(self) -> int:
        """Bytes that stay in memory: of its stack, if that is held, and of the height field."""
        return self.extent.bytes + (self.part_bytes if self.is_held else 0)

    @property
    def _modes(self) -> tuple[int, int]:
        return (len(self.places.x), len(self.places.y)) if self.serves_all else (1, 1)

    def _amplitude_bytes(self, directions: int, wavelengths: int) -> int:
        """Computes the size of P of all modes, which is kept while parts of the stack are made, bytes."""
        return 0 if self.is_held else 16 * directions * (wavelengths + 3) * self._modes[0] * self._modes[1]

    def tiles(self, directions: int, wavelengths: int) -> Iterator[slice]:
        """Yields parts of so many directions, for which |P|^2 and P of all modes take bounded memory."""
        at_once = _DIRECTIONS_AT_ONCE
        if not self.is_held:
            at_once = max(1, min(at_once, _AMPLITUDE_BYTES // self._amplitude_bytes(1, wavelengths)))
        for first in range(0, directions, at_once):
            yield slice(first, min(first + at_once, directions))

    def making(self) -> resources.Arrays:
        """Lists the arrays while a stack that is held is made."""
        made = self.stack.chebyshev_bytes(self.terms, 8) if self.is_held else {}
        return {"height field of the reference": self.extent.bytes, **made}

    def answering(self, directions: int, wavelengths: int, material: Material) -> resources.Arrays:
        """Lists the arrays while it answers for directions: the stack, |P|^2 of a tile, a metal's reflectance there.

        A stack that is not held is made in parts, while P of every mode is kept.
        """
        tile = next(self.tiles(directions, wavelengths)).stop
        units = os.cpu_count() or 1
        terms = self.terms_at_once
        power = windowed_dft.exact_power_bytes(tile, wavelengths, self.stack.reach[0], terms, units, self._modes)
        # four complex arrays of Fresnel's equations, R and its product with |P|^2
        metal = (4 * 16 + 2 * 8) * min(tile, _METAL_AT_ONCE) * wavelengths if material.fresnel == "conductor" else 0
        parts = {} if self.is_held else self.stack.chebyshev_bytes(terms, 8)
        return {
            "reference": self.nbytes,
            "|P|^2 of directions": power,
            "P of modes": self._amplitude_bytes(tile, wavelengths),
            "reflectances of directions": metal,
            "part of the reference": sum(parts.values()),
        }

    def seconds(self, directions: float, wavelengths: int) -> float:
        """Estimates the time of an answer: the coefficients under the window, of all terms, in double precision."""
        taps = (2 * self.stack.reach[0] + 1) * (2 * self.stack.reach[1] + 1)
        # sums over rows are shared by the modes along x
        sums = self._modes[1] if self.serves_all else self.places.count
        return resources.seconds(2.0 * sums * directions * wavelengths * taps * 2 * self.terms)


def size(extent: Extent, sigma_um: float, lambda_min_nm: float, places: Places) -> ReferenceSize:
    """Computes the size of a `Reference` of a height field before it is made.

    extent: of the height field. sigma_um: standard deviation of the coherence window, um. lambda_min_nm: shortest
    wavelength, nm. places: positions of the window.
    """
    reachable = expansion.W_MAX / (1e-3 * lambda_min_nm)
    serves_all = dft_stack.serves_all(extent, sigma_um, _TOLERANCE, places.count)
    chosen = dft_stack.size(extent, sigma_um, reachable, _TOLERANCE, whole=serves_all)
    return ReferenceSize(_terms(extent.half_range_um, lambda_min_nm), chosen, serves_all, places, extent)
