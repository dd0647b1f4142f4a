"""Evaluates a diffraction BRDF bundle: what a shader must reproduce. Needs numpy and OpenEXR alone.

    python evaluate.py directions.csv

reads rows of theta_i,phi_i,theta_r,phi_r (light, view; degrees), prints X,Y,Z under 1 RU: linear, not sRGB.
Directions point away from the surface, z is its normal. A row is nan where the table was not computed.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

Array = NDArray[np.float64]
AT_ONCE = 16384  # directions, to bound memory


class Bundle:
    """A bundle's tables in memory; i_p is (v, u, channel, p), computed is (v, u)."""

    def __init__(self, folder: Path) -> None:
        self.manifest: dict[str, Any] = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        tables = sorted(self.manifest["tables"], key=lambda entry: int(entry["p"]))
        planes = [read_rgba(folder / entry["file"]) for entry in tables]
        self.i_p = np.stack([plane[..., :3] for plane in planes], axis=-1)
        self.scale = [float(entry["scale"]) for entry in tables]
        self.computed = planes[0][..., 3] == 1.0
        self.n, self.power = int(self.manifest["grid"]["width"]), float(self.manifest["grid"]["power"])

    def xyz(self, wi: Array, wr: Array) -> Array:
        """XYZ (directions, 3) for unit vectors wi, wr (directions, 3); nan where not computed."""
        if np.any(wi[:, 2] <= 0.0) or np.any(wr[:, 2] <= 0.0):
            raise ValueError("a direction lies on or below the horizon: the table knows only z > 0")
        parts = range(0, len(wi), AT_ONCE)
        found = [self.part(wi[first : first + AT_ONCE], wr[first : first + AT_ONCE]) for first in parts]
        return np.concatenate([np.empty((0, 3)), *found])

    def part(self, wi: Array, wr: Array) -> Array:
        """XYZ = C cos(ti) sum_p w^p I_p(u, v), (u, v, w) = -wi - wr; bilinear between texel centres."""
        u, v, w = (-wi - wr).T
        column, row = self.texel(u), self.texel(v)
        left, low = (np.clip(np.floor(index).astype(int), 0, self.n - 2) for index in (column, row))
        a, b = column - left, row - low
        total = np.zeros((len(w), 3))
        corners = ((0, 0, (1 - a) * (1 - b)), (0, 1, a * (1 - b)), (1, 0, (1 - a) * b), (1, 1, a * b))
        for up, right, weight in corners:
            at = low + up, left + right
            known = self.computed[at] | (weight == 0.0)
            total += np.where(known, weight, np.nan)[:, None] * self.polynomial(self.i_p[at], w)
        return np.asarray(self.c_cos(wi, wr)[:, None] * total)

    def texel(self, u: Array) -> Array:
        """Fractional texel index of u: u = 2 |t|^a sign(t), t = 2 i / (n - 1) - 1. Texture: (i + 1/2) / n."""
        t = np.sign(u) * (np.abs(u) / 2.0) ** (1.0 / self.power)
        return np.asarray(0.5 * (t + 1.0) * (self.n - 1))

    def polynomial(self, i_p: NDArray[Any], w: Array) -> Array:
        """sum_p w^p I_p by Horner's rule, from the highest p down."""
        total = np.zeros((len(w), 3))
        for p in range(len(self.scale) - 1, -1, -1):
            total = total * w[:, None] + self.scale[p] * i_p[..., p].astype(float)
        return total

    def c_cos(self, wi: Array, wr: Array) -> Array:
        """C cos(ti) = (R / divisor)^exponent (1 + wi.wr)^2 / (cos(tr) w^2), times V-cavity shadowing."""
        material = self.manifest["material"]
        dot, w = np.sum(wi * wr, axis=-1), -wi[:, 2] - wr[:, 2]
        cos_half = np.sqrt(np.clip(0.5 * (1.0 + dot), 0.0, 1.0))
        reflected = (self.reflectance(cos_half) / material["divisor"]) ** material["exponent"]
        factor = reflected * (1.0 + dot) ** 2 / (wr[:, 2] * w**2)
        if material["shadowing"]:
            facet = (wi[:, 2] + wr[:, 2]) / cos_half**2
            factor = factor * np.minimum(1.0, facet * np.minimum(wi[:, 2], wr[:, 2]))
        return np.asarray(factor)

    def reflectance(self, cos: Array) -> Array:
        """R(cos_half): 1, Schlick's term, or Fresnel's |r|^2 averaged over the samples of n + ik."""
        material = self.manifest["material"]
        if material["fresnel"] == "none":
            return np.ones_like(cos)
        if material["fresnel"] == "schlick":
            return np.asarray(material["schlick_f0"] + (1.0 - material["schlick_f0"]) * (1.0 - cos) ** 5)
        samples = material["samples"]
        eta, cos = np.array(samples["n"]) + 1j * np.array(samples["k"]), cos[:, None]
        below = np.sqrt(1.0 - (1.0 - cos**2) / eta**2)
        r_s, r_p = (cos - eta * below) / (cos + eta * below), (eta * cos - below) / (eta * cos + below)
        return np.asarray(0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2) @ np.array(samples["luminous_weight"]))


def read_rgba(path: Path) -> NDArray[Any]:
    """The pixels (row, column, RGBA) of an EXR; row 0 is v = -2."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.stack([file.channels()[name].pixels for name in "RGBA"], axis=-1)


def direction(theta_deg: Array, phi_deg: Array) -> Array:
    """Unit vectors (directions, 3) from the polar angle from z and the azimuth from +x, degrees."""
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def read_directions(text: str) -> Array:
    """Rows (directions, 4) of a CSV in degrees; '#' starts a comment line, the column names may lead."""
    lines = [line for line in text.splitlines() if line.strip() and line[0] not in "#t"]
    rows = np.full((len(lines), 4), np.nan)
    for i, line in enumerate(lines):
        cells = line.split(",")
        rows[i] = cells if len(cells) == 4 else np.nan
        if not (np.all(np.isfinite(rows[i])) and np.all((rows[i, ::2] >= 0.0) & (rows[i, ::2] < 90.0))):
            raise ValueError(
                f"expected theta_i,phi_i,theta_r,phi_r in degrees, theta from 0 to below 90, got {line!r}"
            )
    return rows


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python evaluate.py directions.csv")
    try:
        angles = read_directions(Path(sys.argv[1]).read_text(encoding="utf-8-sig"))
        found = Bundle(Path(__file__).parent).xyz(direction(*angles[:, :2].T), direction(*angles[:, 2:].T))
    except (OSError, ValueError) as error:
        sys.exit(f"{sys.argv[1]}: {error}")
    print("X,Y,Z")
    for values in found:
        print(",".join(f"{value:.12g}" for value in values))
