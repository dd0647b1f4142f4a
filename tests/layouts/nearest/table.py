"""The settings of [table], the nodes and the look-up."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pipeline.arrays import Array
from pipeline.optics.brdf import Radiometry
from pipeline.tables.settings import LayoutSettings

STEP_NM = 1.0


class NearestLayout(LayoutSettings):
    """XYZ at the nearest of `nodes` x `nodes` points of (u, v)."""

    layout: Literal["nearest"]
    nodes: Annotated[int, Field(ge=3, le=201)] = 21


def positions(nodes: int) -> Array:
    """Lists (u, v, w) of all nodes (nodes^2, 3), v by v, at the largest |w| of a pair of directions."""
    u, v = np.meshgrid(axis := np.linspace(-2.0, 2.0, nodes), axis)
    w = -np.sqrt(np.maximum(4.0 - u**2 - v**2, 1e-3))
    return np.stack([u, v, w], axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class NearestTable:
    """XYZ / (C cos ti) at the nodes, float32 (v, u, 3)."""

    values: np.ndarray

    @property
    def nbytes(self) -> int:
        return self.values.nbytes

    def look_up(self, uvw: Array) -> Array:
        column, row = np.rint((uvw[:, :2].T + 2.0) / 4.0 * (len(self.values) - 1)).astype(int)
        return self.values[row, column].astype(float)

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        return radiometry.direction_factor(wi, wr)
