"""Errors of a table against the exact reference, on random directions and on maps."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.errors import AccuracyError
from pipeline.optics import geometry
from pipeline.optics.colour import ColourError, colour_error, colour_errors, delta_e
from pipeline.optics.light import trapezoid
from pipeline.optics.random_directions import random_pairs
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Evaluator, Map, never_negative

# the map over which this project states colour errors: 301 x 301 inside radius 0.98
MAP_SIZE, MAP_RADIUS = 301, 0.98
RANDOM_DIRECTIONS = 2000
# a mean over at least so many windows is compared on half as many directions: its errors vary less from direction to
# direction, for its speckle has a lower contrast, and each one is three times the work
_MANY_WINDOWS = 4
_SEED = 20140601
# relative errors of a smaller |P|^2 are relative to this share of the mirror
MIRROR_FLOOR = 1e-7
# the largest error of the reference, of the mirror
_REFERENCE_TOLERANCE = 1e-9


def random_directions(windows: int) -> int:
    """Chooses the number of random directions on which a table of the mean over so many windows is certified."""
    return RANDOM_DIRECTIONS // 2 if windows >= _MANY_WINDOWS else RANDOM_DIRECTIONS


@dataclass(frozen=True)
class RelativeError:
    """Statistics of |value - reference| / max(|reference|, floor) over all values."""

    median: float
    percentile_99: float
    maximum: float


def relative_error(values: Array, reference: Array, floor: float) -> RelativeError:
    """Computes statistics of |value - reference| / max(|reference|, floor).

    values, reference: arrays of one shape. floor: in the unit of both.
    """
    error = np.abs(values - reference) / np.maximum(np.abs(reference), floor)
    return RelativeError(float(np.median(error)), float(np.percentile(error, 99)), float(error.max()))


def _colour_errors(config: Config, found: Array, truth: Array) -> list[ColourError]:
    unit = config.radiometry.unit
    return colour_errors(found / unit, truth / unit, config.accuracy.exposure_ru)


@dataclass(frozen=True)
class Clamped:
    """The negative values of interpolated colours, which are set to 0, on random directions.

    share: of the directions, those with a negative channel. cost: CIELAB difference that the zeros make, over all
    directions.
    """

    share: float
    cost: ColourError


def _clamped(config: Config, interpolated: Array) -> Clamped:
    unit, exposure = config.radiometry.unit, config.accuracy.exposure_ru
    cost = colour_error(never_negative(interpolated) / unit, interpolated / unit, exposure)
    return Clamped(float(np.mean(np.any(interpolated < 0.0, axis=-1))), cost)


@dataclass(frozen=True)
class RandomCheck:
    """Errors of a table against the reference on random directions.

    directions: their number. power: of Y over that of a mirror, which is |P|^2 integrated over wavelengths.
    colour: CIELAB errors, one for each exposure. clamped: the negative values that were set to 0.
    """

    directions: int
    power: RelativeError
    colour: list[ColourError]
    clamped: Clamped


def check_random(
    interpolate: Evaluator, reference: Reference, config: Config, progress: Progress = silent
) -> RandomCheck:
    """Compares a table with the reference on random directions that its planning did not use.

    interpolate: computes the table's XYZ for pairs of directions, negative values included; the errors are those
        without them. reference: of the same height field.
    config: its light, material, scene and exposure are read.
    progress: called with a step's name and its completed share, 0 to 1.
    """
    wi, wr = random_pairs(config.scene, random_directions(reference.places.count), _SEED)
    truth = reference.xyz(config.light, config.material, wi, wr, progress=progress)
    return _compared(interpolate(wi, wr), truth, config, wi, wr)


def _compared(interpolated: Array, truth: Array, config: Config, wi: Array, wr: Array) -> RandomCheck:
    found = never_negative(interpolated)
    # Y over that of a mirror is |P|^2, without the material's factors
    mirror = config.radiometry.mirror_luminance(wi, wr)
    power = relative_error(found[:, 1] / mirror, truth[:, 1] / mirror, MIRROR_FLOOR)
    return RandomCheck(len(wi), power, _colour_errors(config, found, truth), _clamped(config, interpolated))


@dataclass(frozen=True)
class MapCheck:
    """Errors of a table against the reference on the map of one light.

    views: the map. table, reference: XYZ (size, size, 3), RU. colour: CIELAB errors, one for each exposure.
    """

    views: Map
    table: Array
    reference: Array
    colour: list[ColourError]

    def delta_e_image(self, exposure_ru: float) -> Array:
        """Computes the CIELAB error (size, size) at an exposure, RU."""
        return delta_e(self.table, self.reference, exposure_ru)


def check_map(
    evaluate: Evaluator,
    reference: Reference,
    config: Config,
    light: Array,
    radius: float,
    progress: Progress = silent,
) -> MapCheck:
    """Compares a table with the reference on the map of one light.

    evaluate: computes the table's XYZ for pairs of directions. reference: of the same height field.
    config: its light, material and exposure are read. light: unit vector (3,) towards it.
    radius: sin(theta) of the outermost views; at most 0.98 is used.
    progress: called with a step's name and its completed share, 0 to 1.
    """
    views = Map(MAP_SIZE, min(MAP_RADIUS, radius))
    wr = views.views()
    wi = np.broadcast_to(light, wr.shape)
    truth = reference.xyz(config.light, config.material, wi, wr, progress=progress)
    found = evaluate(wi, wr)
    unit, errors = config.radiometry.unit, _colour_errors(config, found, truth)
    return MapCheck(views, views.image(found / unit), views.image(truth / unit), errors)


def check_table(
    interpolate: Evaluator, reference: Reference, config: Config, directions: int = 3
) -> tuple[RandomCheck, RelativeError]:
    """Compares a table with the reference, as `check_random` does, and the reference with plain sums over samples.

    The sums are those of the window in the middle, on a few directions, each at one wavelength. The reference answers
    for both at once, because it may have to make its stack for every answer.

    interpolate, reference: as in `check_random`. config: its light, material, scene, window and exposure are read.
    directions: number of random directions of the sums; a mirror direction is added.
    Returns the errors of the table, and relative errors of |P|^2 of the reference.
    Raises AccuracyError where the two algorithms of the reference differ by more than 1e-9 of the mirror, because
    then no error that is measured against the reference can be trusted.
    """
    wi, wr = random_pairs(config.scene, directions, _SEED + 1)
    # the mirror direction lies within the Nyquist limits of every scan
    uvw = np.concatenate([geometry.uvw(wi, wr), [[0.0, 0.0, -1.5]]])
    nodes = trapezoid(config.light, 100.0).lambda_nm
    direction = np.arange(len(uvw))
    node = direction % len(nodes)
    wi, wr = random_pairs(config.scene, random_directions(reference.places.count), _SEED)
    truth, middle = reference.xyz_and_middle(config.light, config.material, wi, wr, uvw, nodes)
    fast = middle[direction, node]
    direct = _direct_sums(reference.field, config.coherence.sigma_um, uvw, nodes[node])
    known = np.isfinite(direct)
    if np.max(np.abs(fast - direct)[known]) > _REFERENCE_TOLERANCE:
        raise AccuracyError(
            f"the two algorithms of the exact reference differ by {np.max(np.abs(fast - direct)[known]):.1e} of the "
            f"mirror, more than {_REFERENCE_TOLERANCE:g}; please report this config"
        )
    checked = relative_error(fast[known], direct[known], MIRROR_FLOOR)
    return _compared(interpolate(wi, wr), truth, config, wi, wr), checked


def _direct_sums(field: HeightField, sigma_um: float, uvw: Array, lambda_nm: Array) -> Array:
    """Computes |P|^2 (directions,) by plain sums, each direction at its own wavelength and in its own thread."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(lambda one, nm: power_direct(field, sigma_um, one[None], float(nm))[0], uvw, lambda_nm)
        return np.array(list(found))
