"""The entries of the paper's tables in a manifest."""

from collections.abc import Mapping
from importlib.resources import files
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pipeline.accuracy.checks import RelativeError
from pipeline.bundle.layout import (
    SINE_ROUNDS,
    BundleLayout,
    Count,
    Error,
    GridEntry,
    Pixels,
    Scale,
    Share,
    StorageLoss,
    TableImage,
    TexelCheck,
)
from pipeline.scene.model import Scene
from pipeline.validated import Positive


class TaylorImage(TableImage):
    """The image of I_p for p = `index`: R, G, B hold X, Y, Z of I_p / scale; A is 1 where computed, else 0."""

    layout: Literal["taylor"]
    scale: Scale
    half_subnormal_share: Share | None


class TaylorGridEntry(GridEntry):
    """Positions of the texels of a Taylor table in (u, v)."""

    layout: Literal["taylor"]
    width: Annotated[int, Field(ge=3, le=4001)]
    height: Annotated[int, Field(ge=3, le=4001)]
    power: Annotated[float, Field(ge=1, le=9)]
    u_max: Annotated[float, Field(ge=2, le=2)]
    columns: str = "u grows with the column, from -u_max at column 0"
    rows: str = "v grows with the row, from -u_max at row 0 (the first line of the image)"
    node: str = "u = u_max |t|^a sign(t), a = power; v likewise"
    texel: str = "texel i of n lies at t = 2 i / (n - 1) - 1"
    texture: str = "texel i of n has its centre at texture coordinate (i + 1/2) / n"
    interpolation: str = (
        "bilinear between texels, in the index i = (t + 1) (n - 1) / 2, t = sign(u) (|u| / u_max)^(1/a)"
    )

    def texel_check(self, scene: Scene | None) -> TexelCheck:
        """Returns the check of an image's A: 0 or 1, and 1 where the scene reaches."""
        reached = self._reached(scene)

        def check(channels: Mapping[str, Pixels]) -> list[str]:
            computed = channels["A"] == 1.0
            if not np.all(computed | (channels["A"] == 0.0)):
                return ["A is neither 0 nor 1"]
            if np.any(reached & ~computed):
                return ["A says that a texel was not computed, but the scene reaches it"]
            return []

        return check

    def _reached(self, scene: Scene | None) -> NDArray[np.bool_]:
        """Computes the nodes that a scene needs, bool (v, u)."""
        from pipeline.tables.taylor import grid
        from pipeline.tables.taylor.table import reachable_nodes

        # another machine reads no files for a bundle
        if scene is not None and not scene.is_portable:
            return np.zeros((self.width, self.width), bool)
        if scene is not None:
            views = scene.views.model_copy(update={"theta_max_deg": scene.views.theta_max_deg * (1.0 - SINE_ROUNDS)})
            scene = scene.model_copy(update={"views": views})
        return reachable_nodes(grid.nodes(self.width, self.power), scene)


class TaylorLoss(StorageLoss):
    """The error that half floats add to a Taylor table, against the table in float32.

    directions: number of random directions. relative_error_of_y: on the "random" directions and on the "mirror"
    directions of their lights (where a scene has them), of Y over that of a mirror, relative to at least `floor`.
    largest_delta_e: CIELAB error on both. subnormal_share: of the computed values, those with fewer than 11 bits.
    """

    layout: Literal["taylor"]
    directions: Count
    relative_error_of_y: dict[str, RelativeError]
    floor: Positive
    exposure_ru: Positive
    largest_delta_e: Error
    subnormal_share: Share


LAYOUT = BundleLayout(
    image=TaylorImage,
    grid=TaylorGridEntry,
    loss=TaylorLoss,
    shader=files("kernels").joinpath("shaders", "taylor.glsl"),
)
