"""The benchmark's plot: error against time, error against bytes."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pipeline.accuracy.plots import png
from pipeline.evaluation.speed.suite import (
    METHODS,
    NUFFT,
    NUMPY_PAPER,
    NUMPY_POLAR,
    PAPER,
    POLAR,
    TEXTURES,
    Point,
    SurfaceBench,
)

# told apart by people who confuse red and green as well (Okabe and Ito 2008)
_COLOURS = {
    PAPER: "#d55e00",
    POLAR: "#0072b2",
    TEXTURES: "#cc79a7",
    NUFFT: "#009e73",
    NUMPY_PAPER: "#e69f00",
    NUMPY_POLAR: "#56b4e9",
}
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def error_against_cost(surfaces: Sequence[SurfaceBench], exposure_ru: float) -> bytes:
    """Mean CIELAB error of every table against the seconds it takes and against its bytes, as PNG."""
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    by_time, by_bytes = figure.subplots(1, 2, sharey=True)
    methods = [m for m in METHODS if any(p.method == m for s in surfaces for p in s.points)]
    for i, surface in enumerate(surfaces):
        for method in methods:
            style = {"color": _COLOURS[method], "marker": _MARKERS[i % len(_MARKERS)]}
            for line in _lines([p for p in surface.points if p.method == method]):
                # textures differ in bytes, not in time; in other hands the table and its bytes are the same
                if method != TEXTURES:
                    _draw(by_time, line, [p.seconds for p in line], style)
                if method in (PAPER, POLAR, TEXTURES):
                    _draw(by_bytes, line, [float(p.bytes) for p in line], style)
    _label(by_time, "seconds, scan to table (warm)")
    _label(by_bytes, "bytes of the table")
    by_time.set_ylabel(f"mean ΔE*ab (1976) at {exposure_ru:g} RU")
    by_bytes.legend(handles=_marks(surfaces), loc="best", fontsize=9)
    colours = _colours(surfaces, methods)
    figure.legend(handles=colours, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return png(figure)


def _lines(points: Sequence[Point]) -> list[list[Point]]:
    """The points as curves over one setting each: the paper's over resolution at one step, and over the step."""
    steps = [p for p in points if p.settings.get("step_nm") is not None]
    if not steps:
        return [sorted(points, key=lambda p: p.bytes)]
    base = max({p.settings["step_nm"] for p in steps}, key=lambda s: sum(p.settings["step_nm"] == s for p in steps))
    over_grid = [p for p in steps if p.settings["step_nm"] == base]
    sizes = {p.texels for p in steps if p.settings["step_nm"] != base}
    over_step = [p for p in steps if p.texels in sizes]
    return [sorted(over_grid, key=lambda p: p.texels), sorted(over_step, key=lambda p: p.settings["step_nm"])]


def _draw(axes: Any, line: Sequence[Point], cost: Sequence[float], style: dict[str, Any]) -> None:
    # what is scaled from a sample is drawn hollow
    fill = {"markerfacecolor": "white"} if any(p.scaled for p in line) else {}
    axes.plot(cost, [p.error.mean for p in line], linewidth=1.0, markersize=5, alpha=0.85, **style, **fill)


def _label(axes: Any, cost: str) -> None:
    axes.set(xscale="log", yscale="log", xlabel=cost)
    axes.grid(alpha=0.25, which="major")
    axes.grid(alpha=0.1, which="minor")


def _colours(surfaces: Sequence[SurfaceBench], methods: Sequence[str]) -> list[Line2D]:
    """What stands for each method."""
    scaled = {p.method for s in surfaces for p in s.points if p.scaled}
    names = {m: f"{m} (from a sample)" if m in scaled else m for m in methods}
    return [Line2D([], [], color=_COLOURS[m], label=names[m], linewidth=2.5) for m in methods]


def _marks(surfaces: Sequence[SurfaceBench]) -> list[Line2D]:
    """What stands for each surface."""
    return [
        Line2D([], [], color="#444444", marker=_MARKERS[i % len(_MARKERS)], linestyle="none", label=s.name)
        for i, s in enumerate(surfaces)
    ]
