"""The manifest's entry on the material: the factor C with all its numbers, so that a shader needs no other table."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.optics import fresnel
from pipeline.optics.light import trapezoid
from pipeline.validated import Positive, Validated

REFLECTANCE = "reflectance.csv"
_NODES = 257
# linear interpolation is compared with the formula at this many places per interval
_BETWEEN = 16

FORMULA = (
    "C = (R(cos_half) / divisor)^exponent * G / w^2 * D, G = (0.5 |wi + wr|^2)^2 / (cos(theta_i) cos(theta_r)), "
    "cos_half = 0.5 |wi + wr|; 0.5 |wi + wr|^2 is 1 + wi.wr, which cancels where both directions graze"
)
SHADOWING = "D = min(1, (wi.z + wr.z) min(wi.z, wr.z) / cos_half^2): symmetric V grooves, Cook & Torrance 1982"
NO_SHADOWING = "D = 1"
REFLECTANCES = {
    "none": "R = 1",
    "schlick": "R = F0 + (1 - F0) (1 - cos_half)^5, F0 = schlick_f0",
    "dielectric": "R = (|r_s|^2 + |r_p|^2) / 2 of Fresnel from air onto the index in 'samples'",
    "conductor": "R = sum over samples of luminous_weight (|r_s|^2 + |r_p|^2) / 2, Fresnel from air onto "
    "n + ik; the metal's colour at normal incidence is inside I_p",
}
INSIDE = "R = 1: the metal's reflectance, at every angle and wavelength, is inside the table"


class Samples(Validated):
    """Index n + ik of the medium at wavelengths, nm, and the weight of each in R; one sample without dispersion."""

    lambda_nm: list[Positive] | None
    n: Annotated[list[Annotated[float, Field(ge=1e-6, le=1e6)]], Field(min_length=1)]
    k: list[Annotated[float, Field(ge=0, le=1e6)]]
    luminous_weight: list[Annotated[float, Field(ge=-10, le=10)]]

    @model_validator(mode="after")
    def has_as_many_of_each(self) -> Self:
        """Checks the lengths of all lists, and that the weights are those of a mean.

        Raises ValueError, which pydantic reports.
        """
        lengths = {len(self.n), len(self.k), len(self.luminous_weight)}
        if len(lengths | ({len(self.lambda_nm)} if self.lambda_nm is not None else {1})) > 1:
            raise ValueError("lambda_nm, n, k and luminous_weight differ in length")
        if not math.isclose(math.fsum(self.luminous_weight), 1.0, rel_tol=1e-6):
            raise ValueError(f"luminous_weight sums to {math.fsum(self.luminous_weight):g}, not to 1")
        return self


class ReflectanceTable(Validated):
    """R on equidistant nodes of cos_half in [0, 1], for shaders; largest_error: of R interpolated between them."""

    file: Literal["reflectance.csv"]
    nodes: Annotated[int, Field(ge=2, le=100_000)]
    interpolation: Literal["linear"]
    largest_error: Annotated[float, Field(ge=0, le=1)]


class MaterialEntry(Validated):
    """The factor C = (R / divisor)^exponent G D / w^2 with all numbers; `ior` and `metal` are their source."""

    fresnel: Literal["none", "schlick", "dielectric", "conductor"]
    normalisation: Literal["relative", "absolute"]
    shadowing: bool
    ior: Positive | None
    metal: str | None
    formula: str
    reflectance: str
    shadowing_formula: str
    schlick_f0: Annotated[float, Field(ge=0, le=1)] | None
    samples: Samples | None
    divisor: Annotated[float, Field(ge=1e-30, le=1)]
    exponent: Literal[1, 2]
    reflectance_table: ReflectanceTable | None

    @model_validator(mode="after")
    def has_what_its_formula_needs(self) -> Self:
        """Checks that the reflectance's numbers are there. Raises ValueError, which pydantic reports."""
        if (self.schlick_f0 is not None) != (self.fresnel == "schlick"):
            raise ValueError("schlick_f0 belongs to fresnel = schlick")
        if self.samples is None and self.fresnel == "dielectric":
            raise ValueError("fresnel = dielectric needs samples")
        if self.samples is not None and self.fresnel not in ("dielectric", "conductor"):
            raise ValueError(f"fresnel = {self.fresnel} has no samples")
        return self


@dataclass(frozen=True)
class Medium:
    """A reflecting medium.

    lambda_nm: wavelengths (L,), nm; None without dispersion. index: n + ik (L,).
    weight: of each wavelength in the mean reflectance (L,).
    """

    lambda_nm: Array | None
    index: np.ndarray
    weight: Array

    def reflectance(self, cos_half: Array) -> Array:
        """Computes the weighted mean of the Fresnel reflectance (...,) at cosines of the half angle (...,)."""
        return np.asarray(fresnel.reflectance(cos_half[..., None], self.index) @ self.weight)

    def samples(self) -> Samples:
        """Returns the manifest's entry of the medium."""
        return Samples(
            lambda_nm=None if self.lambda_nm is None else self.lambda_nm.tolist(),
            n=self.index.real.tolist(),
            k=self.index.imag.tolist(),
            luminous_weight=self.weight.tolist(),
        )


def medium(config: Config) -> Medium | None:
    """Returns the medium whose reflectance is part of C: a dielectric, or a metal averaged over its luminance Y.

    Returns None for other materials, and where the table holds the metal's reflectance.
    """
    if config.material.fresnel == "dielectric":
        return Medium(None, np.array([config.material.ior], dtype=complex), np.ones(1))
    if config.material.fresnel == "conductor" and not _inside_table(config):
        quadrature = trapezoid(config.light, config.table.mean_step_nm)
        index = fresnel.metal_index(config.material.metal, quadrature.lambda_nm)
        return Medium(quadrature.lambda_nm, index, quadrature.weights[:, 1])
    return None


def _inside_table(config: Config) -> bool:
    """Tells whether the table holds a metal's reflectance: rho and |w| determine the half angle."""
    return config.material.fresnel == "conductor" and config.table.holds_metals


def entry(config: Config) -> MaterialEntry:
    """Returns the manifest's entry of the material, `pipeline.optics.brdf.direction_factor` as numbers."""
    material, found = config.material, medium(config)
    conductor, relative = material.fresnel == "conductor", material.normalisation == "relative"
    return MaterialEntry(
        fresnel=material.fresnel,
        normalisation=material.normalisation,
        shadowing=material.shadowing,
        ior=material.ior if material.fresnel in ("schlick", "dielectric") else None,
        # a manifest holds no folder of this machine
        metal=Path(material.metal).name if conductor else None,
        formula=FORMULA,
        reflectance=INSIDE if _inside_table(config) else REFLECTANCES[material.fresnel],
        shadowing_formula=SHADOWING if material.shadowing else NO_SHADOWING,
        schlick_f0=float(fresnel.schlick(1.0, material.ior)) if material.fresnel == "schlick" else None,
        samples=None if found is None else found.samples(),
        # the reflectance of an absolute conductor at normal incidence is inside I_p, so only the ratio remains
        divisor=_at_normal(config, found) if relative or conductor else 1.0,
        # F is squared, as the paper prints it
        exponent=2 if relative and material.fresnel == "schlick" else 1,
        reflectance_table=_describe(found) if found is not None and conductor else None,
    )


def _at_normal(config: Config, found: Medium | None) -> float:
    """Computes R(1), the reflectance at normal incidence."""
    if found is not None:
        return float(found.reflectance(np.array(1.0)))
    return float(fresnel.schlick(1.0, config.material.ior)) if config.material.fresnel == "schlick" else 1.0


def _describe(found: Medium) -> ReflectanceTable:
    cos, values = reflectance_table(found)
    fine = np.linspace(0.0, 1.0, (_NODES - 1) * _BETWEEN + 1)
    error = np.abs(np.interp(fine, cos, values) - found.reflectance(fine))
    return ReflectanceTable(
        file="reflectance.csv", nodes=_NODES, interpolation="linear", largest_error=float(error.max())
    )


def reflectance_table(found: Medium) -> tuple[Array, Array]:
    """Computes R on equidistant nodes of cos_half; returns cos_half (257,) and R (257,)."""
    cos = np.linspace(0.0, 1.0, _NODES)
    return cos, found.reflectance(cos)


def reflectance_csv(found: Medium) -> str:
    """Writes the reflectance table as CSV, columns cos_half and R, with 9 significant digits."""
    rows: Any = zip(*reflectance_table(found), strict=True)
    return "cos_half,R\n" + "".join(f"{cos:.9g},{value:.9g}\n" for cos, value in rows)
