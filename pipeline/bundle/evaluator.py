"""Evaluates a diffraction BRDF bundle, as a shader has to. Needs only numpy and OpenEXR.

    python evaluate.py directions.csv

reads rows of theta_i,phi_i,theta_r,phi_r (light, view; degrees), prints X,Y,Z: linear, not sRGB.
X,Y,Z are in the unit that manifest.json states.
Directions point away from the surface, z is its normal. Values below the horizon or negative are 0, not computed nan.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from pipeline.layouts import textures

Array = NDArray[np.float64]
COLUMNS, AT_ONCE = "theta_i,phi_i,theta_r,phi_r", 16384  # directions at once, to bound memory


class BundleTables:
    """A bundle in memory: XYZ = max(0, C cos(ti) times the value of its table at (u, v, w) = -wi - wr)."""

    def __init__(self, folder: Path) -> None:
        self.manifest: dict[str, Any] = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        images = sorted(self.manifest["tables"], key=lambda entry: int(entry["index"]))
        size = self.manifest["grid"]["height"], self.manifest["grid"]["width"]
        planes = [read_rgba(folder / "tables" / Path(entry["file"]).name, size) for entry in images]
        if not all(np.isfinite(plane).all() for plane in planes):
            raise ValueError("expected texels that are finite numbers")
        self.table = textures(self.manifest["grid"], planes, [entry["scale"] for entry in images])

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Computes XYZ (directions, 3) for unit vectors wi, wr (directions, 3); nan where not computed."""
        return np.asarray(np.maximum(self.signed(wi, wr), 0.0))

    def signed(self, wi: Array, wr: Array) -> Array:
        """Computes XYZ (directions, 3) with the negative values of overshoots, and nan where not computed."""
        found, above = np.zeros((len(wi), 3)), np.flatnonzero(np.minimum(wi[:, 2], wr[:, 2]) > 0.0)
        for at in np.array_split(above, range(AT_ONCE, len(above), AT_ONCE)):
            found[at] = self.c_cos(wi[at], wr[at])[:, None] * self.table.value(*(-wi[at] - wr[at]).T)
        return found

    def c_cos(self, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) = (R / divisor)^exponent (1 + wi.wr)^2 / (cos(tr) w^2), times V-cavity shadowing."""
        material, s = self.manifest["material"], wi + wr
        one_plus_dot = 0.5 * np.sum(s * s, axis=-1)  # 1 + wi.wr cancels at grazing angles
        reflected = self.reflectance(np.sqrt(0.5 * one_plus_dot)) / material["divisor"]
        factor = reflected ** material["exponent"] * (one_plus_dot / s[:, 2]) ** 2 / wr[:, 2]
        if material["shadowing"]:
            factor *= np.minimum(1.0, 2.0 * s[:, 2] * np.minimum(wi[:, 2], wr[:, 2]) / one_plus_dot)
        return np.asarray(factor)

    def reflectance(self, cos: Array) -> Array:
        """Computes R(cos_half): Schlick's term, Fresnel's |r|^2 averaged over the samples of n + ik, or 1."""
        f0, samples = self.manifest["material"]["schlick_f0"], self.manifest["material"]["samples"]
        if f0 is not None:
            return np.asarray(f0 + (1.0 - f0) * (1.0 - cos) ** 5)
        if samples is None:
            return np.ones_like(cos)
        eta, cos = np.array(samples["n"]) + 1j * np.array(samples["k"]), cos[:, None]
        below = np.sqrt(1.0 - (1.0 - cos**2) / eta**2)
        r_s, r_p = (cos - eta * below) / (cos + eta * below), (eta * cos - below) / (eta * cos + below)
        return np.asarray(0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2) @ np.array(samples["luminous_weight"]))


def read_rgba(path: Path, size: tuple[int, int]) -> NDArray[Any]:
    """Reads the pixels (row, column, RGBA) of an EXR of `size` rows and columns; row 0 is its first line."""
    with OpenEXR.File(str(path), header_only=True) as file:
        first, last = file.header()["dataWindow"]
    if (last[1] - first[1] + 1, last[0] - first[0] + 1) != size:
        raise ValueError(f"{path}: expected {size} rows and columns, as the manifest states")
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.stack([file.channels()[name].pixels for name in "RGBA"], axis=-1)


def direction(theta_deg: Array, phi_deg: Array) -> Array:
    """Computes unit vectors (directions, 3) from the angle to z and the azimuth from +x towards +y, degrees."""
    sin, cos, phi = np.sin(np.radians(theta_deg)), np.sin(np.radians(90.0 - theta_deg)), np.radians(phi_deg)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=-1)  # at 90 degrees, this cosine is 0


def read_directions(text: str) -> Array:
    """Reads rows (directions, 4) of a CSV in degrees; '#' starts a comment, a first line may name the columns."""
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.partition("#")[0].strip()
        if content and (rows or content.replace(" ", "") != COLUMNS):
            try:
                theta_i, phi_i, theta_r, phi_r = map(float, content.split(","))
            except ValueError:
                raise ValueError(f"line {number}: expected four numbers {COLUMNS}, got {content!r}") from None
            if not (0 <= theta_i <= 180 and 0 <= theta_r <= 180 and abs(phi_i) < 1e6 and abs(phi_r) < 1e6):
                raise ValueError(f"line {number}: expected theta in [0, 180], finite phi, degrees, got {content!r}")
            rows.append([theta_i, phi_i, theta_r, phi_r])
    if not rows:
        raise ValueError(f"expected rows of {COLUMNS} in degrees, got none")
    return np.array(rows)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python evaluate.py directions.csv")
    try:
        angles = read_directions(Path(sys.argv[1]).read_text(encoding="utf-8-sig"))
        found = BundleTables(Path(__file__).parent).signed(direction(*angles[:, :2].T), direction(*angles[:, 2:].T))
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        sys.exit(f"{sys.argv[1]}: {error}")
    print("X,Y,Z", *(",".join(f"{value:.12g}" for value in row) for row in np.maximum(found, 0.0)), sep="\n")
    for count, why in (
        (np.isnan(found).any(1).sum(), "not computed"),
        ((found < 0.0).any(1).sum(), "negative, now 0"),
    ):
        print(f"{count} of {len(found)} rows were {why}\n" if count else "", end="", file=sys.stderr)
