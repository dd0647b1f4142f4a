"""The paper's tables I_p(u, v), p = 0 .. 2N, of X, Y and Z ([D14] eq. 8-12)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernels import windowed_dft
from pipeline import resources
from pipeline.arrays import Array
from pipeline.diffraction.dft_stack import Stack, StackSize
from pipeline.diffraction.upload import upload
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import Quadrature
from pipeline.progress import Progress, silent
from pipeline.scene.model import Scene
from pipeline.scene.visited import discs
from pipeline.tables.taylor import grid


@dataclass(frozen=True)
class TaylorTable:
    """I_p on the grid of pipeline.tables.taylor.grid.

    values: float32 (v, u, channel, p): I_p of X, Y, Z, dimensionless; 0 at nodes that are not computed.
    computed: bool (v, u); nodes whose cells no direction of the scene reaches are not computed.
    unknown: float32 (v, u): share of the light (Y weights) whose frequencies lie beyond the scan's Nyquist limits.
    power: the exponent a of the grid.
    """

    values: NDArray[np.float32]
    computed: NDArray[np.bool_]
    unknown: NDArray[np.float32]
    power: float

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays."""
        return self.values.nbytes + self.computed.nbytes + self.unknown.nbytes

    @property
    def resolution(self) -> int:
        """Number of nodes along each axis."""
        return int(self.values.shape[0])

    @property
    def unknown_share(self) -> float:
        """Share of the light over the disc of (u, v) whose frequencies lie beyond the scan's Nyquist limits."""
        u = grid.nodes(self.resolution, self.power)
        width = np.gradient(u)
        inside = np.hypot(u[:, None], u) <= grid.U_MAX
        area = np.outer(width, width) * (inside & self.computed)
        return float(np.sum(area * self.unknown) / max(np.sum(area), np.finfo(float).tiny))

    def look_up(self, uvw: Array) -> Array:
        """Computes sum_p w^p I_p (directions, 3) at `uvw` (directions, 3), bilinear between nodes ([D14] eq. 10).

        It is NaN outside the scene of the table, where a neighbouring node is not computed.
        """
        n = self.resolution
        column, row = (grid.node_index(uvw[:, axis], n, self.power) for axis in (0, 1))
        left, bottom = (np.clip(np.floor(index).astype(int), 0, n - 2) for index in (column, row))
        a, b = column - left, row - bottom
        total = np.zeros((len(uvw), 3))
        for down, right, weight in (
            (0, 0, (1 - a) * (1 - b)),
            (0, 1, a * (1 - b)),
            (1, 0, (1 - a) * b),
            (1, 1, a * b),
        ):
            at = bottom + down, left + right
            corner = sum_powers(self.values[at], uvw[:, 2])
            known = self.computed[at] | (weight == 0.0)
            total += np.where(known, weight, np.nan)[:, None] * corner
        return total

    def direction_factor(self, radiometry: Radiometry, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (directions,), with a metal's reflectance, for unit vectors wi, wr (directions, 3)."""
        return radiometry.direction_factor(wi, wr)


def build(
    stack: Stack,
    quadrature: Quadrature,
    resolution: int,
    power: float,
    scene: Scene | None = None,
    progress: Progress = silent,
) -> TaylorTable:
    """Computes the tables of a Taylor stack ([D14] eq. 8, 11 and 12).

    Heights are real, so I_p(-u, -v) = (-1)^p I_p(u, v), and a half plane is enough. Memory is that of the table and
    one tile of nodes.

    stack: the Taylor stack. quadrature: wavelengths and weights of light, observer and material.
    resolution: odd number of nodes along each axis. power: the exponent a of the grid.
    scene: lights and views, None for all. progress: called with the share done.
    Raises ResourceError if the table does not fit into memory, and DeviceError if no device works.
    """
    resources.require(
        f"{2 * stack.terms - 1} tables of {resolution} x {resolution} nodes",
        values_bytes(resolution, stack.terms),
        "lower table.resolution or raise table.tolerance (fewer terms)",
    )
    u = grid.nodes(resolution, power)
    computed = reachable_nodes(u, scene)
    half_plane = (u > 0.0) | ((u == 0.0) & (u[:, None] >= 0.0))
    v_index, u_index = np.nonzero((computed | computed[::-1, ::-1]) & half_plane)
    nodes = np.stack([u[u_index], u[v_index]], axis=-1)
    # a border node may lie slightly outside the disc of radius 2, at which the stack ends
    radius = np.maximum(np.hypot(nodes[:, 0], nodes[:, 1]) / grid.U_MAX, 1.0)
    powers = 2 * stack.terms - 1
    values = np.zeros((resolution, resolution, 3, powers), dtype=np.float32)
    sign = np.where(np.arange(powers) % 2 == 0, 1.0, -1.0)
    for tile, i_p in _tiles(stack, quadrature, nodes / radius[:, None]):
        rows, columns = v_index[tile], u_index[tile]
        values[resolution - 1 - rows, resolution - 1 - columns] = sign * i_p
        values[rows, columns] = i_p
        progress("table", tile.stop / len(nodes))
    values[~computed] = 0.0
    return TaylorTable(values, computed, _unknown(stack, quadrature, u), power)


def node_values(stack: Stack, quadrature: Quadrature, uv: Array) -> Array:
    """Computes I_p without a grid, in float64.

    stack: the Taylor stack. quadrature: wavelengths and weights. uv: (nodes, 2) with u >= 0 and |(u, v)| <= 2.
    Returns (nodes, 3, 2 N + 1). Raises DeviceError if no device works.
    """
    return np.concatenate([i_p.copy() for _, i_p in _tiles(stack, quadrature, uv)])


def _tiles(stack: Stack, quadrature: Quadrature, uv: Array) -> Iterator[tuple[slice, Array]]:
    return windowed_dft.taylor_table(upload(stack), uv, 1e-3 * quadrature.lambda_nm, quadrature.weights)


def sum_powers(i_p: Array, w: Array) -> Array:
    """Computes sum_p w^p I_p ([D14] eq. 10) by Horner's rule in float64.

    i_p: (..., 3, P). w: (...,). Returns (..., 3).
    """
    total = np.zeros(i_p.shape[:-1])
    for p in range(i_p.shape[-1] - 1, -1, -1):
        total = total * w[..., None] + i_p[..., p]
    return total


def at_directions(stack: Stack, quadrature: Quadrature, uvw: Array) -> Array:
    """Computes sum_p w^p I_p (directions, 3) at `uvw` (directions, 3) without a grid, in float64.

    Raises DeviceError if no device works.
    """
    # I_p(-u, -v) = (-1)^p I_p(u, v): the half plane u >= 0 is enough if w changes its sign with (u, v)
    turn = np.where(uvw[:, 0] < 0.0, -1.0, 1.0)
    return sum_powers(node_values(stack, quadrature, turn[:, None] * uvw[:, :2]), turn * uvw[:, 2])


def values_bytes(resolution: int, terms: int) -> int:
    """Computes the size of the tables I_p of a stack of so many terms, bytes."""
    return 4 * resolution**2 * 3 * (2 * terms - 1)


def building_arrays(resolution: int, terms: int, coefficients: StackSize) -> resources.Arrays:
    """Lists the arrays of `build`: the tables, the nodes of a half plane with their indices, and the device's.

    terms: of the stack. coefficients: of the stack, whose terms are padded to whole vectors on the device.
    """
    nodes = resolution**2 // 2
    return {
        "tables I_p": values_bytes(resolution, terms),
        "nodes": (2 + 3 * 8 + 4 * 8 + 4) * nodes,
        "stack on the device": coefficients.stack_bytes(windowed_dft.LANES * -(-terms // windowed_dft.LANES), 8),
        "tiles of nodes": windowed_dft.taylor_table_bytes(nodes, terms),
    }


def seconds(nodes: int, wavelengths: int, terms: int, coefficients: StackSize) -> float:
    """Estimates the time of I_p at nodes: the coefficients under the window, of all terms, and their products.

    Multiply-adds in double precision count twice.
    """
    reach_x, reach_y = coefficients.reach
    gathered = (2 * reach_x + 1) * (2 * reach_y + 1) * 2 * terms
    return resources.seconds(2.0 * nodes * wavelengths * (gathered + 3.0 * terms**2))


def reachable_nodes(u: Array, scene: Scene | None) -> NDArray[np.bool_]:
    """Finds the nodes at the corners of the grid cells that a pair of directions reaches, bool (v, u).

    (u, v) lies in discs, `pipeline.scene.visited.discs`.
    """
    nodes = np.zeros((len(u), len(u)), dtype=bool)
    low, high = u[:-1], u[1:]
    for (cx, cy), radius in discs(scene):
        # offset from the disc's centre to the nearest point of each cell
        dx, dy = np.clip(cx, low, high) - cx, np.clip(cy, low, high) - cy
        cells = np.hypot(dx[None, :], dy[:, None]) <= radius
        for rows, columns in (
            (np.s_[:-1], np.s_[:-1]),
            (np.s_[:-1], np.s_[1:]),
            (np.s_[1:], np.s_[:-1]),
            (np.s_[1:], np.s_[1:]),
        ):
            nodes[rows, columns] |= cells
    return nodes


def _unknown(stack: Stack, quadrature: Quadrature, u: Array) -> NDArray[np.float32]:
    """Computes the share of the Y weights at each node whose frequencies lie beyond the Nyquist limits, (v, u)."""
    band_x, band_y = stack.band_per_um
    # the weights of all wavelengths shorter than |u| / band are lost
    shorter = np.concatenate([[0.0], np.cumsum(np.abs(quadrature.weights[:, 1]))])
    shorter /= shorter[-1]
    lost = [np.searchsorted(quadrature.lambda_nm, 1e3 * np.abs(u) / band, side="left") for band in (band_x, band_y)]
    return shorter[np.maximum(lost[0][None, :], lost[1][:, None])].astype(np.float32)
