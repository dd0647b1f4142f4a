"""The settings of a polar table."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.optics.light import FINE_STEP_NM
from pipeline.validated import Validated


class PolarLayout(Validated):
    """B-splines over rings and azimuths, Chebyshev polynomials in |w|; "auto" values follow from [accuracy].

    form: "xyz", or "spectral", whose power spectrum is also fine enough for single wavelengths.
    """

    # |P|^2 is the mean over all windows of the scan, and a metal's reflectance is part of the table
    averages_windows: ClassVar[bool] = True
    holds_metals: ClassVar[bool] = True
    # a bundle may compress the table to few textures
    compresses: ClassVar[bool] = True

    layout: Literal["polar"] = "polar"
    terms: Literal["auto"] | Annotated[int, Field(ge=2, le=1000)] = "auto"
    rings: Literal["auto"] | Annotated[int, Field(ge=8, le=4096)] = "auto"
    azimuths: Literal["auto"] | Annotated[int, Field(ge=32, le=32768, multiple_of=32)] = "auto"
    w_terms: Literal["auto"] | Annotated[int, Field(ge=4, le=128, multiple_of=4)] = "auto"
    form: Literal["xyz", "spectral"] = "xyz"

    @property
    def integral_step_nm(self) -> float | None:
        """Step of the spectral integral, nm; None, since every ring has its own."""
        return None

    @property
    def mean_step_nm(self) -> float:
        """Step of the means over wavelength that are taken outside the spectral integral, nm."""
        return FINE_STEP_NM
