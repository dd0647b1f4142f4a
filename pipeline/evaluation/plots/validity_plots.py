"""Plots of closed forms, of energy and of where the scalar model ends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from pipeline.accuracy.plots import png
from pipeline.arrays import Array

# told apart by people who confuse red and green as well (Okabe and Ito 2008)
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_GREY = "#555555"
# light is right
_MAP = "YlOrRd"
_PERIOD_TICKS = (2, 3, 5, 10, 20)
# x and y
Curve = tuple[Array, Array]


def _tidy(axes: Any) -> None:
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


@dataclass(frozen=True)
class OrderPanel:
    """Orders of one grating under one light: closed form, exact reference and E, each (x, |c_m|^2) by order."""

    title: str
    lines: Mapping[int, Curve]
    dots: Mapping[int, Curve]
    crosses: Mapping[int, Curve]


def order_curves(rows: Sequence[Sequence[OrderPanel]]) -> bytes:
    """|c_m|^2 against wavelength, a row a light."""
    figure = Figure(figsize=(12.0, 6.4), layout="constrained")
    grid = figure.subplots(len(rows), len(rows[0]), sharex=True, sharey=True, squeeze=False)
    orders = list(rows[0][0].lines)
    colours = dict(zip(orders, _COLOURS, strict=False))
    for axes, panel in zip(grid.flat, (panel for row in rows for panel in row), strict=True):
        for order, colour in colours.items():
            # equal orders of a symmetric grating lie on each other: the negative one's dashes show both
            style = (0, (4, 3)) if order < 0 else "-"
            axes.plot(*panel.lines[order], color=colour, linewidth=1.4, linestyle=style, zorder=2 + (order < 0))
            axes.plot(*panel.dots[order], "o", color=colour, markersize=5.5, markerfacecolor="white", zorder=4)
            axes.plot(*panel.crosses[order], "x", color=colour, markersize=4, zorder=5)
        axes.set_title(panel.title, fontsize=11)
        _tidy(axes)
    for axes in grid[-1]:
        axes.set_xlabel("wavelength (nm)")
    for axes in grid[:, 0]:
        axes.set_ylabel("|c_m|², share of the mirror")
    marks = [
        Line2D([], [], color=c, label=f"m = {m:+d}" if m else "m = 0", linewidth=2.2) for m, c in colours.items()
    ]
    marks += [
        Line2D([], [], color=_GREY, label="closed form", linewidth=1.4),
        Line2D([], [], color=_GREY, marker="o", markerfacecolor="white", linestyle="none", label="exact reference"),
        Line2D([], [], color=_GREY, marker="x", linestyle="none", label="polar power spectrum E"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks), frameon=False, fontsize=9)
    return png(figure)


def sampling_curves(
    measured: Mapping[str, Sequence[float]],
    closed: Mapping[str, Sequence[float]],
    samples: NDArray[Any],
    asked: float,
) -> bytes:
    """Largest difference of |c_m|^2 from the profile's against samples a period: measured, and geometric sums."""
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    axes = figure.subplots()
    for colour, name in zip(_COLOURS[1:], measured, strict=False):
        axes.plot(samples, closed[name], color=colour, linewidth=1.4, label=name)
        axes.plot(samples, measured[name], "o", color=colour, markerfacecolor="white", markersize=7)
    axes.axhline(asked, color=_GREY, linestyle=":", linewidth=1.2)
    axes.text(samples[-1], 1.15 * asked, f"asked: {asked:g}", color=_GREY, ha="right", fontsize=9)
    axes.set_xscale("log", base=2)
    axes.set(yscale="log", xlabel="samples a period", ylabel="largest difference of |c_m|²")
    axes.set_xticks(samples, [str(m) for m in samples])
    _tidy(axes)
    axes.legend(frameon=False)
    return png(figure)


def albedo_curves(
    closed: Mapping[str, Curve],
    integrated: Mapping[str, Curve],
    surfaces: Mapping[str, Curve],
    by_period: Mapping[str, Curve],
) -> bytes:
    """Directional albedo of gratings and of other surfaces against the light's angle, and against period."""
    figure = Figure(figsize=(13.0, 4.3), layout="constrained")
    of_gratings, of_surfaces, of_periods = figure.subplots(1, 3, sharey=True)
    colours = dict(zip([*closed, *surfaces], _COLOURS, strict=False))
    for name in closed:
        of_gratings.plot(*closed[name], color=colours[name], linewidth=1.5, label=name)
        style = {"markerfacecolor": "white", "markersize": 7, "clip_on": False, "zorder": 4}
        of_gratings.plot(*integrated[name], "o", color=colours[name], **style)
        of_periods.plot(*by_period[name], color=colours[name], linewidth=1.2, label=name)
    for name, curve in surfaces.items():
        of_surfaces.plot(*curve, "o-", color=colours[name], linewidth=1.5, markersize=4.5, label=name)
    for axes in (of_gratings, of_surfaces):
        axes.set(xlabel="polar angle of the light (°)", xlim=(0.0, 80.0))
    of_periods.set(xscale="log", xlabel="period / wavelength, normal light", xlim=(1.0, 20.0))
    of_periods.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    of_periods.minorticks_off()
    of_gratings.set(ylabel="directional albedo", ylim=(0.0, 1.6))
    for axes in (of_gratings, of_surfaces, of_periods):
        axes.axhline(1.0, color=_GREY, linewidth=1.0, linestyle=":", zorder=1)
        _tidy(axes)
    for axes in (of_gratings, of_surfaces):
        axes.legend(frameon=False, loc="lower left")
    return png(figure)


@dataclass(frozen=True)
class ErrorPanel:
    """Errors (depths, periods) of one grating: of the flat surface's reflectance, and of the rigorous value."""

    title: str
    period: Array
    depth: Array
    absolute: Array
    relative: Array


_LEVELS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)


def error_maps(panels: Sequence[ErrorPanel], tolerated: float) -> bytes:
    """Two rows of maps over period and depth, absolute and relative, with the domain's contour."""
    figure = Figure(figsize=(3.3 * len(panels) + 0.8, 6.4), layout="constrained")
    grid = figure.subplots(2, len(panels), sharex=True, sharey=True, squeeze=False)
    norm = BoundaryNorm(_LEVELS, 256, extend="both")
    for column, panel in enumerate(panels):
        for axes, errors in zip(grid[:, column], (panel.absolute, panel.relative), strict=True):
            _error_map(axes, panel, errors, norm, tolerated)
        grid[0, column].set_title(panel.title, fontsize=11)
        grid[1, column].set_xlabel("period / wavelength")
    for row, what in enumerate(("|error|, share of the flat surface's", "|error|, relative")):
        grid[row, 0].set_ylabel("depth / wavelength")
        shown = ScalarMappable(norm, _MAP)
        bar = figure.colorbar(shown, ax=grid[row], label=what, ticks=_LEVELS, spacing="uniform", aspect=28, pad=0.01)
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
    _log_period(axes)
    axes.set_xlim(panel.period[0], panel.period[-1])


def _log_period(axes: Any) -> None:
    axes.set_xscale("log")
    axes.set_xticks(_PERIOD_TICKS, [str(tick) for tick in _PERIOD_TICKS])
    axes.minorticks_off()


@dataclass(frozen=True)
class EfficiencyPanel:
    """First orders against period for some depths: rigorous (depths, periods), ours and |c_1|^2 (depths, dense)."""

    title: str
    depths: Sequence[float]
    period: Array
    rigorous: Sequence[Array]
    dense: Array
    ours: Array
    bare: Array


def efficiency_curves(rows: Sequence[Sequence[EfficiencyPanel]]) -> bytes:
    """Scalar against rigorous efficiencies, a row a light."""
    figure = Figure(figsize=(3.3 * len(rows[0]) + 0.4, 2.9 * len(rows) + 0.6), layout="constrained")
    grid = figure.subplots(len(rows), len(rows[0]), sharex=True, sharey="col", squeeze=False)
    for axes, panel in zip(grid.flat, (panel for row in rows for panel in row), strict=True):
        for i, colour in enumerate(_COLOURS[: len(panel.depths)]):
            axes.plot(panel.dense, panel.ours[i], color=colour, linewidth=1.6)
            axes.plot(panel.dense, panel.bare[i], color=colour, linewidth=1.0, linestyle=(0, (4, 3)))
            axes.plot(panel.period, panel.rigorous[i], "o", color=colour, markerfacecolor="white", markersize=5.5)
        axes.set_title(panel.title, fontsize=11)
        _log_period(axes)
        _tidy(axes)
    for axes in grid[-1]:
        axes.set_xlabel("period / wavelength")
        # after all is drawn: it ends the search for limits
        axes.set_ylim(bottom=0.0)
    for axes in grid[:, 0]:
        axes.set_ylabel("efficiency of m = 1")
    marks = [
        Line2D([], [], color=colour, label=f"depth {depth:g} λ", linewidth=2.2)
        for colour, depth in zip(_COLOURS, rows[0][0].depths, strict=False)
    ]
    marks += [
        Line2D([], [], color=_GREY, marker="o", markerfacecolor="white", linestyle="none", label="coupled waves"),
        Line2D([], [], color=_GREY, label="|c_1|² G / w²", linewidth=1.6),
        Line2D([], [], color=_GREY, label="|c_1|² alone", linewidth=1.0, linestyle=(0, (4, 3))),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks), frameon=False, fontsize=9)
    return png(figure)
