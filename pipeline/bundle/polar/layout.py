"""The entries of polar tables in a manifest."""

import itertools
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
from pipeline.bundle.polar.atlas import ABSENT
from pipeline.diffraction.tiles import AZIMUTHS, RINGS
from pipeline.optics.colour import ColourError
from pipeline.optics.geometry import RHO_MAX
from pipeline.scene.model import Scene
from pipeline.validated import Finite, Validated

Length = Annotated[float, Field(ge=1e-9, le=1e9)]
Coefficient = Annotated[float, Field(ge=-1e30, le=1e30)]
_MOST_TERMS = 1024
_MOST_LOG_ENVELOPE = 230.0
_ROUNDED = 1e-9


class PolarImage(TableImage):
    """The image of outputs 4 index ... 4 index + 3 in R, G, B, A, each divided by its scale."""

    layout: Literal["polar"]
    scale: Annotated[list[Scale], Field(min_length=4, max_length=4)]
    half_subnormal_share: Share | None


class PolarGridEntry(GridEntry):
    """Positions of the texels of a polar table in (u, v), and the formula of the look-up.

    width, height: of the images. every: of each band, which of its azimuths it keeps. starts: of each band and
    sector, row * width + column of its first texel in the images, -1 where it is absent. covered_share: of the disc
    rho <= rho_max, the part whose tiles are present.
    basis: (outputs, 3, w_terms); None where every output is one term.
    """

    layout: Literal["polar"]
    width: Annotated[int, Field(ge=1, le=MOST_SIDE)]
    height: Annotated[int, Field(ge=1, le=MOST_SIDE)]
    rings: Annotated[int, Field(ge=2, le=4096)]
    azimuths: Annotated[int, Field(ge=4, le=MOST_SIDE, multiple_of=2)]
    every: list[Annotated[int, Field(ge=1, le=4)]]
    starts: list[list[Annotated[int, Field(ge=ABSENT, le=MOST_SIDE**2)]]]
    covered_share: Share
    r0: Length
    step: Length
    rho_max: Annotated[float, Field(ge=1e-9, le=2)]
    stretch: Length
    axis_rad: Annotated[float, Field(ge=-7, le=7)]
    w_terms: Annotated[int, Field(ge=1, le=_MOST_TERMS)]
    envelope_radius: Length
    envelope_exponent: Finite
    basis: list[list[list[Coefficient]]] | None
    ring: str = (
        "ring i is rho = r0 sinh(i step), rho = sqrt(u^2 + v^2), so i = asinh(rho / r0) / step; the last lies "
        "beyond rho_max, which is the largest rho that is looked up, or at 2"
    )
    azimuth: str = (
        "azimuth j has atan2(v', stretch u') = 2 pi j / azimuths, (u', v') = (u, v) turned by -axis_rad: "
        "u' = cos(axis_rad) u + sin(axis_rad) v, v' = cos(axis_rad) v - sin(axis_rad) u. A ring of band b = i div 16 "
        "has its knots at every e-th azimuth, e = every[b]: knot c is azimuth c e, of azimuths / e"
    )
    tiles: str = (
        "rings 16 b + x and knots c with c e div 128 = s are tile (b, s). The texel of its ring 16 b + x and of its "
        "knot y, counted from its first, is number starts[b][s] + x width + y of the image, line by line from the "
        "first; starts[b][s] = -1: the tile is absent, nothing is known there"
    )
    interpolation: str = (
        "cubic B-spline along rings and knots; texels are its coefficients, not values. At t = i - floor(i) those of "
        "floor(i) - 1, + 0, + 1, + 2 have the weights (1 - t)^3 / 6, (4 - 3 t^2 (2 - t)) / 6, "
        "(4 - 3 (1 - t)^2 (1 + t)) / 6, t^3 / 6. Each of the four rings has its own knots about j / e"
    )
    border: str = (
        "knots are periodic; ring -i is ring i after half a turn, (-i, c) = (i, c + azimuths / (2 e)), since the "
        "first ring is one point; beyond the last ring they are mirrored, (rings - 1 + i, c) = (rings - 1 - i, c)"
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
        """Checks that the last ring lies at rho_max or beyond, that tiles fit the images, and the envelope a double.

        Raises ValueError, which pydantic reports.
        """
        last = (math.asinh(rho / self.r0) / (self.rings - 1) for rho in (self.rho_max, RHO_MAX))
        least, most = last
        if not least * (1.0 - _ROUNDED) <= self.step <= most * (1.0 + _ROUNDED):
            raise ValueError(f"step is {self.step:g}, but r0, rho_max and rings allow {least:g} to {most:g}")
        self._check_tiles()
        if abs(self.envelope_exponent) * math.log1p((2.0 / self.envelope_radius) ** 2) > _MOST_LOG_ENVELOPE:
            raise ValueError("envelope_radius and envelope_exponent give an envelope beyond 1e100 or below 1e-100")
        return self

    def _check_tiles(self) -> None:
        """Raises ValueError where the tiles are not those of the grid or leave the images."""
        bands, sectors = math.ceil(self.rings / RINGS), math.ceil(self.azimuths / AZIMUTHS)
        if len(self.every) != bands or [len(band) for band in self.starts] != [sectors] * bands:
            raise ValueError(f"every and starts are not those of {bands} bands and {sectors} sectors")
        if max(self.every) > 1 and (self.azimuths % AZIMUTHS or 3 in self.every):
            raise ValueError(f"every is 1, or 2 or 4 where azimuths is a multiple of {AZIMUTHS}")
        for (band, every), sector in itertools.product(enumerate(self.every), range(sectors)):
            start = self.starts[band][sector]
            row, column = divmod(start, self.width)
            rows = min(RINGS, self.rings - RINGS * band)
            columns = min(AZIMUTHS, self.azimuths - AZIMUTHS * sector) // every
            if start != ABSENT and (row + rows > self.height or column + columns > self.width):
                raise ValueError(f"starts[{band}][{sector}] is {start}, which leaves the images")

    def contradictions(self, images: int, scene: Scene | None) -> list[str]:
        """Compares the basis with the outputs that the images hold, and rho_max with the scene."""
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


class MirrorLoss(Validated):
    """The error that storage adds in the mirror directions of the lights.

    added: at 1 RU. y: relative errors of Y. kept: whether `added` is on average below the just noticeable difference,
    2.3, and `y` nowhere above 0.05.
    """

    added: ColourError
    y: RelativeError
    kept: bool


class PolarLoss(StorageLoss):
    """The error of a polar table in few textures or half floats, on random directions.

    textures: number of RGBA textures; `most_textures` would hold the whole table. error: of the stored textures
    against the exact sum. added: against the table as baked. mirror: the same in the mirror directions of the lights;
    None where no tile holds them. subnormal_share: of all values, those that half floats store with fewer than 11
    bits; None for float.
    """

    layout: Literal["polar"]
    directions: Count
    textures: Count
    most_textures: Count
    error: ColourError
    added: ColourError
    mirror: MirrorLoss | None
    subnormal_share: Share | None


LAYOUT = BundleLayout(
    image=PolarImage,
    grid=PolarGridEntry,
    loss=PolarLoss,
    shader=files("kernels").joinpath("shaders", "polar.glsl"),
)
