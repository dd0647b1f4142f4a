"""The settings of the paper's table."""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from pipeline.diffraction.expansion import LARGEST_TOLERANCE
from pipeline.tables.settings import LayoutSettings


class TaylorLayout(LayoutSettings):
    """The paper's table: I_p on `resolution` x `resolution` nodes 2 |t|^power sign(t)."""

    layout: Literal["taylor"]
    resolution: Annotated[int, Field(ge=3, le=4001)] = 501
    power: Annotated[float, Field(ge=1, le=9)] = 5.0
    terms: Literal["auto"] | Annotated[int, Field(ge=1, le=200)] = "auto"
    step_nm: Annotated[float, Field(ge=0.1, le=50)] = 5.0
    tolerance: Annotated[float, Field(ge=1e-7, le=LARGEST_TOLERANCE)] = 1e-4

    @field_validator("resolution")
    @classmethod
    def odd(cls, value: int) -> int:
        """Checks that (u, v) = (0, 0) is a node. Raises ValueError, which pydantic reports."""
        if value % 2 == 0:
            raise ValueError(f"expected an odd number, so that (u, v) = (0, 0) is a node, got {value}")
        return value

    @property
    def integral_step_nm(self) -> float | None:
        """Step of the spectral integral, nm."""
        return self.step_nm

    @property
    def mean_step_nm(self) -> float:
        """Step of the means over wavelength outside the spectral integral, nm: that of the integral."""
        return self.step_nm
