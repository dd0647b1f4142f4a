"""The look-up in polar tables, as the evaluator of a bundle holds it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array


class PolarTextures:
    """Cubic B-splines on rings and azimuths, Chebyshev polynomials in |w|; texels (ring, azimuth, output)."""

    def __init__(self, grid: dict[str, Any], planes: list[NDArray[Any]], scale: list[list[float]]) -> None:
        self.grid, outputs = grid, 4 * len(planes)
        self.texels = np.concatenate([p * np.array(s) for p, s in zip(planes, scale, strict=True)], axis=-1)
        basis = np.eye(outputs) if grid["basis"] is None else np.array(grid["basis"])
        self.basis = basis.reshape(outputs, 3, grid["w_terms"])

    def value(self, u: Array, v: Array, w: Array) -> Array:
        """Computes g(rho) sum_k T_k(2 |w| / w_max - 1) sum_o output_o(u, v) basis[o, channel, k], (directions, 3)."""
        rho = np.hypot(u, v)
        x = np.clip(2.0 * np.abs(w) / np.sqrt(np.maximum(4.0 - rho**2, 1e-6)) - 1.0, -1.0, 1.0)
        chebyshev = np.cos(np.arange(self.basis.shape[2]) * np.arccos(x)[:, None])
        g = (1.0 + (rho / self.grid["envelope_radius"]) ** 2) ** -self.grid["envelope_exponent"]
        g[rho > self.grid["rho_max"] * (1.0 + 1e-6)] = np.nan  # outside the scene
        ring = np.minimum(np.arcsinh(rho / self.grid["r0"]) / self.grid["step"], self.grid["height"] - 1)
        outputs = self.interpolate(ring, self.azimuth(u, v))
        return np.asarray(g[:, None] * np.einsum("no,ock,nk->nc", outputs, self.basis, chebyshev, optimize=True))

    def azimuth(self, u: Array, v: Array) -> Array:
        """Computes the fractional column of (u, v), turned by -axis and stretched."""
        cos, sin = np.cos(self.grid["axis_rad"]), np.sin(self.grid["axis_rad"])
        angle = np.arctan2(cos * v - sin * u, self.grid["stretch"] * (cos * u + sin * v))
        return np.asarray(angle / (2.0 * np.pi) % 1.0 * self.grid["width"])

    def interpolate(self, ring: Array, azimuth: Array) -> Array:
        """Interpolates outputs (directions, outputs) from the 4 x 4 texels around each place."""
        rows, columns = np.floor(ring).astype(int) - 1, np.floor(azimuth).astype(int) - 1
        total = np.zeros((len(ring), len(self.basis)))
        for a, across in enumerate(spline(ring % 1.0)):
            for b, along in enumerate(spline(azimuth % 1.0)):
                total += (across * along)[:, None] * self.texels[self.place(rows + a, columns + b)]
        return total

    def place(self, row: NDArray[Any], column: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Maps rows and columns beyond the grid to texels: through the origin, mirrored at the rim, periodic."""
        last, width = self.grid["height"] - 1, self.grid["width"]
        return last - np.abs(last - np.abs(row)), (column + np.where(row < 0, width // 2, 0)) % width


def spline(t: Array) -> Array:
    """Computes the weights (4, places) of a cubic B-spline's four texels."""
    s = 1.0 - t
    return np.stack([s**3, 4.0 - 3.0 * t**2 * (2.0 - t), 4.0 - 3.0 * s**2 * (2.0 - s), t**3]) / 6.0


textures = PolarTextures
