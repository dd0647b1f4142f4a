"""The paper's tables, timed over their resolution and wavelength step."""

from dataclasses import dataclass

import numpy as np

from kernels import device
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import dft_stack, expansion
from pipeline.evaluation import plain_numpy
from pipeline.evaluation.speed import work
from pipeline.evaluation.speed.machine import Timed
from pipeline.evaluation.speed.timing import best_of, timed
from pipeline.optics.light import Quadrature
from pipeline.surface.heightfield import HeightField
from pipeline.tables.taylor import grid
from pipeline.tables.taylor import table as taylor
from pipeline.tables.taylor.table import TaylorTable

POWER, STEP_NM, RESOLUTION = 5.0, 5.0, 501
_TOLERANCE = 1e-4
_SEED = 7


@dataclass(frozen=True)
class PaperTable:
    """A table, the seconds of stack and table together, and those of the table's kernel alone."""

    table: TaylorTable
    quadrature: Quadrature
    seconds: float
    kernel_s: float

    @property
    def pairs(self) -> int:
        """(node, wavelength) pairs of the whole table."""
        return int(np.count_nonzero(self.table.computed)) * len(self.quadrature.lambda_nm)


class Paper:
    """The paper's tables of one surface. Raises AccuracyError where float32 would lose their tolerance."""

    def __init__(self, field: HeightField, config: Config, repeats: int) -> None:
        self._config = config
        plan = expansion.plan_taylor(field, self._quadrature(STEP_NM), _TOLERANCE)
        reachable = expansion.W_MAX / (1e-3 * config.light.lambda_min_nm)

        of = plan.order + 1, config.coherence.sigma_um, reachable, dft_stack.window_tolerance(_TOLERANCE)
        self._stack, self._stack_s = best_of(repeats, lambda: dft_stack.build(field, "taylor", *of))
        # compiles the kernel
        taylor.node_values(self._stack, self._quadrature(STEP_NM), np.zeros((1, 2)))

    def table(self, resolution: int, step_nm: float) -> PaperTable:
        quadrature = self._quadrature(step_nm)
        with device.default_device().timing() as launches:
            table, seconds = timed(lambda: taylor.build(self._stack, quadrature, resolution, POWER))
        return PaperTable(table, quadrature, self._stack_s + seconds, sum(launch.seconds for launch in launches))

    def stage(self, made: PaperTable) -> Timed:
        """Return the work of a table's kernel and its seconds."""
        return Timed(work.paper_table(made.pairs, self._stack), made.kernel_s)

    def numpy_pair_s(self, nodes: int) -> tuple[float, float]:
        """Return the seconds of plain numpy for a (node, wavelength) pair, and its difference from the kernel.

        The difference is the largest difference over the largest I_p, on a few nodes of the paper's grid.
        """
        quadrature, uv = self._quadrature(STEP_NM), _some_nodes(nodes)
        found, seconds = best_of(2, lambda: plain_numpy.paper_nodes(self._stack, quadrature, uv))
        kernel = taylor.node_values(self._stack, quadrature, uv)
        difference = np.max(np.abs(found - kernel)) / max(np.max(np.abs(kernel)), np.finfo(float).tiny)
        return seconds / (nodes * len(quadrature.lambda_nm)), float(difference)

    def _quadrature(self, step_nm: float) -> Quadrature:
        return self._config.radiometry.integrand(step_nm)


def _some_nodes(count: int) -> Array:
    """A few nodes of the paper's grid with u >= 0 and |(u, v)| <= 2, (nodes, 2)."""
    u = grid.nodes(RESOLUTION, POWER)
    v_index, u_index = np.nonzero((u >= 0.0) & (np.hypot(u[:, None], u) <= grid.U_MAX))
    chosen = np.random.default_rng(_SEED).choice(len(u_index), size=count, replace=False)
    return np.stack([u[u_index[chosen]], u[v_index[chosen]]], axis=-1)
