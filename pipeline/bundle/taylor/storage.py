"""Storage of the paper's tables: a scale for each I_p, and the error that half floats add on random directions."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.accuracy.checks import MIRROR_FLOOR, RANDOM_DIRECTIONS, relative_error
from pipeline.arrays import Array
from pipeline.bundle import half
from pipeline.bundle.taylor.layout import TaylorLoss
from pipeline.config.models import Config
from pipeline.errors import AccuracyError
from pipeline.optics.colour import delta_e
from pipeline.scene.pairs import random_pairs
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.taylor.table import TaylorTable

_EXPOSURE_RU, _SEED = 7500.0, 20141101
# largest 99th percentile of the relative error of Y. Measured at 501 x 501: 0.07 and 0.2 % (random, mirror
# directions) for heights of 0.37 um, 8 and 4000 % for 0.7 um. The median means little, since most are dark
_MOST_ERROR = 0.1
# number of planes that are gathered from (v, u, channel, p) at a time: 16 float32 are a cache line
_PLANES_AT_ONCE = 16


def scales(table: TaylorTable, precision: str) -> Array:
    """Computes the scale of each p (P,), by which its texels are divided.

    precision: "float" gives 1; "half" gives powers of two that fit the peaks into half floats.
    """
    peak = np.max(np.abs(table.values), axis=(0, 1, 2)).astype(float)
    return half.scales(peak) if precision == "half" else np.ones_like(peak)


def planes(table: TaylorTable, scale: Array, precision: str) -> Iterator[NDArray[np.floating[Any]]]:
    """Yields the RGBA texels (v, u, 4) of p = 0, 1, ...: X, Y, Z of I_p / scale_p, and 1 where computed, else 0.

    scale: (P,). precision: "float" (float32) or "half" (float16).
    """
    kind = np.float16 if precision == "half" else np.float32
    rgba = np.empty((*table.computed.shape, 4), dtype=kind)
    rgba[..., 3] = table.computed
    for first in range(0, len(scale), _PLANES_AT_ONCE):
        block = np.moveaxis(table.values[..., first : first + _PLANES_AT_ONCE], -1, 0).copy()
        for i, plane in enumerate(block):
            rgba[..., :3] = plane / np.float32(scale[first + i])
            yield rgba


def planes_bytes(resolution: int) -> int:
    """Computes the memory of `planes`, bytes: those that are gathered at a time, and an image in three forms."""
    return resolution**2 * (3 * 4 * _PLANES_AT_ONCE + 3 * 16)


def measuring_bytes(table_bytes: int) -> int:
    """Computes the memory in which `measure` works, bytes.

    The table as it is read back, and the table scaled, in half floats and back again.
    """
    return round(4.5 * table_bytes)


def subnormal_shares(table: TaylorTable, scale: Array) -> Array:
    """Computes the share of values of each p (P,) that half floats store with fewer than 11 bits, or as 0."""
    stored = table.values[table.computed] / scale.astype(np.float32)
    return np.asarray(np.mean(half.subnormal(stored), axis=(0, 1)))


def in_half(table: TaylorTable, scale: Array) -> TaylorTable:
    """Returns the table as it is read back from half floats; scale: (P,)."""
    factor = scale.astype(np.float32)
    return replace(table, values=(table.values / factor).astype(np.float16).astype(np.float32) * factor)


def measure(config: Config, table: TaylorTable, scale: Array) -> TaylorLoss:
    """Compares the table in half floats with the table in float32.

    The directions are random ones and as many mirror directions: random ones miss the narrow lobes that hold nearly
    all light of a periodic surface, and |w|, and with it the cancellation, is largest in the mirror direction.

    config: its light, material and scene are read. table: the table. scale: (P,).
    Raises AccuracyError where the 99th percentile of the relative error of Y exceeds 10 %.
    """
    wi, wr = random_pairs(config.scene, RANDOM_DIRECTIONS, _SEED)
    rounded = in_half(table, scale)
    errors, worst, unit = {}, 0.0, config.radiometry.unit
    for name, views in (("random", wr), ("mirror", wi * [-1.0, -1.0, 1.0])):
        before, after = (table_evaluator(t, config.radiometry)(wi, views) for t in (table, rounded))
        known = np.isfinite(before[:, 1])  # a scene may exclude the mirror directions of its lights
        mirror = config.radiometry.mirror_luminance(wi, views)[known]
        before, after = before[known], after[known]
        if known.any():
            errors[name] = relative_error(after[:, 1] / mirror, before[:, 1] / mirror, MIRROR_FLOOR)
            worst = max(worst, float(np.max(delta_e(after / unit, before / unit, _EXPOSURE_RU))))
    loss = TaylorLoss(
        layout="taylor",
        directions=len(wi),
        relative_error_of_y=errors,
        floor=MIRROR_FLOOR,
        exposure_ru=_EXPOSURE_RU,
        largest_delta_e=worst,
        subnormal_share=float(np.mean(subnormal_shares(table, scale))),
    )
    _refuse_lost_digits(loss)
    return loss


def _refuse_lost_digits(loss: TaylorLoss) -> None:
    tail = {name: error.percentile_99 for name, error in loss.relative_error_of_y.items()}
    if all(error <= _MOST_ERROR for error in tail.values()):
        return
    errors = ", ".join(
        f"{100 * error.median:.3g} % in the median and {100 * error.percentile_99:.3g} % at the 99th "
        f"percentile over {loss.directions} {name} directions"
        for name, error in loss.relative_error_of_y.items()
    )
    raise AccuracyError(
        'publish.precision = "half" loses the digits of this series, because its terms cancel: Y changes by '
        f"{errors} ({100 * _MOST_ERROR:g} % allowed), colours by up to dE {loss.largest_delta_e:.3g} at "
        f'{loss.exposure_ru:g} RU. Set publish.precision = "float"'
    )
