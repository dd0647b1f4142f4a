"""Light and observer as quadrature weights over wavelength."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.config.models import LaserLine, Spectrum
from pipeline.errors import ScanError
from pipeline.optics import colour_data
from pipeline.optics.fresnel import read_columns
from pipeline.optics.geometry import Array


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


def shortest_wavelength_nm(spectrum: Spectrum) -> float:
    """The shortest wavelength a spectrum asks for, nm."""
    if isinstance(spectrum.illuminant, LaserLine):
        return spectrum.illuminant.lambda_nm
    return spectrum.range_nm[0]


def trapezoid(spectrum: Spectrum, step_nm: float) -> Quadrature:
    """The trapezoidal rule of [D14] sec. 5: S xyzbar dl / sum S ybar dl on nodes `step_nm` apart.

    A range that is not a whole number of steps gets slightly shorter ones. A laser line is one node.
    """
    if isinstance(spectrum.illuminant, LaserLine):
        nodes = np.array([spectrum.illuminant.lambda_nm])
        matching = observer_at(spectrum.observer, nodes)
        return Quadrature(nodes, matching / matching[:, 1])
    low, high = spectrum.range_nm
    count = max(1, int(np.ceil((high - low) / step_nm - 1e-9)))
    nodes = np.linspace(low, high, count + 1)
    rule = np.ones(count + 1)
    rule[[0, -1]] = 0.5
    weights = (rule * illuminant_at(spectrum.illuminant, nodes))[:, None]
    weights = weights * observer_at(spectrum.observer, nodes)
    return Quadrature(nodes, weights / weights[:, 1].sum())


def illuminant_at(name: str, lambda_nm: Array) -> Array:
    """Relative spectral power at wavelengths, linear between samples as CIE 15 has it for D65.

    Raises ScanError where a CSV does not cover them or has no power.
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
        raise ScanError(
            f"{name}: expected spectral power >= 0, and above 0 at some of the {len(lambda_nm)} wavelengths of the "
            "integral; for a line use { lambda_nm = ... }"
        )
    return np.asarray(values / values.max())


def observer_at(name: str, lambda_nm: Array) -> Array:
    """Colour matching functions (L, 3) at wavelengths, linear between the 1 nm samples.

    Raises ScanError where they do not cover them: those of 2015 start at 390 nm.
    """
    nodes, values = colour_data.observer(name)
    _require_covered(name, nodes, lambda_nm)
    columns = [np.interp(lambda_nm, nodes, values[:, c]) for c in range(3)]
    return np.stack(columns, axis=-1)


def _require_covered(name: str, nodes: Array, lambda_nm: Array) -> None:
    """Raises ScanError where samples at `nodes` do not reach all wavelengths."""
    if lambda_nm.min() < nodes[0] or lambda_nm.max() > nodes[-1]:
        asked = f"{lambda_nm.min():g}..{lambda_nm.max():g}"
        raise ScanError(f"{name}: has values for {nodes[0]:g}..{nodes[-1]:g} nm, but {asked} nm are needed")
