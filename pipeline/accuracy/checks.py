"""Errors of a table against the exact reference, on random directions and on maps."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.errors import AccuracyError
from pipeline.optics import geometry
from pipeline.optics.coherence import FLANK_DELTA_E, FLANK_RU, FLANK_WIDTHS, lobe_width
from pipeline.optics.colour import ColourError, colour_error, colour_errors, delta_e, exposures, statistics
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress, silent
from pipeline.scene.pairs import border_pairs, flank_pairs, random_pairs
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


def certified_directions(windows: int) -> int:
    """Computes the largest number of directions of a certificate: random ones, beside mirrors, and at a border."""
    return random_directions(windows) + 2 * _flank_directions(windows)


def _flank_directions(windows: int) -> int:
    return random_directions(windows) // 5


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


# why a table errs most where it does: on the flank XYZ falls by orders of magnitude from one ring to the next
Reason = Literal["flank of the specular lobe", "speckle between texels"]


@dataclass(frozen=True)
class LargestError:
    """The largest CIELAB error over a set of directions, and its place.

    delta_e: the error, at `exposure_ru`, RU. light_deg, view_deg: polar angles of light and view.
    uv: (u, v). lobe_widths: |(u, v)|, the distance from the mirror direction, in widths of the specular lobe at the
    luminous middle. found, exact: XYZ there, RU. reason: of a table between its texels.
    """

    delta_e: float
    exposure_ru: float
    light_deg: float
    view_deg: float
    uv: tuple[float, float]
    lobe_widths: float
    found: tuple[float, float, float]
    exact: tuple[float, float, float]
    reason: Reason


def largest_error(
    config: Config,
    directions: tuple[Array, Array],
    colours: tuple[Array, Array],
    errors: Array,
    exposure_ru: float,
) -> LargestError:
    """Finds the largest CIELAB error.

    config: its light and window are read. directions: unit vectors wi, wr (n, 3).
    colours: XYZ of the table and exact XYZ (n, 3), RU. errors: their CIELAB differences (n,) at `exposure_ru`, RU.
    """
    worst = int(np.argmax(errors))
    wi, wr = (one[worst] for one in directions)
    u, v, _ = geometry.uvw(wi, wr)
    widths = float(np.hypot(u, v)) / lobe_width(config.light.middle_nm, config.coherence.sigma_um)
    light, view = (float(np.degrees(np.arccos(min(1.0, one[2])))) for one in (wi, wr))
    (x, y, z), (true_x, true_y, true_z) = (one[worst] for one in colours)
    return LargestError(
        delta_e=float(errors[worst]),
        exposure_ru=exposure_ru,
        light_deg=light,
        view_deg=view,
        uv=(float(u), float(v)),
        lobe_widths=widths,
        found=(float(x), float(y), float(z)),
        exact=(float(true_x), float(true_y), float(true_z)),
        reason="flank of the specular lobe" if widths <= FLANK_WIDTHS else "speckle between texels",
    )


@dataclass(frozen=True)
class FlankCheck:
    """Errors of a table against the reference on the flank of the specular lobe, beside mirror directions.

    directions: their number, within `lobe_widths` widths of the lobe. colour: CIELAB errors at 1000 RU.
    largest: the largest of them. kept: whether it is at most 5.
    """

    directions: int
    lobe_widths: float
    colour: ColourError
    largest: LargestError
    kept: bool


def check_flank(interpolate: Evaluator, reference: Reference, config: Config) -> FlankCheck | None:
    """Compares a table with the reference on the flank of the specular lobe, for lights at all angles.

    Random directions hardly meet it, and a mean over a map hides it.

    interpolate: computes the table's XYZ for pairs of directions. reference: of the same height field.
    config: its light, material, window and scene are read.
    Returns None where the scene sees no direction of it.
    """
    wi, wr = _flank_pairs(config, reference.places.count)
    if not len(wi):
        return None
    return _flank(interpolate(wi, wr), reference.xyz(config.light, config.material, wi, wr), config, wi, wr)


def _flank_pairs(config: Config, windows: int) -> tuple[Array, Array]:
    """Draws the pairs of light and view on the flank that the scene sees."""
    rng, count = np.random.default_rng(_SEED + 2), _flank_directions(windows)
    reach = FLANK_WIDTHS * lobe_width(config.light.middle_nm, config.coherence.sigma_um)
    rho, phi = reach * rng.random(count), 2.0 * np.pi * rng.random(count)
    wi, wr = flank_pairs(config.scene, rho, phi, _SEED + 3)
    seen = np.isfinite(wr[:, 2])
    return wi[seen], wr[seen]


def _flank(interpolated: Array, truth: Array, config: Config, wi: Array, wr: Array) -> FlankCheck:
    unit = config.radiometry.unit
    colours = never_negative(interpolated) / unit, truth / unit
    errors = delta_e(*colours, FLANK_RU)
    colour, largest = statistics(errors, FLANK_RU), largest_error(config, (wi, wr), colours, errors, FLANK_RU)
    return FlankCheck(len(wi), FLANK_WIDTHS, colour, largest, colour.maximum <= FLANK_DELTA_E)


def check_border(interpolate: Evaluator, reference: Reference, config: Config) -> RandomCheck | None:
    """Compares a table with the reference on the outermost directions of a scene, beyond which nothing is known.

    interpolate, reference: as in `check_flank`. config: its light, material, exposure and scene are read.
    Returns None without a scene.
    """
    wi, wr = _border_pairs(config, reference.places.count)
    if not len(wi):
        return None
    return _compared(interpolate(wi, wr), reference.xyz(config.light, config.material, wi, wr), config, wi, wr)


def _border_pairs(config: Config, windows: int) -> tuple[Array, Array]:
    return border_pairs(config.scene, _flank_directions(windows), _SEED + 4)


@dataclass(frozen=True)
class MapCheck:
    """Errors of a table against the reference on the map of one light.

    views: the map. table, reference: XYZ (size, size, 3), RU. delta_e: CIELAB error (size, size) at the exposure of
    [accuracy]. colour: CIELAB errors, one for each exposure. largest: the largest of them at each exposure.
    """

    views: Map
    table: Array
    reference: Array
    delta_e: Array
    colour: list[ColourError]
    largest: list[LargestError]


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
    unit, asked = config.radiometry.unit, config.accuracy.exposure_ru
    colours = evaluate(wi, wr) / unit, truth / unit
    errors = {exposure: delta_e(*colours, exposure) for exposure in exposures(asked)}
    table, exact, error = (views.image(values) for values in (*colours, errors[asked]))
    means = [statistics(found, exposure) for exposure, found in errors.items()]
    largest = [largest_error(config, (wi, wr), colours, found, exposure) for exposure, found in errors.items()]
    return MapCheck(views, table, exact, error, means, largest)


def check_table(
    interpolate: Evaluator, reference: Reference, config: Config, directions: int = 3
) -> tuple[RandomCheck, FlankCheck | None, RandomCheck | None, RelativeError]:
    """Compares a table with the reference, as `check_random` and others do, and the reference with plain sums.

    The sums are those of the window in the middle, on a few directions, each at one wavelength. The reference answers
    for all at once, because it may have to make its stack for every answer.

    interpolate, reference: as in `check_random`. config: its light, material, scene, window and exposure are read.
    directions: number of random directions of the sums; a mirror direction is added.
    Returns the errors of the table on random directions, on the flank of the specular lobe and at the border of a
    scene, and relative errors of |P|^2 of the reference.
    Raises AccuracyError where the two algorithms of the reference differ by more than 1e-9 of the mirror, because
    then no error that is measured against the reference can be trusted.
    """
    wi, wr = random_pairs(config.scene, directions, _SEED + 1)
    # the mirror direction lies within the Nyquist limits of every scan
    uvw = np.concatenate([geometry.uvw(wi, wr), [[0.0, 0.0, -1.5]]])
    nodes = trapezoid(config.light, 100.0).lambda_nm
    direction = np.arange(len(uvw))
    node = direction % len(nodes)
    windows = reference.places.count
    random, flank = random_pairs(config.scene, random_directions(windows), _SEED), _flank_pairs(config, windows)
    border = _border_pairs(config, windows)
    wi, wr = (np.concatenate(parts) for parts in zip(random, flank, border, strict=True))
    (truth,), middle = reference.xyz_and_middle([(config.light, config.material)], wi, wr, uvw, nodes)
    fast = middle[direction, node]
    direct = reference.direct(uvw, nodes[node])
    known = np.isfinite(direct)
    if np.max(np.abs(fast - direct)[known]) > _REFERENCE_TOLERANCE:
        raise AccuracyError(
            f"the two algorithms of the exact reference differ by {np.max(np.abs(fast - direct)[known]):.1e} of the "
            f"mirror, more than {_REFERENCE_TOLERANCE:g}; please report this config"
        )
    checked = relative_error(fast[known], direct[known], MIRROR_FLOOR)
    ends = np.cumsum([len(random[0]), len(flank[0])])
    found, exact = (np.split(values, ends) for values in (interpolate(wi, wr), truth))
    beside = _flank(found[1], exact[1], config, *flank) if len(flank[0]) else None
    outermost = _compared(found[2], exact[2], config, *border) if len(border[0]) else None
    return _compared(found[0], exact[0], config, *random), beside, outermost, checked
