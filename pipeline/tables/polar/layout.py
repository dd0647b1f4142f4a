"""The settings of a polar table."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.tables.settings import LayoutSettings


class PolarLayout(LayoutSettings):
    """B-splines over rings and azimuths, Chebyshev polynomials in |w|; "auto" values follow from [accuracy].

    form: "xyz", or "spectral", whose power spectrum is also fine enough for single wavelengths.
    """

    averages_windows: ClassVar[bool] = True
    holds_metals: ClassVar[bool] = True
    compresses: ClassVar[bool] = True

    layout: Literal["polar"] = "polar"
    terms: Literal["auto"] | Annotated[int, Field(ge=2, le=1000)] = "auto"
    rings: Literal["auto"] | Annotated[int, Field(ge=8, le=4096)] = "auto"
    azimuths: Literal["auto"] | Annotated[int, Field(ge=32, le=32768, multiple_of=32)] = "auto"
    w_terms: Literal["auto"] | Annotated[int, Field(ge=4, le=128, multiple_of=4)] = "auto"
    form: Literal["xyz", "spectral"] = "xyz"

    @property
    def holds_wavelengths(self) -> bool:
        """Whether the power spectrum is fine enough for single wavelengths."""
        return self.form == "spectral"
