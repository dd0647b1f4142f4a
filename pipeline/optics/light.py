"""Light and observer as weights of a quadrature over wavelength."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from pipeline.arrays import Array
from pipeline.errors import InputError
from pipeline.optics.csv_columns import read_columns, shipped
from pipeline.validated import Pair, Validated, existing_file, is_csv

# the wavelengths, nm, that the CIE's observers of 1931 and 1964 cover
SHORTEST_NM, LONGEST_NM = 360, 830
# the middle of D65, weighted by ybar
_LUMINOUS_NM = 545.0
# the step, nm, at which integrals over wavelength have converged: docs/accuracy.md
FINE_STEP_NM = 1.0
# columns of data/illuminants.csv; other names are looked up in colour-science, whose import takes 1.5 s
_SHIPPED_ILLUMINANTS = ("A", "C", "D50", "D55", "D65", "D75")
_SHIPPED_OBSERVERS = {
    "CIE 1931 2 Degree Standard Observer": "cie_1931_2_degree.csv",
    "CIE 1964 10 Degree Standard Observer": "cie_1964_10_degree.csv",
}


class LaserLine(Validated):
    """Light of a single wavelength."""

    lambda_nm: Annotated[float, Field(ge=SHORTEST_NM, le=LONGEST_NM)]


class Light(Validated):
    """The illuminant, the observer and the wavelengths of an integral: a config's [spectrum].

    illuminant: a colour-science name, "E", a CSV of lambda_nm,power, or a laser line.
    observer: the colour-science name of colour matching functions.
    range_nm: limits of the integral, nm; without effect on a laser line.
    """

    illuminant: str | LaserLine = "D65"
    observer: str = "CIE 1931 2 Degree Standard Observer"
    range_nm: Pair = (380.0, 780.0)

    @property
    def is_line(self) -> bool:
        """Whether the light is a laser line."""
        return isinstance(self.illuminant, LaserLine)

    @property
    def lambda_min_nm(self) -> float:
        """The shortest wavelength, nm."""
        return self.illuminant.lambda_nm if isinstance(self.illuminant, LaserLine) else self.range_nm[0]

    @property
    def middle_nm(self) -> float:
        """The luminous middle, nm: the wavelength of a laser line, else 545 nm if it is in range."""
        if self.is_line:
            return self.lambda_min_nm
        return min(max(_LUMINOUS_NM, self.range_nm[0]), self.range_nm[1])

    @field_validator("range_nm")
    @classmethod
    def visible(cls, value: tuple[float, float]) -> tuple[float, float]:
        """Requires ascending limits that the observers cover."""
        if not SHORTEST_NM <= value[0] < value[1] <= LONGEST_NM:
            limits = f"{SHORTEST_NM:g}..{LONGEST_NM:g} nm"
            raise ValueError(f"expected [from, to] within the observer's {limits}, got {list(value)}")
        return value

    @model_validator(mode="after")
    def a_line_has_no_range(self) -> Self:
        """Rejects a range that a laser line would ignore."""
        if isinstance(self.illuminant, LaserLine) and "range_nm" in self.model_fields_set:
            raise ValueError("range_nm has no meaning with a laser line; leave it out")
        return self

    @field_validator("illuminant")
    @classmethod
    def known_illuminant(cls, value: str | LaserLine, info: ValidationInfo) -> str | LaserLine:
        """Requires a name that has a spectrum, or an existing CSV."""
        if isinstance(value, LaserLine) or value in (*_SHIPPED_ILLUMINANTS, "E"):
            return value
        if is_csv(value):
            return existing_file(value, info)
        import colour

        if value not in colour.SDS_ILLUMINANTS:
            some = ", ".join((*_SHIPPED_ILLUMINANTS, "E"))
            raise ValueError(f"unknown illuminant {value!r}; known: {some}, a .csv")
        return value

    @field_validator("observer")
    @classmethod
    def known_observer(cls, value: str) -> str:
        """Requires an observer whose colour matching functions are those of XYZ."""
        if value not in _SHIPPED_OBSERVERS:
            from colour.colorimetry import MSDS_CMFS_STANDARD_OBSERVER

            # the library's other matching functions are of cones or of RGB primaries
            if value not in MSDS_CMFS_STANDARD_OBSERVER:
                raise ValueError(f"unknown observer {value!r}; known: {', '.join(_SHIPPED_OBSERVERS)}")
        return value


@dataclass(frozen=True)
class Quadrature:
    """A rule for XYZ = sum_l |P|^2(l) weights[l], under which a mirror's white has Y = 1.

    lambda_nm: wavelengths (L,), nm, ascending. weights: (L, 3) for X, Y, Z.
    """

    lambda_nm: Array
    weights: Array

    @property
    def lambda_min_nm(self) -> float:
        """The shortest wavelength, nm."""
        return float(self.lambda_nm[0])


def trapezoid(light: Light, step_nm: float) -> Quadrature:
    """Makes the trapezoidal rule of [D14] sec. 5, with weights S xyzbar dl / sum S ybar dl.

    light: illuminant S, observer xyzbar and range. step_nm: distance of the wavelengths, nm; a range that is not a
        whole number of steps gets slightly shorter ones.
    Returns the rule; that of a laser line has one wavelength.
    Raises InputError where illuminant or observer do not cover the wavelengths.
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
    """Interpolates the relative spectral power of an illuminant, linearly as CIE 15 asks for D65.

    name: as in Light. lambda_nm: (L,), nm.
    Returns power (L,), its maximum 1.
    Raises InputError where the samples do not cover the wavelengths, or have no power at any of them.
    """
    if name == "E":
        return np.ones_like(lambda_nm)
    if is_csv(name):
        table = read_columns(Path(name).read_bytes(), 2, name)
        nodes, power = table[:, 0], table[:, 1]
    else:
        nodes, power = illuminant_samples(name)
    _require_covered(name, nodes, lambda_nm)
    values = np.interp(lambda_nm, nodes, power)
    if np.any(values < 0) or not np.any(values > 0):
        raise InputError(
            f"{name}: expected spectral power >= 0, and above 0 at some of the {len(lambda_nm)} wavelengths of the "
            "integral; for a line use { lambda_nm = ... }"
        )
    return np.asarray(values / values.max())


def observer_at(name: str, lambda_nm: Array) -> Array:
    """Interpolates the colour matching functions of an observer linearly between samples 1 nm apart.

    name: as in Light. lambda_nm: (L,), nm.
    Returns x_bar, y_bar, z_bar, (L, 3).
    Raises InputError where the samples do not cover the wavelengths: those of 2015 start at 390 nm.
    """
    nodes, values = observer_samples(name)
    _require_covered(name, nodes, lambda_nm)
    columns = [np.interp(lambda_nm, nodes, values[:, c]) for c in range(3)]
    return np.stack(columns, axis=-1)


@cache
def illuminant_samples(name: str) -> tuple[Array, Array]:
    """Returns the wavelengths (n,), nm, and the relative spectral power (n,) of a named illuminant."""
    if name in _SHIPPED_ILLUMINANTS:
        table = shipped("illuminants.csv", 1 + len(_SHIPPED_ILLUMINANTS))
        return table[:, 0], table[:, 1 + _SHIPPED_ILLUMINANTS.index(name)]
    import colour

    found = colour.SDS_ILLUMINANTS[name]
    return np.asarray(found.wavelengths, float), np.asarray(found.values, float)


@cache
def observer_samples(name: str) -> tuple[Array, Array]:
    """Returns the wavelengths (n,), nm, and the colour matching functions (n, 3) of a named observer."""
    if name in _SHIPPED_OBSERVERS:
        table = shipped(_SHIPPED_OBSERVERS[name], 4)
        return table[:, 0], table[:, 1:]
    import colour

    found = colour.MSDS_CMFS[name]
    return np.asarray(found.wavelengths, float), np.asarray(found.values, float)


def _require_covered(name: str, nodes: Array, lambda_nm: Array) -> None:
    """Raises InputError where samples at `nodes` do not reach all wavelengths."""
    if lambda_nm.min() < nodes[0] or lambda_nm.max() > nodes[-1]:
        asked = f"{lambda_nm.min():g}..{lambda_nm.max():g}"
        raise InputError(f"{name}: has values for {nodes[0]:g}..{nodes[-1]:g} nm, but {asked} nm are needed")
