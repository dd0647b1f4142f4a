"""How far a table is from the reference: on random directions, on maps, and as its settings vary."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline import stack as dft_stack
from pipeline.config import Config
from pipeline.directions import random_pairs
from pipeline.errors import AccuracyError
from pipeline.evaluate import Evaluator, Map, relative_unit, table_evaluator
from pipeline.optics import brdf, geometry
from pipeline.optics.colour_error import ColourError, colour_errors, delta_e
from pipeline.optics.geometry import Array
from pipeline.optics.spectra import Quadrature, trapezoid
from pipeline.progress import Progress, silent
from pipeline.reference import STEP_NM, Reference, power_direct
from pipeline.surface.heightfield import HeightField
from pipeline.tables import taylor

# the map over which this project states colour errors: 301 x 301 inside radius 0.98
MAP_SIZE, MAP_RADIUS = 301, 0.98
RANDOM_DIRECTIONS = 2000
_SEED = 20140601
# |P|^2 below this share of the mirror is compared with it, not with itself
MIRROR_FLOOR = 1e-7
# what the reference promises, of the mirror
_REFERENCE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class RelativeError:
    """Statistics of |value - reference| / max(|reference|, floor)."""

    median: float
    percentile_99: float
    maximum: float


def relative_error(values: Array, reference: Array, floor: float) -> RelativeError:
    """Relative error where the reference exceeds `floor`, absolute over `floor` below it."""
    error = np.abs(values - reference) / np.maximum(np.abs(reference), floor)
    return RelativeError(float(np.median(error)), float(np.percentile(error, 99)), float(error.max()))


def _integrand(config: Config, step_nm: float) -> Quadrature:
    return brdf.integrand(config.material, config.spectrum, step_nm, config.coherence.sigma_um)


def mirror_luminance(config: Config, wi: Array, wr: Array) -> Array:
    """Y (directions,) that |P|^2 = 1 at every wavelength would give at these directions."""
    plain = trapezoid(config.spectrum, config.mean_step_nm)
    inside = _integrand(config, config.mean_step_nm).weights[:, 1].sum()
    return brdf.direction_factor(config.material, plain, wi, wr) * float(inside)


def _colour_errors(config: Config, found: Array, truth: Array) -> list[ColourError]:
    unit = relative_unit(config)
    return colour_errors(found / unit, truth / unit, config.accuracy.exposure_ru)


@dataclass(frozen=True)
class RandomCheck:
    """A table against the reference on random directions: Y of |P|^2 integrated, and colours."""

    directions: int
    power: RelativeError
    colour: list[ColourError]


def check_random(
    evaluate: Evaluator, reference: Reference, config: Config, progress: Progress = silent
) -> RandomCheck:
    """The table (`evaluate`) against the reference on directions it was not made for."""
    wi, wr = random_pairs(config.scene, RANDOM_DIRECTIONS, _SEED)
    truth = reference.xyz(config.spectrum, config.material, wi, wr, progress=progress)
    found = evaluate(wi, wr)
    # over a mirror's Y what is left is |P|^2
    mirror = mirror_luminance(config, wi, wr)
    power = relative_error(found[:, 1] / mirror, truth[:, 1] / mirror, MIRROR_FLOOR)
    return RandomCheck(len(wi), power, _colour_errors(config, found, truth))


@dataclass(frozen=True)
class MapCheck:
    """A table against the reference on one light's map; images are XYZ (size, size, 3) in RU."""

    views: Map
    table: Array
    reference: Array
    colour: list[ColourError]

    def delta_e_image(self, exposure_ru: float) -> Array:
        """CIELAB error (size, size) at an exposure."""
        return delta_e(self.table, self.reference, exposure_ru)


def check_map(
    evaluate: Evaluator,
    reference: Reference,
    config: Config,
    light: Array,
    radius: float,
    progress: Progress = silent,
) -> MapCheck:
    """The table against the reference on the map of one light (3,)."""
    views = Map(MAP_SIZE, min(MAP_RADIUS, radius))
    wr = views.views()
    wi = np.broadcast_to(light, wr.shape)
    truth = reference.xyz(config.spectrum, config.material, wi, wr, progress=progress)
    found = evaluate(wi, wr)
    unit, errors = relative_unit(config), _colour_errors(config, found, truth)
    return MapCheck(views, views.image(found / unit), views.image(truth / unit), errors)


def check_reference(field: HeightField, reference: Reference, config: Config, directions: int = 4) -> RelativeError:
    """The reference's fast route against the plain sum over samples, on a few directions and wavelengths.

    Raises AccuracyError where they differ: then nothing measured against the reference means anything.
    """
    wi, wr = random_pairs(config.scene, directions, _SEED + 1)
    # the mirror direction is within every scan's band
    uvw = np.concatenate([geometry.uvw(wi, wr), [[0.0, 0.0, -1.5]]])
    nodes = trapezoid(config.spectrum, 100.0).lambda_nm[:3]
    direct = np.stack([power_direct(field, config.coherence.sigma_um, uvw, nm) for nm in nodes], axis=-1)
    known = np.isfinite(direct)
    fast = reference.power(uvw, nodes)
    if np.max(np.abs(fast - direct)[known]) > _REFERENCE_TOLERANCE:
        raise AccuracyError(
            f"the exact reference's two routes differ by {np.max(np.abs(fast - direct)[known]):.1e} of the mirror, "
            f"more than {_REFERENCE_TOLERANCE:g}; please report this config"
        )
    return relative_error(fast[known], direct[known], MIRROR_FLOOR)


# --- convergence ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Curve:
    """Mean CIELAB error at one exposure as one setting varies, everything else as configured."""

    setting: str
    unit: str
    values: list[float]
    errors: list[float]
    chosen: float


class Convergence:
    """How the error of a map depends on each setting, on a coarse map under one light.

    Terms and wavelength step are varied at the views themselves, without a grid between, the other of the two as
    fine as the reference's; the grid is varied with everything else as configured.
    """

    _MAP_SIZE = 61

    def __init__(
        self,
        stack: dft_stack.Stack,
        chosen: Evaluator,
        reference: Reference,
        config: Config,
        light: Array,
        radius: float,
    ) -> None:
        self._stack, self._chosen, self._config = stack, chosen, config
        self._unit = relative_unit(config)
        self._wr = Map(self._MAP_SIZE, min(MAP_RADIUS, radius)).views()
        self._wi = np.broadcast_to(light, self._wr.shape)
        self._uvw = geometry.uvw(self._wi, self._wr)
        self._truth = reference.xyz(config.spectrum, config.material, self._wi, self._wr)

    def terms(self) -> Curve:
        """Mean error against the order N of the series."""
        most = self._stack.terms - 1
        orders = sorted({max(1, round(most * share)) for share in (0.25, 0.4, 0.55, 0.7, 0.85, 1.0)})
        errors = [self._error(self._at_views(order, STEP_NM)) for order in orders]
        return Curve("terms N", "", [float(order) for order in orders], errors, float(most))

    def step(self) -> Curve:
        """Mean error against the wavelength step."""
        chosen = self._config.table.step_nm
        steps = sorted({1.0, 2.0, 5.0, 10.0, 20.0, chosen})
        errors = [self._error(self._at_views(self._stack.terms - 1, step)) for step in steps]
        return Curve("wavelength step", "nm", steps, errors, chosen)

    def grid(self) -> Curve:
        """Mean error against the table's resolution, at the configured exponent."""
        chosen = self._config.table.resolution
        sizes = sorted({n for n in (51, 101, 201, 301) if n < chosen})
        errors = [self._on_grid(size, self._config.table.power) for size in sizes]
        errors.append(self._error(self._chosen(self._wi, self._wr)))
        return Curve("resolution", "nodes", [float(n) for n in (*sizes, chosen)], errors, float(chosen))

    def exponent(self) -> Curve:
        """Mean error against the grid's exponent a, at 201 nodes or the configured ones where fewer."""
        size = min(201, self._config.table.resolution)
        powers = sorted({1.0, 2.0, 3.0, 5.0, self._config.table.power})
        errors = [self._on_grid(size, power) for power in powers]
        return Curve(f"exponent a at {size} nodes", "", powers, errors, self._config.table.power)

    def _on_grid(self, size: int, power: float) -> float:
        quadrature = _integrand(self._config, self._config.table.step_nm)
        table = taylor.build(self._stack, quadrature, size, power, self._config.scene)
        return self._error(table_evaluator(table, self._config)(self._wi, self._wr))

    def _at_views(self, order: int, step_nm: float) -> Array:
        """XYZ at the views by a Taylor series of given order and step."""
        fewer = replace(self._stack, coefficients=self._stack.coefficients[..., : order + 1])
        turn = np.where(self._uvw[:, 0] < 0.0, -1.0, 1.0)
        i_p = taylor.node_values(fewer, _integrand(self._config, step_nm), turn[:, None] * self._uvw[:, :2])
        # I_p(-u, -v) = (-1)^p I_p(u, v), so w takes the turn's sign
        summed = taylor.sum_powers(i_p, turn * self._uvw[:, 2])
        plain = trapezoid(self._config.spectrum, step_nm)
        return brdf.direction_factor(self._config.material, plain, self._wi, self._wr)[:, None] * summed

    def _error(self, xyz: Array) -> float:
        exposure = self._config.accuracy.exposure_ru
        return float(np.mean(delta_e(xyz / self._unit, self._truth / self._unit, exposure)))
