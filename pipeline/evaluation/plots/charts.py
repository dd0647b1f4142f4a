"""Curves in charts, side by side and in rows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from pipeline.accuracy.plots import png
from pipeline.arrays import Array

Scale = Literal["linear", "log"]


@dataclass(frozen=True)
class Series:
    """A curve of a chart.

    label: in the legend; none where it is empty. style: a format string of Matplotlib; "o" alone is drawn hollow.
    """

    label: str
    x: Sequence[float] | Array
    y: Sequence[float] | Array
    colour: str
    style: str = "o-"


@dataclass(frozen=True)
class Chart:
    """Axes of curves. marks: (x, label) of vertical lines. level: (y, label) of a horizontal one.

    floor: on logarithmic axes, smaller values are drawn there. y_limits: None leaves an end to Matplotlib.
    """

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    x_scale: Scale = "linear"
    y_scale: Scale = "log"
    marks: Sequence[tuple[float, str]] = ()
    level: tuple[float, str] | None = None
    floor: float = 1e-5
    y_limits: tuple[float | None, float | None] = (None, None)


def charts(
    rows: Sequence[Sequence[Chart]], size_in: tuple[float, float] = (4.1, 3.7), *, shared_legend: bool = False
) -> bytes:
    """Draw charts in rows, each of a size, PNG; their curves may share one legend below."""
    width, height = size_in
    figure = Figure(figsize=(width * len(rows[0]), height * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), len(rows[0]), squeeze=False)
    for axes, chart in zip(grid.flat, (chart for row in rows for chart in row), strict=True):
        _draw(axes, chart)
        if not shared_legend:
            axes.legend(fontsize=8, framealpha=0.9)
    if shared_legend:
        handles, names = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=9)
    return png(figure)


def _draw(axes: Any, chart: Chart) -> None:
    for each in chart.series:
        y = np.maximum(each.y, chart.floor) if chart.y_scale == "log" else each.y
        face = "white" if each.style == "o" else each.colour
        axes.plot(
            each.x, y, each.style, color=each.colour, label=each.label or None, markerfacecolor=face, lw=1.4, ms=4.5
        )
    axes.set(xscale=chart.x_scale, yscale=chart.y_scale, xlabel=chart.x_label, ylabel=chart.y_label)
    for axis, scale in ((axes.xaxis, chart.x_scale), (axes.yaxis, chart.y_scale)):
        if scale == "log":
            plain_numbers(axis)
        else:
            axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.set_ylim(*chart.y_limits)
    axes.set_title(chart.title, fontsize=11)
    small: dict[str, Any] = {"fontsize": 7.5, "color": "0.3"}
    for x, label in chart.marks:
        axes.axvline(x, color="0.45", linestyle="--", linewidth=0.9)
        axes.text(x, 0.015, f" {label}", transform=axes.get_xaxis_transform(), **small)
    if chart.level is not None:
        y, label = chart.level
        axes.axhline(y, color="0.45", linestyle=":", linewidth=1.0)
        axes.text(0.99, y, label, transform=axes.get_yaxis_transform(), ha="right", va="bottom", **small)
    axes.grid(alpha=0.2, which="major")


def plain_numbers(axis: Any) -> None:
    """Write the ticks of a logarithmic axis as numbers, at 1, 2 and 5 where it spans less than two decades."""
    low, high = axis.get_view_interval()
    if high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
