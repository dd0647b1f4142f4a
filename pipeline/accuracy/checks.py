"""How far a table is from the reference: on random directions, on maps, and as its settings vary."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import MeanReference, Reference, power_direct
from pipeline.errors import AccuracyError
from pipeline.optics import geometry
from pipeline.optics.colour import ColourError, colour_errors, delta_e
from pipeline.optics.light import trapezoid
from pipeline.optics.random_directions import random_pairs
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Evaluator, Map

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


def _colour_errors(config: Config, found: Array, truth: Array) -> list[ColourError]:
    unit = config.radiometry.unit
    return colour_errors(found / unit, truth / unit, config.accuracy.exposure_ru)


@dataclass(frozen=True)
class RandomCheck:
    """A table against the reference on random directions: Y of |P|^2 integrated, and colours."""

    directions: int
    power: RelativeError
    colour: list[ColourError]


def check_random(
    evaluate: Evaluator, reference: MeanReference, config: Config, progress: Progress = silent
) -> RandomCheck:
    """The table (`evaluate`) against the reference on directions it was not made for."""
    wi, wr = random_pairs(config.scene, RANDOM_DIRECTIONS, _SEED)
    truth = reference.xyz(config.light, config.material, wi, wr, progress=progress)
    found = evaluate(wi, wr)
    # over a mirror's Y what is left is |P|^2
    mirror = config.radiometry.mirror_luminance(wi, wr)
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
    reference: MeanReference,
    config: Config,
    light: Array,
    radius: float,
    progress: Progress = silent,
) -> MapCheck:
    """The table against the reference on the map of one light (3,)."""
    views = Map(MAP_SIZE, min(MAP_RADIUS, radius))
    wr = views.views()
    wi = np.broadcast_to(light, wr.shape)
    truth = reference.xyz(config.light, config.material, wi, wr, progress=progress)
    found = evaluate(wi, wr)
    unit, errors = config.radiometry.unit, _colour_errors(config, found, truth)
    return MapCheck(views, views.image(found / unit), views.image(truth / unit), errors)


def check_reference(field: HeightField, reference: Reference, config: Config, directions: int = 3) -> RelativeError:
    """The reference's fast route against the plain sum over samples, on a few directions, each at one wavelength.

    Raises AccuracyError where they differ: then nothing measured against the reference means anything.
    """
    wi, wr = random_pairs(config.scene, directions, _SEED + 1)
    # the mirror direction is within every scan's band
    uvw = np.concatenate([geometry.uvw(wi, wr), [[0.0, 0.0, -1.5]]])
    nodes = trapezoid(config.light, 100.0).lambda_nm
    direction = np.arange(len(uvw))
    node = direction % len(nodes)
    direct = _direct_sums(field, config.coherence.sigma_um, uvw, nodes[node])
    known = np.isfinite(direct)
    fast = reference.power(uvw, nodes)[direction, node]
    if np.max(np.abs(fast - direct)[known]) > _REFERENCE_TOLERANCE:
        raise AccuracyError(
            f"the exact reference's two routes differ by {np.max(np.abs(fast - direct)[known]):.1e} of the mirror, "
            f"more than {_REFERENCE_TOLERANCE:g}; please report this config"
        )
    return relative_error(fast[known], direct[known], MIRROR_FLOOR)


def _direct_sums(field: HeightField, sigma_um: float, uvw: Array, lambda_nm: Array) -> Array:
    """|P|^2 (directions,) by plain sums, each direction at its own wavelength, a thread a sum."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(lambda one, nm: power_direct(field, sigma_um, one[None], float(nm))[0], uvw, lambda_nm)
        return np.array(list(found))
