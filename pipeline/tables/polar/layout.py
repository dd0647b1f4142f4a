"""The settings of a polar table."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.optics.light import FINE_STEP_NM
from pipeline.validated import Validated


class PolarLayout(Validated):
    """Rings and azimuths of splines, Chebyshev polynomials in |w|; what is "auto" follows from [accuracy].

    form: "spectral" makes the power spectrum fine enough to answer single wavelengths, beside the XYZ of "xyz".
    """

    # |P|^2 is the mean over the windows that the scan holds, and a metal's reflectance is inside the table
    averages_windows: ClassVar[bool] = True
    holds_metals: ClassVar[bool] = True
    # a bundle may keep it in few textures
    compresses: ClassVar[bool] = True

    layout: Literal["polar"] = "polar"
    terms: Literal["auto"] | Annotated[int, Field(ge=2, le=1000)] = "auto"
    rings: Literal["auto"] | Annotated[int, Field(ge=8, le=4096)] = "auto"
    azimuths: Literal["auto"] | Annotated[int, Field(ge=32, le=32768, multiple_of=32)] = "auto"
    w_terms: Literal["auto"] | Annotated[int, Field(ge=4, le=128, multiple_of=4)] = "auto"
    form: Literal["xyz", "spectral"] = "xyz"

    @property
    def integral_step_nm(self) -> float | None:
        """Step, nm, of the spectral integral; None where every ring has its own."""
        return None

    @property
    def mean_step_nm(self) -> float:
        """Step, nm, of the means over wavelength that are taken outside the spectral integral."""
        return FINE_STEP_NM
