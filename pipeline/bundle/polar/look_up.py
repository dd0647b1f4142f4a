"""The look-up in polar tables, as the evaluator of a bundle holds it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array


class PolarTextures:
    """Cubic B-splines on rings and azimuths, Chebyshev polynomials in |w|; texels (place in an image, output)."""

    def __init__(self, grid: dict[str, Any], planes: list[NDArray[Any]], scale: list[list[float]]) -> None:
        self.grid, outputs = grid, 4 * len(planes)
        texels = np.concatenate([p * np.array(s) for p, s in zip(planes, scale, strict=True)], axis=-1)
        # the last texel is that of absent tiles, whose first is at -1
        self.texels = np.concatenate([texels.reshape(-1, outputs), np.full((1, outputs), np.nan, texels.dtype)])
        self.every, self.starts = np.array(grid["every"]), np.array(grid["starts"])
        basis = np.eye(outputs) if grid["basis"] is None else np.array(grid["basis"])
        self.basis = basis.reshape(outputs, 3, grid["w_terms"])

    def value(self, u: Array, v: Array, w: Array) -> Array:
        """Computes g(rho) sum_k T_k(2 |w| / w_max - 1) sum_o output_o(u, v) basis[o, channel, k], (directions, 3)."""
        rho = np.hypot(u, v)
        x = np.clip(2.0 * np.abs(w) / np.sqrt(np.maximum(4.0 - rho**2, 1e-6)) - 1.0, -1.0, 1.0)
        chebyshev = np.cos(np.arange(self.basis.shape[2]) * np.arccos(x)[:, None])
        g = (1.0 + (rho / self.grid["envelope_radius"]) ** 2) ** -self.grid["envelope_exponent"]
        g[rho > self.grid["rho_max"] * (1.0 + 1e-6)] = np.nan  # outside the scene
        ring = np.minimum(np.arcsinh(rho / self.grid["r0"]) / self.grid["step"], self.grid["rings"] - 1)
        outputs = self.interpolate(ring, self.azimuth(u, v))
        return np.asarray(g[:, None] * np.einsum("no,ock,nk->nc", outputs, self.basis, chebyshev, optimize=True))

    def azimuth(self, u: Array, v: Array) -> Array:
        """Computes the fractional azimuth of (u, v), turned by -axis and stretched."""
        cos, sin = np.cos(self.grid["axis_rad"]), np.sin(self.grid["axis_rad"])
        angle = np.arctan2(cos * v - sin * u, self.grid["stretch"] * (cos * u + sin * v))
        return np.asarray(angle / (2.0 * np.pi) % 1.0 * self.grid["azimuths"])

    def interpolate(self, ring: Array, azimuth: Array) -> Array:
        """Interpolates outputs (directions, outputs) from 4 texels on each of 4 rings; nan at absent tiles."""
        below, total = np.floor(ring).astype(int), np.zeros((len(ring), len(self.basis)))
        for a, across in enumerate(spline(ring % 1.0)):
            row = below - 1 + a
            knot = azimuth / self.every[self.mirrored(row) // 16]
            for b, along in enumerate(spline(knot % 1.0)):
                texels = self.texels[self.place(row, np.floor(knot).astype(int) - 1 + b)]
                total += (across * along)[:, None] * texels
        return total

    def mirrored(self, row: NDArray[Any]) -> NDArray[Any]:
        """Maps rows beyond the rings to rings: below the first (with half a turn) and mirrored at the last."""
        last = self.grid["rings"] - 1
        return np.asarray(last - np.abs(last - np.abs(row)))

    def place(self, row: NDArray[Any], knot: NDArray[Any]) -> NDArray[Any]:
        """Computes the place of a ring's knot in the image, -1 where its tile is absent: knots are periodic."""
        ring = self.mirrored(row)
        every = self.every[ring // 16]
        knots, in_tile = self.grid["azimuths"] // every, 128 // every
        knot = (knot + np.where(row < 0, knots // 2, 0)) % knots
        start = self.starts[ring // 16, knot // in_tile]
        return np.where(start < 0, -1, start + ring % 16 * self.grid["width"] + knot % in_tile)


def spline(t: Array) -> Array:
    """Computes the weights (4, places) of a cubic B-spline's four texels."""
    s = 1.0 - t
    return np.stack([s**3, 4.0 - 3.0 * t**2 * (2.0 - t), 4.0 - 3.0 * s**2 * (2.0 - s), t**3]) / 6.0


textures = PolarTextures
