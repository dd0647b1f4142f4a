"""The entries of polar tables in a manifest."""

import math
from importlib.resources import files
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pipeline.accuracy.checks import RelativeError
from pipeline.bundle.layout import (
    MOST_SIDE,
    SINE_ROUNDS,
    BundleLayout,
    Count,
    GridEntry,
    Scale,
    Share,
    StorageLoss,
    TableImage,
)
from pipeline.optics.colour import ColourError
from pipeline.scene.model import Scene
from pipeline.validated import Finite

Length = Annotated[float, Field(ge=1e-9, le=1e9)]
Coefficient = Annotated[float, Field(ge=-1e30, le=1e30)]
_MOST_TERMS = 1024
_MOST_LOG_ENVELOPE = 230.0


class PolarImage(TableImage):
    """The image of outputs 4 index ... 4 index + 3 in R, G, B, A, each divided by its scale."""

    layout: Literal["polar"]
    scale: Annotated[list[Scale], Field(min_length=4, max_length=4)]
    half_subnormal_share: Share | None


class PolarGridEntry(GridEntry):
    """Positions of the texels of a polar table in (u, v), and the formula of the look-up.

    basis: (outputs, 3, w_terms); None where every output is one term.
    """

    layout: Literal["polar"]
    width: Annotated[int, Field(ge=4, le=MOST_SIDE, multiple_of=2)]
    height: Annotated[int, Field(ge=2, le=4096)]
    r0: Length
    step: Length
    rho_max: Annotated[float, Field(ge=1e-9, le=2)]
    stretch: Length
    axis_rad: Annotated[float, Field(ge=-7, le=7)]
    w_terms: Annotated[int, Field(ge=1, le=_MOST_TERMS)]
    envelope_radius: Length
    envelope_exponent: Finite
    basis: list[list[list[Coefficient]]] | None
    rows: str = (
        "row i (row 0 is the first line of the image) is the ring rho = r0 sinh(i step), rho = sqrt(u^2 + v^2), "
        "step = asinh(rho_max / r0) / (height - 1); so i = asinh(rho / r0) / step"
    )
    columns: str = (
        "column j is the azimuth with atan2(v', stretch u') = 2 pi j / width, (u', v') = (u, v) turned by -axis_rad: "
        "u' = cos(axis_rad) u + sin(axis_rad) v, v' = cos(axis_rad) v - sin(axis_rad) u"
    )
    texture: str = "texel (i, j) has its centre at texture coordinate ((j + 1/2) / width, (i + 1/2) / height)"
    interpolation: str = (
        "cubic B-spline along both indices; texels are its coefficients, not values. At t = i - floor(i) the texels "
        "floor(i) - 1, + 0, + 1, + 2 have the weights (1 - t)^3 / 6, (4 - 3 t^2 (2 - t)) / 6, "
        "(4 - 3 (1 - t)^2 (1 + t)) / 6, t^3 / 6"
    )
    border: str = (
        "columns are periodic; row -i is row i after half a turn, (-i, j) = (i, j + width / 2), since the first ring "
        "is one point; beyond the last row they are mirrored, (height - 1 + i, j) = (height - 1 - i, j)"
    )
    outputs: str = "output o, interpolated, is channel o mod 4 (R, G, B, A) of table image o div 4, times its scale"
    terms: str = (
        "c[channel][k] = g(rho) sum_o output_o basis[o][channel][k], channels X, Y, Z; without a basis output o is "
        "channel o div w_terms, k = o mod w_terms. g(rho) = (1 + (rho / envelope_radius)^2)^-envelope_exponent"
    )
    w_basis: str = (
        "value[channel] = sum_k c[channel][k] T_k(x), Chebyshev's polynomials of x = 2 |w| / w_max - 1, "
        "w_max = sqrt(max(4 - rho^2, 1e-6)), x clamped to [-1, 1]"
    )

    @model_validator(mode="after")
    def is_a_grid(self) -> Self:
        """Checks that the step leads to the last ring, and that the envelope fits a double.

        Raises ValueError, which pydantic reports.
        """
        expected = math.asinh(self.rho_max / self.r0) / (self.height - 1)
        if not math.isclose(self.step, expected, rel_tol=1e-9):
            raise ValueError(f"step is {self.step:g}, but r0, rho_max and height give {expected:g}")
        if abs(self.envelope_exponent) * math.log1p((2.0 / self.envelope_radius) ** 2) > _MOST_LOG_ENVELOPE:
            raise ValueError("envelope_radius and envelope_exponent give an envelope beyond 1e100 or below 1e-100")
        return self

    def contradictions(self, images: int, scene: Scene | None) -> list[str]:
        """Compares the basis with the outputs that the images hold, and the last ring with the scene."""
        from pipeline.scene.visited import rho_max

        found: list[str] = []
        if not self._basis_fits(images):
            found.append(f"grid: {images} tables do not hold the outputs that basis and w_terms need")
        # what cameras see is found with files that the bundle does not hold
        if (scene is None or scene.cameras is None) and abs(self.rho_max - rho_max(scene)) > SINE_ROUNDS:
            found.append(f"grid.rho_max is {self.rho_max:g}, but the scene reaches {rho_max(scene):g}")
        return found

    def _basis_fits(self, images: int) -> bool:
        """Tells whether the basis is (outputs, 3, w_terms) for the outputs that the images hold."""
        if self.basis is None:
            return 4 * images == 3 * self.w_terms
        shapes = {(len(output), *(len(channel) for channel in output)) for output in self.basis}
        return len(self.basis) == 4 * images and shapes == {(3, *3 * (self.w_terms,))}


class PolarLoss(StorageLoss):
    """The error of a polar table in few textures or half floats, on random directions.

    textures: number of RGBA textures; `most_textures` would hold the whole table. error: of the stored textures
    against the exact sum. added: against the table as baked. added_in_mirror: the same in the mirror directions of
    the lights, at 1 RU. y_in_mirror: relative errors of Y there. mirror_kept: whether `added_in_mirror` is on average
    below the just noticeable difference, 2.3, and `y_in_mirror` nowhere above 0.05. subnormal_share: of all values,
    those that half floats store with fewer than 11 bits; None for float.
    """

    layout: Literal["polar"]
    directions: Count
    textures: Count
    most_textures: Count
    error: ColourError
    added: ColourError
    added_in_mirror: ColourError
    y_in_mirror: RelativeError
    mirror_kept: bool
    subnormal_share: Share | None


LAYOUT = BundleLayout(
    image=PolarImage,
    grid=PolarGridEntry,
    loss=PolarLoss,
    shader=files("kernels").joinpath("shaders", "polar.glsl"),
)
