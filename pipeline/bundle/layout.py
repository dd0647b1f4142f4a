"""The part of a table layout in a bundle: the classes of its entries in the manifest, its shader, and its tables."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pipeline.scene.model import Scene
from pipeline.validated import Validated

if TYPE_CHECKING:
    from pipeline.accuracy.certificate import Certificate

Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1, le=2**31)]
# a power of two that fits values into half floats, at most a float32's largest number
Scale = Annotated[float, Field(ge=1e-60, le=1e60)]
Error = Annotated[float, Field(ge=0, allow_inf_nan=False)]
MOST_SIDE = 32768
# another machine may round the sine of a scene's angle differently
SINE_ROUNDS = 1e-9

Constant = bool | int | float | list[int]
Pixels = NDArray[np.floating[Any]]
# lists what is impossible about the pixels of one image: (rows, columns) by channel
TexelCheck = Callable[[Mapping[str, Pixels]], list[str]]


class Image(Validated):
    """An EXR of the bundle; row 0 is its first line."""

    file: Annotated[str, Field(pattern=r"^(tables|maps)/[A-Za-z0-9_.+-]+\.exr$")]
    width: Annotated[int, Field(ge=1, le=MOST_SIDE)]
    height: Annotated[int, Field(ge=1, le=MOST_SIDE)]
    channels: Annotated[list[str], Field(min_length=1, max_length=4)]
    pixel_type: Literal["float", "half"]


class TableImage(Image):
    """An image of a table. Each layout has a class of its own, which adds the `scale` of its texels."""

    layout: str
    index: Annotated[int, Field(ge=0)]


class GridEntry(Validated):
    """Positions and meaning of the texels. Each layout has a class of its own."""

    layout: str
    width: int
    height: int

    def contradictions(self, images: int, scene: Scene | None) -> list[str]:  # noqa: ARG002
        """Lists contradictions with the number of the table's images and with the scene of the config.

        Each names its key, from `grid` on.
        """
        return []

    def texel_check(self, scene: Scene | None) -> TexelCheck:  # noqa: ARG002
        """Returns the check of each of the table's images, whose texels are finite numbers."""
        return lambda _channels: []


class StorageLoss(Validated):
    """The error that the storage of a table adds. Each layout has a class of its own."""

    layout: str


@dataclass(frozen=True)
class BundleLayout:
    """The part of a layout in every bundle.

    image, grid, loss: classes of its entries in the manifest.
    shader: the look-up in GLSL, whose global constants `Prepared.constants` replaces.
    """

    image: type[TableImage]
    grid: type[GridEntry]
    loss: type[StorageLoss]
    shader: Traversable


@dataclass(frozen=True)
class Prepared:
    """A table prepared for a bundle: the parts of the bundle that depend on the layout.

    holds: name of the quantity in the tables. conventions: its definition, for the manifest.
    evaluation: the formula of the look-up, for the manifest. grid: positions and meaning of the texels.
    images: the tables, `count` in number, made one by one as they are needed: each image's entry in the manifest, and
        its pixels (rows, columns, RGBA).
    plan, certificate: of the table. loss: the error that storage adds; None where nothing is lost.
    rho_max: sqrt(u^2 + v^2) up to which the table was computed.
    constants: values of the constants of the layout's shader, by name.
    """

    holds: str
    conventions: dict[str, str]
    evaluation: str
    grid: GridEntry
    images: Iterable[tuple[TableImage, Pixels]]
    count: int
    plan: dict[str, Any]
    certificate: "Certificate"
    loss: StorageLoss | None
    rho_max: float
    constants: dict[str, Constant]
