"""Storage of a polar table: number of textures, precision, and the error that they add on random directions."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.accuracy.certificate import refuse_clamping
from pipeline.accuracy.checks import MIRROR_FLOOR, RandomCheck, check_random, random_directions, relative_error
from pipeline.arrays import Array
from pipeline.bundle import half
from pipeline.bundle.polar import atlas
from pipeline.bundle.polar.atlas import Atlas
from pipeline.bundle.polar.layout import MirrorLoss, PolarLoss
from pipeline.config.models import Config, Publish
from pipeline.diffraction.reference import Reference
from pipeline.errors import AccuracyError
from pipeline.optics.colour import ColourError, delta_e
from pipeline.scene.pairs import random_pairs
from pipeline.tables.evaluate import interpolator, table_evaluator
from pipeline.tables.polar.compression import (
    CHANNELS,
    Textures,
    compress,
    flattened,
    most_textures,
    weighting_bytes,
    whole,
)
from pipeline.tables.polar.table import PolarTable

_SEED = 20160816
_MIRROR_EXPOSURE_RU = 1.0
# the just noticeable CIELAB difference (Mahy, Van Eycken & Oosterlinck 1994)
_NOTICEABLE_DELTA_E = 2.3
# largest relative error of Y in a mirror direction: colours clip there, which hides errors from CIELAB
_MIRROR_KEPT = 0.05


@dataclass(frozen=True)
class Stored:
    """Textures as they are stored in files.

    values: float32 or float16 (outputs, height, width) of the picture, divided by `scale`. scale: (outputs,).
    atlas: the places of tiles in the picture. textures: as they are read back.
    """

    values: NDArray[np.floating[Any]]
    scale: Array
    atlas: Atlas
    textures: Textures

    @property
    def nbytes(self) -> int:
        """Bytes of the textures, as stored and as read back."""
        return self.values.nbytes + self.textures.nbytes

    @property
    def subnormal(self) -> NDArray[np.bool_]:
        """Marks the values that half floats store with fewer than 11 bits."""
        return half.subnormal(self.values)


def store(textures: Textures, precision: str) -> Stored:
    """Stores textures at a precision: "float" as they are, "half" divided by an envelope and a scale per output."""
    places = atlas.place(textures.tiles)
    if precision == "float":
        return Stored(places.packed(textures.values), np.ones(textures.values.shape[1]), places, textures)
    flat = flattened(textures)
    picture = places.packed(flat.values)
    scale = half.scales(np.max(np.abs(picture), axis=(1, 2)).astype(np.float64))
    values = (picture / scale.astype(np.float32)[:, None, None]).astype(np.float16)
    return Stored(values, scale, places, replace(flat, values=read_back(places, values, scale)))


def read_back(places: Atlas, values: NDArray[np.floating[Any]], scale: Array) -> NDArray[np.float32]:
    """Returns the coefficients (rings, outputs, azimuths) of a picture; parameters as in `Stored`."""
    return places.unpacked(values.astype(np.float32) * scale.astype(np.float32)[:, None, None])


def is_whole(config: Config) -> bool:
    """Tells whether [publish] keeps every digit of a table: all textures, in float."""
    return config.publish.precision == "float" and config.publish.textures in ("auto", "full")


def mean_error(random: RandomCheck, config: Config) -> float:
    """Returns the mean CIELAB error on random directions at the exposure of [accuracy]."""
    return next(error.mean for error in random.colour if error.exposure_ru == config.accuracy.exposure_ru)


def choose(config: Config, table: PolarTable, reference: Reference) -> tuple[Stored, PolarLoss, RandomCheck]:
    """Stores a table as [publish] asks, and measures the error that this adds.

    "auto" in half floats takes the fewest textures whose error is within the budget, on the directions of this choice
    and on those of the certificate, or all if no number keeps it.

    config: its [publish], [accuracy], light, material and scene are read. table: the table.
    reference: the exact reference.
    Returns the stored textures, their error, and the check of their certificate.
    Raises AccuracyError where an error, or the colour difference of negative values that are set to 0, exceeds a
    budget that the config sets.
    """
    measure, last = _Measure(config, table, reference), None
    for count in _candidates(config.publish.textures, most_textures(table)):
        last = store(_textures(table, count, config), config.publish.precision)
        loss = measure(last)
        if loss.error.mean > config.budget_delta_e:
            continue
        random = check_random(interpolator(last.textures, config.radiometry), reference, config)
        if mean_error(random, config) <= config.budget_delta_e:
            break
    else:
        assert last is not None
        random = check_random(interpolator(last.textures, config.radiometry), reference, config)
    _refuse_missed_budget(config, loss, mean_error(random, config))
    refuse_clamping(random, config)
    return last, loss, random


def choosing_bytes(table_bytes: int, w_terms: int, publish: Publish) -> int:
    """Computes the memory in which `choose` works, bytes.

    There are, at most in the size of the table, the compressed textures, their samples with three temporaries, the
    flattened coefficients, the stored values and those read back, and the table that is reconstructed; and the
    Chebyshev polynomials of the directions that weight them.
    """
    most = 3 * w_terms // CHANNELS
    share = 1.0 if isinstance(publish.textures, str) else min(publish.textures, most) / most
    return round((7.0 * share + 1.0) * table_bytes) + weighting_bytes(w_terms)


def _candidates(asked: str | int, most: int) -> Iterable[int]:
    """Lists the numbers of textures to try, in order."""
    if asked == "auto":
        return range(1, most + 1)
    return [most] if isinstance(asked, str) else [min(asked, most)]


def _textures(table: PolarTable, count: int, config: Config) -> Textures:
    return whole(table) if count == most_textures(table) else compress(table, count, config.scene)


@dataclass(frozen=True)
class _Known:
    """Unit vectors wi, wr (n, 3), and XYZ (n, 3) of the table there."""

    wi: Array
    wr: Array
    xyz: Array


class _Measure:
    """Compares stored textures with the exact sum and with the table itself, on random directions."""

    def __init__(self, config: Config, table: PolarTable, reference: Reference) -> None:
        self._config, self._most, self._unit = config, most_textures(table), config.radiometry.unit
        self._evaluate_table = table_evaluator(table, config.radiometry)
        wi, wr = random_pairs(config.scene, random_directions(reference.places.count), _SEED)
        self._random, self._mirror = self._known(wi, wr), self._known(wi, wi * [-1.0, -1.0, 1.0])
        self._truth = reference.xyz(config.light, config.material, self._random.wi, self._random.wr)

    def _known(self, wi: Array, wr: Array) -> _Known:
        """Returns the directions that covered tiles hold, with their colours."""
        xyz = self._evaluate_table(wi, wr)
        known = np.isfinite(xyz).all(axis=1)
        return _Known(wi[known], wr[known], xyz[known])

    def __call__(self, stored: Stored) -> PolarLoss:
        after = self._evaluate(stored.textures, self._random)
        exposure = self._config.accuracy.exposure_ru
        in_half = self._config.publish.precision == "half"
        return PolarLoss(
            layout="polar",
            directions=len(after),
            textures=stored.textures.count,
            most_textures=self._most,
            error=self._errors(after, self._truth, exposure),
            added=self._errors(after, self._random.xyz, exposure),
            mirror=self._mirror_loss(stored) if len(self._mirror.wi) else None,
            subnormal_share=float(np.mean(stored.subnormal)) if in_half else None,
        )

    def _mirror_loss(self, stored: Stored) -> MirrorLoss:
        before, after = self._mirror.xyz, self._evaluate(stored.textures, self._mirror)
        unit = self._config.radiometry.mirror_luminance(self._mirror.wi, self._mirror.wr)
        added = self._errors(after, before, _MIRROR_EXPOSURE_RU)
        y = relative_error(after[:, 1] / unit, before[:, 1] / unit, MIRROR_FLOOR)
        return MirrorLoss(added=added, y=y, kept=added.mean <= _NOTICEABLE_DELTA_E and y.maximum <= _MIRROR_KEPT)

    def _evaluate(self, textures: Textures, directions: _Known) -> Array:
        return table_evaluator(textures, self._config.radiometry)(directions.wi, directions.wr)

    def _errors(self, found: Array, truth: Array, exposure_ru: float) -> ColourError:
        error = delta_e(found / self._unit, truth / self._unit, exposure_ru)
        return ColourError(
            exposure_ru=exposure_ru,
            mean=float(error.mean()),
            percentile_99=float(np.percentile(error, 99)),
            maximum=float(error.max()),
        )


def _refuse_missed_budget(config: Config, loss: PolarLoss, certified: float) -> None:
    budget, measured = config.accuracy.delta_e, max(loss.error.mean, certified)
    if budget is None or measured <= budget:
        return
    if loss.textures < loss.most_textures:
        remedy = f"publish.textures above {loss.textures}, of {loss.most_textures}"
    elif config.publish.precision == "half":
        remedy = 'publish.precision = "float"'
    else:
        remedy = "a larger accuracy.delta_e"
    raise AccuracyError(
        f'{loss.textures} textures of publish.precision = "{config.publish.precision}" miss the budget: on '
        f"{loss.directions} random directions the mean CIELAB error at {loss.error.exposure_ru:g} RU is "
        f"{measured:.3g} ({loss.added.mean:.3g} from the table as baked), and accuracy.delta_e allows "
        f"{budget:g}. Set {remedy}"
    )
