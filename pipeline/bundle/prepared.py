"""A table prepared for a bundle: the parts of the bundle that depend on the layout."""

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
    """The part of a layout in a bundle.

    holds: name of the quantity in the tables. conventions: its definition, for the manifest.
    evaluation: the formula of the look-up, for the manifest. grid: positions and meaning of the texels.
    images: the tables, `count` in number, made one by one as they are needed.
    plan, certificate: of the table. loss: the error that storage adds; None where nothing is lost.
    rho_max: sqrt(u^2 + v^2) up to which the table was computed.
    constants: values of the constants of the layout's shader in kernels/shaders/.
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
    rho_max: float
    constants: dict[str, bool | int | float]
