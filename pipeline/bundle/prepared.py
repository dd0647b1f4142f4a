"""A table made ready for a bundle: everything there that depends on its layout."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.accuracy.certificate import Certificate
from pipeline.bundle.manifest import Grid, StorageLoss, TableImage

# an image's entry in the manifest, and its pixels (rows, columns, RGBA)
Texture = tuple[TableImage, NDArray[np.floating[Any]]]


@dataclass(frozen=True)
class Prepared:
    """What one layout brings to a bundle.

    holds: what the tables' numbers are called, and `conventions` what they mean. images: made one by one as they are
    asked for, `count` of them. constants: those of the layout's shader, kernels/shaders/.
    """

    holds: str
    conventions: dict[str, str]
    evaluation: str
    grid: Grid
    images: Iterable[Texture]
    count: int
    plan: dict[str, Any]
    certificate: Certificate
    loss: StorageLoss | None
    constants: dict[str, bool | int | float]
