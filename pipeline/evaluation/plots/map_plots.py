"""BRDF maps in sheets, and methods by run time and error."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from pipeline.accuracy.plots import png
from pipeline.evaluation.plots.charts import plain_numbers

_INK, _GROUND, _DIM = "#f2f2f2", "#000000", "#9a9a9a"
_CELL_IN, _GAP_IN, _TITLE_IN, _NOTE_IN, _HEAD_IN, _LEFT_IN = 2.6, 0.16, 0.5, 0.24, 0.5, 0.42


@dataclass(frozen=True)
class Panel:
    """One BRDF map: 8-bit pixels (size, size, 3), first row at the top, with two lines above it."""

    pixels: NDArray[np.uint8]
    title: str
    note: str = ""


def sheet(rows: Sequence[Sequence[Panel]], heading: str, row_names: Sequence[str] = ()) -> bytes:
    """Draw maps of equal size on black, row by row, under a heading; `row_names` to their left. PNG."""
    left = _LEFT_IN if row_names else _GAP_IN
    words = [_TITLE_IN if any(panel.title for panel in row) else _NOTE_IN for row in rows]
    width = left + max(len(row) for row in rows) * (_CELL_IN + _GAP_IN)
    height = _HEAD_IN + sum(words) + len(rows) * (_CELL_IN + _GAP_IN)
    figure = Figure(figsize=(width, height), facecolor=_GROUND)
    figure.text(0.5, 1.0 - 0.5 * _HEAD_IN / height, heading, color=_INK, ha="center", va="center", fontsize=12)
    bottom = height - _HEAD_IN + _GAP_IN
    for i, row in enumerate(rows):
        bottom -= words[i] + _CELL_IN + _GAP_IN
        if row_names:
            place = (0.5 * left / width, (bottom + 0.5 * _CELL_IN) / height)
            figure.text(*place, row_names[i], color=_INK, rotation=90, ha="center", va="center", fontsize=11)
        for j, panel in enumerate(row):
            x = left + j * (_CELL_IN + _GAP_IN)
            box = (x / width, bottom / height, _CELL_IN / width, _CELL_IN / height)
            _draw_map(figure.add_axes(box), panel)
    return png(figure)


def _draw_map(axes: Any, panel: Panel) -> None:
    """The map in the unit disc, its rim drawn, its titles above."""
    axes.imshow(panel.pixels, extent=(-1, 1, -1, 1), interpolation="antialiased")
    axes.add_patch(Circle((0, 0), 1.0, fill=False, color="#4a4a4a", linewidth=0.6))
    axes.set(xlim=(-1.01, 1.01), ylim=(-1.01, 1.01))
    axes.set_axis_off()
    axes.text(0.0, 1.22, panel.title, color=_INK, ha="center", va="center", fontsize=10)
    axes.text(0.0, 1.085, panel.note, color=_DIM, ha="center", va="center", fontsize=8)


@dataclass(frozen=True)
class Cost:
    """A method's cost: seconds of the map alone and with its preparation, its mean error, and its colour."""

    name: str
    map_s: float
    total_s: float
    error: float
    colour: str


def costs(points: Sequence[Cost], error_label: str, title: str, reference: tuple[float, str]) -> bytes:
    """Draw time against error, PNG: filled with preparation, hollow without.

    reference: seconds and name of what has no error, a vertical line.
    """
    figure = Figure(figsize=(9.4, 5.6), layout="constrained")
    axes = figure.subplots()
    placed: list[tuple[float, float]] = []
    for point in sorted(points, key=lambda point: point.error):
        axes.plot([point.map_s, point.total_s], [point.error] * 2, color=point.colour, linewidth=1.2, alpha=0.5)
        axes.plot(point.map_s, point.error, "o", color=point.colour, markerfacecolor="white", markersize=6)
        axes.plot(point.total_s, point.error, "o", color=point.colour, markersize=8)
        place = _free(placed, point)
        placed.append(place)
        axes.annotate(
            point.name,
            (point.total_s, point.error),
            (10.0 ** place[0], 10.0 ** place[1]),
            fontsize=10,
            va="center",
            color=point.colour,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
        )
    axes.axvline(reference[0], color="0.45", linestyle="--", linewidth=0.9)
    axes.text(reference[0], 0.985, f" {reference[1]}", transform=axes.get_xaxis_transform(), color="0.3", va="top")
    axes.plot([], [], "o", color="0.3", label="height field to map")
    axes.plot([], [], "o", color="0.3", markerfacecolor="white", label="the map alone")
    low, high = min(p.map_s for p in points), max(p.total_s for p in points)
    errors = [p.error for p in points]
    axes.set(xscale="log", yscale="log", xlim=(0.5 * low, 6.0 * max(high, reference[0])))
    axes.set(ylim=(0.5 * min(errors), 2.0 * max(errors)))
    axes.set(xlabel="seconds", ylabel=error_label, title=title)
    for axis in (axes.xaxis, axes.yaxis):
        plain_numbers(axis)
    axes.grid(alpha=0.2, which="major")
    axes.legend(loc="center left", fontsize=9)
    return png(figure)


def _free(placed: Sequence[tuple[float, float]], point: Cost) -> tuple[float, float]:
    """Position of a label, as powers of ten: right of its point, above labels that are there already."""
    x, y = np.log10(point.total_s) + 0.06, np.log10(point.error)
    while any(abs(x - other_x) < 1.0 and abs(y - other_y) < 0.13 for other_x, other_y in placed):
        y += 0.14
    return float(x), float(y)
