"""Light and observer as quadrature weights over wavelength."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from pipeline.arrays import Array
from pipeline.errors import InputError
from pipeline.optics import colour_data
from pipeline.optics.fresnel import read_columns
from pipeline.validated import Pair, Validated, existing_file, is_csv

# the step, nm, at which integrals over wavelength have converged: docs/accuracy.md
FINE_STEP_NM = 1.0
# names colour-science certainly has; any other is looked up there, which costs its import
_COMMON_ILLUMINANTS = frozenset({"A", "C", "D50", "D55", "D65", "D75", "E"})
_COMMON_OBSERVERS = frozenset({"CIE 1931 2 Degree Standard Observer", "CIE 1964 10 Degree Standard Observer"})


class LaserLine(Validated):
    lambda_nm: Annotated[float, Field(ge=360, le=830)]


class Light(Validated):
    illuminant: str | LaserLine = "D65"
    observer: str = "CIE 1931 2 Degree Standard Observer"
    range_nm: Pair = (380.0, 780.0)

    @property
    def is_line(self) -> bool:
        """Whether it is a laser line."""
        return isinstance(self.illuminant, LaserLine)

    @property
    def lambda_min_nm(self) -> float:
        """The shortest wavelength, nm."""
        return self.illuminant.lambda_nm if isinstance(self.illuminant, LaserLine) else self.range_nm[0]

    @field_validator("range_nm")
    @classmethod
    def visible(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not 360 <= value[0] < value[1] <= 830:
            raise ValueError(f"expected [from, to] within the observer's 360..830 nm, got {list(value)}")
        return value

    @model_validator(mode="after")
    def a_line_has_no_range(self) -> Self:
        if isinstance(self.illuminant, LaserLine) and "range_nm" in self.model_fields_set:
            raise ValueError("range_nm has no meaning with a laser line; leave it out")
        return self

    @field_validator("illuminant")
    @classmethod
    def known_illuminant(cls, value: str | LaserLine, info: ValidationInfo) -> str | LaserLine:
        if isinstance(value, LaserLine) or value in _COMMON_ILLUMINANTS:
            return value
        if is_csv(value):
            return existing_file(value, info)
        import colour

        if value not in colour.SDS_ILLUMINANTS:
            some = ", ".join(sorted(_COMMON_ILLUMINANTS))
            raise ValueError(f"unknown illuminant {value!r}; known: {some}, a .csv")
        return value

    @field_validator("observer")
    @classmethod
    def known_observer(cls, value: str) -> str:
        if value not in _COMMON_OBSERVERS:
            from colour.colorimetry import MSDS_CMFS_STANDARD_OBSERVER

            # colour's other matching functions are of cones or RGB primaries and give no XYZ
            if value not in MSDS_CMFS_STANDARD_OBSERVER:
                some = ", ".join(sorted(_COMMON_OBSERVERS))
                raise ValueError(f"unknown observer {value!r}; known: {some}")
        return value


@dataclass(frozen=True)
class Quadrature:
    """XYZ = sum_l |P|^2(l) weights[l]: the white of a mirror has Y = 1.

    lambda_nm: float64 (L,); weights: float64 (L, 3) for X, Y, Z.
    """

    lambda_nm: Array
    weights: Array

    @property
    def lambda_min_nm(self) -> float:
        return float(self.lambda_nm[0])


def trapezoid(light: Light, step_nm: float) -> Quadrature:
    """The trapezoidal rule of [D14] sec. 5: S xyzbar dl / sum S ybar dl on nodes `step_nm` apart.

    A range that is not a whole number of steps gets slightly shorter ones. A laser line is one node.
    """
    if isinstance(light.illuminant, LaserLine):
        nodes = np.array([light.illuminant.lambda_nm])
        matching = observer_at(light.observer, nodes)
        return Quadrature(nodes, matching / matching[:, 1])
    low, high = light.range_nm
    count = max(1, int(np.ceil((high - low) / step_nm - 1e-9)))
    nodes = np.linspace(low, high, count + 1)
    rule = np.ones(count + 1)
    rule[[0, -1]] = 0.5
    weights = (rule * illuminant_at(light.illuminant, nodes))[:, None]
    weights = weights * observer_at(light.observer, nodes)
    return Quadrature(nodes, weights / weights[:, 1].sum())


def illuminant_at(name: str, lambda_nm: Array) -> Array:
    """Relative spectral power at wavelengths, linear between samples as CIE 15 has it for D65.

    Raises InputError where a CSV does not cover them or has no power.
    """
    if name == "E":
        return np.ones_like(lambda_nm)
    if name.lower().endswith(".csv"):
        table = read_columns(Path(name).read_bytes(), 2, name)
        nodes, power = table[:, 0], table[:, 1]
    else:
        nodes, power = colour_data.illuminant(name)
    _require_covered(name, nodes, lambda_nm)
    values = np.interp(lambda_nm, nodes, power)
    if np.any(values < 0) or not np.any(values > 0):
        raise InputError(
            f"{name}: expected spectral power >= 0, and above 0 at some of the {len(lambda_nm)} wavelengths of the "
            "integral; for a line use { lambda_nm = ... }"
        )
    return np.asarray(values / values.max())


def observer_at(name: str, lambda_nm: Array) -> Array:
    """Colour matching functions (L, 3) at wavelengths, linear between the 1 nm samples.

    Raises InputError where they do not cover them: those of 2015 start at 390 nm.
    """
    nodes, values = colour_data.observer(name)
    _require_covered(name, nodes, lambda_nm)
    columns = [np.interp(lambda_nm, nodes, values[:, c]) for c in range(3)]
    return np.stack(columns, axis=-1)


def _require_covered(name: str, nodes: Array, lambda_nm: Array) -> None:
    """Raises InputError where samples at `nodes` do not reach all wavelengths."""
    if lambda_nm.min() < nodes[0] or lambda_nm.max() > nodes[-1]:
        asked = f"{lambda_nm.min():g}..{lambda_nm.max():g}"
        raise InputError(f"{name}: has values for {nodes[0]:g}..{nodes[-1]:g} nm, but {asked} nm are needed")
