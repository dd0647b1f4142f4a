"""The material of a surface, and the normalisation of its radiance."""

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from pipeline.validated import Validated, existing_file, is_csv


class Material(Validated):
    """Reflectance, shadowing and normalisation: a config's [material].

    fresnel: the reflectance model; "none" is a perfect mirror. ior: refractive index, of "schlick" and "dielectric".
    metal: "Au", or a CSV of lambda_nm,n,k, of "conductor". shadowing: whether the V-cavity term applies.
    normalisation: "absolute": a BRDF in 1/sr; or "relative" ([D14] eq. 4), to compare with the paper.
    """

    fresnel: Literal["none", "schlick", "dielectric", "conductor"] = "schlick"
    ior: Annotated[float, Field(gt=1, le=5)] = 1.5
    metal: str = "Au"
    shadowing: bool = True
    normalisation: Literal["relative", "absolute"] = "absolute"

    @field_validator("metal")
    @classmethod
    def known_metal(cls, value: str, info: ValidationInfo) -> str:
        """Requires gold or an existing CSV."""
        if is_csv(value):
            return existing_file(value, info)
        if value != "Au":
            raise ValueError(f"expected 'Au' or a .csv of lambda_nm,n,k, got {value!r}")
        return value
