"""What a polar table is made of, chosen for an error budget: terms, nodes, rings, azimuths, quadrature.

What a series needs follows from its tail: Bessel's functions bound Chebyshev's coefficients of every exponential
(Jacobi-Anger). What the grid needs depends on the surface, so it is measured: three small tables beside probes that
lie between their texels tell how the error falls with rings and with azimuths, and their product is made smallest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import asinh, ceil, sqrt

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kernels import polar as device
from pipeline import series, spectrum, stack
from pipeline.config import LaserLine, Material, PolarLayout, Scene, Spectrum
from pipeline.directions import random_pairs
from pipeline.errors import AccuracyError
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.colour_error import delta_e
from pipeline.optics.geometry import Array
from pipeline.optics.spectra import Quadrature, shortest_wavelength_nm, trapezoid
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables import polar, quadrature
from pipeline.tables.polar_grid import RHO_MAX, TILE, Azimuths, Rings

# shares of a budget of dE: what each approximation may leave, as relative amplitude or intensity
AMPLITUDE_SHARE = 1e-4  # of P, by terms left out and by the window's cut
_NODES_SHARE = 0.005  # of E, by its nodes in s
_W_SHARE, _W_SHARE_OF_A_LINE = 0.3, 0.1  # of the table, by its terms in |w|; of at most 0.1
_QUADRATURE_SHARE = 3e-3  # of each integral, by its wavelengths
_GRID_SHARE = 0.65  # of the budget, by rings and azimuths as the probes see it
_MOST_BYTES = 3 * 2**30
# a start for the search: the grid that keeps 0.1 on snake scans at sigma = 16.25 um
_BASE_SIGMA_UM, _BASE_DELTA_E, _BASE_AZIMUTHS, _BASE_RING_STEP, _BASE_R0 = 16.25, 0.1, 1792, 0.0253, 0.12
_LEAST_RINGS, _LEAST_AZIMUTHS, _MOST_RINGS, _MOST_AZIMUTHS = 24, 128, 4096, 32768
_LEAST_STRETCH = 0.3
_CHANCE = 0.04  # the harmonic that speckle of no direction has
_PROBE_RHOS, _PROBE_ANGLES, _ANGLE_BINS = 48, 64, 1024
_ROUNDS = 6
_GROWTH = 1.5
_NEAR = 0.75  # of the target: near enough not to search on
_SEED = 19991
_MIDDLING_PER_UM = 1.0
_LUMINOUS_NM = 545.0  # the middle of D65 under the eye's Y


@dataclass(frozen=True)
class Budget:
    """The mean CIELAB error allowed at an exposure."""

    delta_e: float
    exposure_ru: float

    @property
    def quadrature(self) -> float:
        """Relative error that each ring's wavelengths may leave."""
        return _QUADRATURE_SHARE * self.delta_e


@dataclass(frozen=True)
class Plan:
    """What was chosen, and the mean error at the probes; None where no grid was searched for."""

    terms: int
    s_nodes: int
    w_terms: int
    azimuths: Azimuths
    rings: Rings
    probed_delta_e: float | None

    @property
    def texels(self) -> int:
        return self.rings.count * self.azimuths.count


def rho_max(scene: Scene | None) -> float:
    """How far out in (u, v) a table must reach: |wi| + |wr| along the surface, 2 without a scene."""
    if scene is None:
        return RHO_MAX
    view = np.sin(np.radians(scene.views.theta_max_deg))
    return float(min(RHO_MAX, max(np.sin(np.radians(light.theta_deg)) for light in scene.lights) + view))


def make(
    fields: Sequence[HeightField],
    sigma_um: float,
    light: Spectrum,
    scene: Scene | None,
    budget: Budget,
    layout: PolarLayout,
    progress: Progress = silent,
) -> tuple[spectrum.PolarSpectrum, Plan]:
    """The power spectrum on the azimuths that the budget asks for, and the whole plan.

    `fields` are the places of the window (pipeline.windows); E is their mean, planned on the first. Of the light only
    its wavelengths count: a range, or a line. Raises AccuracyError where the budget is out of reach or E would not
    fit into memory.
    """
    lambda_min, outer = shortest_wavelength_nm(light), rho_max(scene)
    z = series.largest_phase(max(field.half_range_um for field in fields), lambda_min)
    amplitude = AMPLITUDE_SHARE * budget.delta_e
    wanted = series.chebyshev_order(z, amplitude) + 1 if layout.terms == "auto" else layout.terms
    # whole vectors of terms cost the same and are shared with the device without a copy
    terms = device.LANES * ceil(wanted / device.LANES)
    nodes = series.chebyshev_order(z, min(0.1, _NODES_SHARE * budget.delta_e)) + 1
    light = _probing_light(light, layout)
    line = isinstance(light.illuminant, LaserLine)
    spacing = spectrum.SPACING_OF_A_LINE if line else spectrum.SPACING
    radius = spectrum.radii(sigma_um, outer / (1e-3 * lambda_min), spacing)
    built = spectrum.chebyshev_stack(fields[0], sigma_um, radius[-1], terms, amplitude, progress)
    made, plan = _Search(built, radius, light, scene, budget, layout, lambda_min, nodes, z).run()
    for field in fields[1:]:
        built = spectrum.chebyshev_stack(field, sigma_um, radius[-1], terms, amplitude, progress)
        made.values[...] += spectrum.build(built, made.azimuths, radius, lambda_min, nodes).values
    made.values[...] /= np.float32(len(fields))
    return made, plan


class _Search:
    """The search for the smallest grid."""

    def __init__(
        self,
        built: stack.Stack,
        radius: Array,
        light: Spectrum,
        scene: Scene | None,
        budget: Budget,
        layout: PolarLayout,
        lambda_min: float,
        nodes: int,
        z: float,
    ) -> None:
        self._stack, self._budget, self._layout, self._nodes = built, budget, layout, nodes
        self._lambda_min, self._rho_max = lambda_min, rho_max(scene)
        self._radius = radius
        self._line = isinstance(light.illuminant, LaserLine)
        self._light = light
        # the luminous middle of white light counts, not its blue end
        phase = z * lambda_min / _middle_nm(light)
        share = _W_SHARE_OF_A_LINE if self._line else _W_SHARE
        w_order = series.chebyshev_order(phase, share * min(0.1, budget.delta_e)) + 1
        self._w_terms = 4 * ceil(w_order / 4) if layout.w_terms == "auto" else layout.w_terms
        self._scene = scene
        self._stretch, self._axis = anisotropy(built)
        self._cache: dict[int, spectrum.PolarSpectrum] = {}
        self._probes: _Probes | None = None

    def run(self) -> tuple[spectrum.PolarSpectrum, Plan]:
        rings, azimuths = self._start()
        # what does not fit is refused before anything is measured
        self._spectrum(azimuths)
        error = None
        if "auto" in (self._layout.rings, self._layout.azimuths):
            rings, azimuths, error = self._smallest(rings, azimuths)
        made = self._spectrum(azimuths)
        return made, Plan(self._stack.terms, self._nodes, self._w_terms, made.azimuths, self._rings(rings), error)

    def _start(self) -> tuple[int, int]:
        """Rings and azimuths to begin with: both follow the window, and the error falls with their square."""
        finer = sqrt(_BASE_DELTA_E / self._budget.delta_e)
        window = self._stack.sigma_um / _BASE_SIGMA_UM
        x = asinh(self._rho_max / self._r0)
        step = 0.5 * x / (self._radius[-1] * 2.0 * np.pi * self._stack.sigma_um) if self._line else _BASE_RING_STEP
        rings = int(np.clip(x / step * finer, self._least_rings, _MOST_RINGS))
        azimuths = int(np.clip(_BASE_AZIMUTHS * window * finer, _LEAST_AZIMUTHS, _MOST_AZIMUTHS))
        layout = self._layout
        return (
            rings if layout.rings == "auto" else layout.rings,
            _whole_tiles(azimuths) if layout.azimuths == "auto" else layout.azimuths,
        )

    @property
    def _r0(self) -> float:
        """Rings are even where the specular lobe's width rules; under a laser line, everywhere."""
        widest = 4.0 * self._rho_max
        return widest if self._line else min(_BASE_R0 * _BASE_SIGMA_UM / self._stack.sigma_um, widest)

    @property
    def _least_rings(self) -> int:
        """So many that the specular lobe is seen, which random probes hardly meet: its own width apart there."""
        lobe = 1e-3 * self._lambda_min * sigma_f(self._stack.sigma_um)
        return max(_LEAST_RINGS, ceil(self._r0 * asinh(self._rho_max / self._r0) / lobe))

    def _rings(self, count: int) -> Rings:
        return Rings(count, self._r0, self._rho_max)

    def _spectrum(self, azimuths: int) -> spectrum.PolarSpectrum:
        if azimuths not in self._cache:
            need = 4 * azimuths * self._nodes * len(self._radius)
            if need > _MOST_BYTES:
                raise AccuracyError(
                    f"the power spectrum on {azimuths} azimuths and {self._nodes} nodes in s needs "
                    f"{need / 2**30:.1f} GiB, more than the {_MOST_BYTES / 2**30:.0f} GiB allowed. Use a smaller "
                    "coherence.sigma_um, lower the heights or raise accuracy.delta_e."
                )
            self._cache = {azimuths: self._gather(Azimuths(azimuths, self._stretch, self._axis))}
        return self._cache[azimuths]

    def _gather(self, azimuths: Azimuths) -> spectrum.PolarSpectrum:
        return spectrum.build(self._stack, azimuths, self._radius, self._lambda_min, self._nodes)

    def _smallest(self, rings: int, azimuths: int) -> tuple[int, int, float]:
        """Rings and azimuths whose error is within the budget at the least product, as far as a model tells."""
        target = _GRID_SHARE * self._budget.delta_e
        errors = {}

        def error(r: int, a: int) -> float:
            if (r, a) not in errors:
                errors[r, a] = self._error(r, a)
            return errors[r, a]

        # e^2 = (rings' share) / rings^4 + (azimuths' share) / azimuths^4 + the rest, from three tables
        here = error(rings, azimuths) ** 2
        other_rings = _other(rings, 3 * rings // 4)
        other_azimuths = _other(azimuths, _whole_tiles(3 * azimuths // 4))
        by_rings = _share(error(other_rings, azimuths) ** 2 - here, other_rings, rings)
        by_azimuths = _share(error(rings, other_azimuths) ** 2 - here, other_azimuths, azimuths)
        rest = max(here - by_rings * rings**-4.0 - by_azimuths * azimuths**-4.0, 0.0)
        left = max(target**2 - rest, 0.25 * target**2)
        best = rings, azimuths
        for _ in range(_ROUNDS):
            before, best = best, self._clipped((2.0 * by_rings / left) ** 0.25, (2.0 * by_azimuths / left) ** 0.25)
            if errors.get(best, 0.0) > target:
                # the model has nothing more to ask for, and errs: a coarse grid may be better by luck
                best = self._clipped(_GROWTH * before[0], _GROWTH * before[1])
            if _NEAR * target <= error(*best) <= target:
                break
            left *= min(4.0, (0.9 * target / error(*best)) ** 2)
        # what a config sets was varied to measure, not to choose
        allowed = {pair: errors[pair] for pair in errors if pair == self._clipped(*pair)}
        met = [pair for pair in allowed if allowed[pair] <= target]
        best = min(met, key=lambda pair: pair[0] * pair[1]) if met else min(allowed, key=allowed.__getitem__)
        return *best, allowed[best]

    def _clipped(self, rings: float, azimuths: float) -> tuple[int, int]:
        layout = self._layout
        return (
            int(np.clip(ceil(rings), self._least_rings, _MOST_RINGS)) if layout.rings == "auto" else layout.rings,
            _whole_tiles(int(np.clip(azimuths, _LEAST_AZIMUTHS, _MOST_AZIMUTHS)))
            if layout.azimuths == "auto"
            else layout.azimuths,
        )

    def _error(self, rings: int, azimuths: int) -> float:
        """Mean CIELAB error at the probes of a table of this size."""
        if self._probes is None:
            self._probes = _Probes(self)
        made, grid = self._spectrum(azimuths), self._rings(rings)
        quadratures = quadrature.choose(self.integrand, grid.rho(), self._stack.sigma_um, self._budget.quadrature)
        return self._probes.error(polar.build(made, grid, quadratures, self._w_terms))

    def integrand(self, step_nm: float) -> Quadrature:
        """The probing light under a wavelength step."""
        return brdf.integrand(Material(), self._light, step_nm, self._stack.sigma_um)

    def probe(self) -> tuple[Array, Array, Array, Array]:
        """Probes' uvw and C cos ti (rhos, angles, ...), the exact XYZ / (C cos ti) there, and what each counts.

        Exact means: from E at the probes' own rings and azimuths, with spare terms in |w|. Angles of half a
        turn serve its other half as well; each ring's pairs keep their own w.
        """
        half, counts = _probing_angles(self._stack, np.random.default_rng(_SEED))
        angles = np.concatenate([half, half + np.pi])
        wi, wr = random_pairs(self._scene, _PROBE_RHOS * len(angles), _SEED)
        rho = np.hypot(*(geometry.uvw(wi, wr)[:, :2].T))
        order = np.argsort(rho).reshape(_PROBE_RHOS, len(angles))
        middle = np.minimum(np.median(rho[order], axis=1), self._rho_max)
        w = geometry.uvw(wi, wr)[order, 2]
        uvw = np.stack(np.broadcast_arrays(middle[:, None] * np.cos(angles), middle[:, None] * np.sin(angles), w), -1)
        factor = brdf.direction_factor(Material(), trapezoid(self._light, 1.0), wi[order], wr[order])
        found = spectrum.gather(self._stack, half, self._radius, self._lambda_min, self._nodes)
        rules = quadrature.choose(self.integrand, middle, self._stack.sigma_um, self._budget.quadrature)
        terms = device.integrate(
            found,
            self._radius,
            spectrum.s_max(self._lambda_min),
            middle,
            rules,
            polar.at_nodes(polar.grey, middle, rules, self._w_terms + 8),
        ).reshape(_PROBE_RHOS, 3, -1, len(angles))
        x = polar.w_position(middle[:, None], w)
        cosines = np.cos(np.arange(terms.shape[2]) * np.arccos(x)[..., None])
        each = np.broadcast_to(np.tile(counts, 2), factor.shape)
        return uvw, factor, np.einsum("rcka,rak->rac", terms, cosines), each

    @property
    def exposure_ru(self) -> float:
        return self._budget.exposure_ru


class _Probes:
    """Directions between any table's texels, with the exact values there."""

    def __init__(self, search: _Search) -> None:
        uvw, factor, exact, self._counts = search.probe()
        self._uvw, self._factor = uvw.reshape(-1, 3), factor.reshape(-1, 1)
        self._exact, self._exposure = exact.reshape(-1, 3), search.exposure_ru

    def error(self, table: polar.PolarTable) -> float:
        """Mean CIELAB error of a table."""
        found = np.nan_to_num(polar.look_up(table, self._uvw))
        error = delta_e(self._factor * found, self._factor * self._exact, self._exposure)
        return float(np.average(error, weights=self._counts.ravel()))


def anisotropy(built: stack.Stack) -> tuple[float, float]:
    """How azimuths should crowd, (stretch, axis in radians), from where the surface scatters light.

    The second harmonic over azimuth of what is seen of it.
    """
    phi, seen = _scattering(built)
    harmonic = np.sum(seen * np.exp(2j * phi)) / max(float(seen.sum()), np.finfo(float).tiny)
    one_sided = max(0.0, abs(harmonic) - _CHANCE)
    stretch = max(_LEAST_STRETCH, (1.0 - one_sided) / (1.0 + one_sided))
    return float(stretch), float(0.5 * np.angle(harmonic))


def _scattering(built: stack.Stack) -> tuple[Array, Array]:
    """Azimuths of the stack's frequencies, and how much of their light is seen: its cube root, as the eye does.

    Of first order in the height, and per area of (u, v); without the specular lobe, which is round and says nothing.
    """
    power = np.sum(built.coefficients[:, built.column_zero :, :, 1] ** 2, axis=2)
    fy = (np.arange(power.shape[0]) - built.row_zero)[:, None] * built.spacing_per_um[1]
    fx = np.arange(power.shape[1]) * built.spacing_per_um[0]
    r = np.hypot(fx, fy)
    seen = np.where(r > 6.0 * sigma_f(built.sigma_um), np.cbrt(power) / np.maximum(r, fx[1]), 0.0)
    return np.arctan2(fy, fx), np.asarray(seen, float)


def _probing_angles(built: stack.Stack, rng: np.random.Generator) -> tuple[Array, Array]:
    """Azimuths of half a turn to probe, and what each counts for in a mean over all.

    Half of them go where light goes: a grating's orders lie on one line that even angles would miss.
    """
    phi, seen = _scattering(built)
    lit, edges = np.histogram(phi % np.pi, bins=_ANGLE_BINS, range=(0.0, np.pi), weights=seen)
    # the window gives a line flanks, as wide as its transform is at a middling radius
    width = sigma_f(built.sigma_um) / _MIDDLING_PER_UM * _ANGLE_BINS / np.pi
    lit = gaussian_filter1d(lit, width, mode="wrap")
    share = 0.5 / _ANGLE_BINS + 0.5 * lit / max(float(lit.sum()), np.finfo(float).tiny)
    share /= share.sum()
    strata = (np.arange(_PROBE_ANGLES) + rng.random(_PROBE_ANGLES)) / _PROBE_ANGLES
    found = np.interp(strata, np.concatenate([[0.0], np.cumsum(share)]), edges)
    counts = 1.0 / share[np.minimum((found / np.pi * _ANGLE_BINS).astype(int), _ANGLE_BINS - 1)]
    return found, counts / counts.mean()


def _probing_light(light: Spectrum, layout: PolarLayout) -> Spectrum:
    """What the grid is planned under: E serves every illuminant of a range, so equal energy, or else one line."""
    if isinstance(light.illuminant, LaserLine):
        return light
    if layout.form == "spectral":
        return Spectrum(illuminant=LaserLine(lambda_nm=_middle_nm(light)))
    return Spectrum(illuminant="E", range_nm=light.range_nm)


def _middle_nm(light: Spectrum) -> float:
    """The wavelength of a light that the eye weighs most."""
    if isinstance(light.illuminant, LaserLine):
        return light.illuminant.lambda_nm
    return float(np.clip(_LUMINOUS_NM, *light.range_nm))


def _other(count: int, coarser: int) -> int:
    """A second count to measure at: the coarser one, or the double where that is none."""
    return coarser if coarser < count else 2 * count


def _share(growth: float, other: int, here: int) -> float:
    """c of an error c / n^4 that grows by `growth` from `here` to `other`."""
    return float(max(growth / (other**-4.0 - here**-4.0), 0.0))


def _whole_tiles(azimuths: int) -> int:
    """Tiles that are whole for every fourth azimuth too, so coarser grids need no other gather."""
    return 4 * TILE * ceil(azimuths / (4 * TILE))
