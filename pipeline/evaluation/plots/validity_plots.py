"""The scalar model's error over period and depth."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure

from pipeline.accuracy.plots import png
from pipeline.arrays import Array

# light is right
_MAP = "YlOrRd"
_PERIOD_TICKS = (2, 3, 5, 10, 20)
_LEVELS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)


@dataclass(frozen=True)
class ErrorPanel:
    """Errors (depths, periods) of one grating: of the flat surface's reflectance, and of the rigorous value."""

    title: str
    period: Array
    depth: Array
    absolute: Array
    relative: Array


def error_maps(panels: Sequence[ErrorPanel], tolerated: float) -> bytes:
    """Draw two rows of maps over period and depth, absolute and relative, with the contour of the domain; PNG."""
    figure = Figure(figsize=(3.3 * len(panels) + 0.8, 6.4), layout="constrained")
    grid = figure.subplots(2, len(panels), sharex=True, sharey=True, squeeze=False)
    norm = BoundaryNorm(_LEVELS, 256, extend="both")
    for column, panel in enumerate(panels):
        for axes, errors in zip(grid[:, column], (panel.absolute, panel.relative), strict=True):
            _error_map(axes, panel, errors, norm, tolerated)
        grid[0, column].set_title(panel.title, fontsize=11)
        grid[1, column].set_xlabel("period / wavelength")
    for row, label in enumerate(("|error|, share of the flat surface's", "|error|, relative")):
        grid[row, 0].set_ylabel("depth / wavelength")
        shown = ScalarMappable(norm, _MAP)
        bar = figure.colorbar(shown, ax=grid[row], label=label, ticks=_LEVELS, spacing="uniform", aspect=28, pad=0.01)
        bar.ax.set_yticklabels([f"{level:g}" for level in _LEVELS])
        bar.ax.axhline(tolerated, color="black", linewidth=2.0)
    return png(figure)


def _error_map(axes: Any, panel: ErrorPanel, errors: Array, norm: Any, tolerated: float) -> None:
    # an exact crossing of zero is no level of a logarithmic scale
    shown = np.maximum(errors, 0.1 * _LEVELS[0])
    axes.contourf(panel.period, panel.depth, shown, levels=_LEVELS, norm=norm, cmap=_MAP, extend="both")
    if np.any(errors > tolerated) and np.any(errors < tolerated):
        axes.contour(panel.period, panel.depth, shown, levels=[tolerated], colors="black", linewidths=2.0)
    x, y = np.meshgrid(panel.period, panel.depth)
    axes.plot(x.ravel(), y.ravel(), ".", color="black", markersize=1.6, alpha=0.5)
    axes.set_xscale("log")
    axes.set_xticks(_PERIOD_TICKS, [str(tick) for tick in _PERIOD_TICKS])
    axes.minorticks_off()
    axes.set_xlim(panel.period[0], panel.period[-1])
