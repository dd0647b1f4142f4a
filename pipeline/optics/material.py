"""What a surface is made of, and how its radiance is normalised."""

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from pipeline.validated import Validated, existing_file, is_csv


class Material(Validated):
    fresnel: Literal["none", "schlick", "dielectric", "conductor"] = "schlick"
    ior: Annotated[float, Field(gt=1, le=5)] = 1.5
    metal: str = "Au"
    shadowing: bool = True
    normalisation: Literal["relative", "absolute"] = "relative"

    @field_validator("metal")
    @classmethod
    def known_metal(cls, value: str, info: ValidationInfo) -> str:
        if is_csv(value):
            return existing_file(value, info)
        if value != "Au":
            raise ValueError(f"expected 'Au' or a .csv of lambda_nm,n,k, got {value!r}")
        return value
