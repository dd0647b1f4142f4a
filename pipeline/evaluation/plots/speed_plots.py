"""The plots of `bench speed`: error against time and against bytes, and cost against the size of a scan."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pipeline.accuracy.plots import png
from pipeline.evaluation.plots import palette
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.speed.growth import STAGES, GrowthCurve
from pipeline.evaluation.speed.suite import (
    NUFFT,
    NUMPY_PAPER,
    NUMPY_POLAR,
    PAPER,
    POLAR,
    TEXTURES,
    Point,
    SurfaceSpeed,
)

_COLOURS = {
    PAPER: palette.VERMILION,
    POLAR: palette.BLUE,
    TEXTURES: palette.PURPLE,
    NUFFT: palette.GREEN,
    NUMPY_PAPER: palette.ORANGE,
    NUMPY_POLAR: palette.SKY,
}
_STAGE_COLOURS = dict(zip(STAGES, (palette.GREEN, palette.VERMILION, palette.BLUE), strict=True))
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def error_against_cost(surfaces: Sequence[SurfaceSpeed], exposure_ru: float) -> bytes:
    """Draw the mean CIELAB error of every table against its seconds and against its bytes."""
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    by_time, by_bytes = figure.subplots(1, 2, sharey=True)
    points = [point for surface in surfaces for point in surface.points]
    methods = [method for method in _COLOURS if any(point.method == method for point in points)]
    markers = {surface.name: _MARKERS[i % len(_MARKERS)] for i, surface in enumerate(surfaces)}
    for surface in surfaces:
        for method in methods:
            style = {"color": _COLOURS[method], "marker": markers[surface.name]}
            for line in _lines([p for p in surface.points if p.method == method]):
                # textures differ in bytes, not in time; by other algorithms the table and its bytes are the same
                if method != TEXTURES:
                    _draw(by_time, line, [p.seconds for p in line], style)
                if method in (PAPER, POLAR, TEXTURES):
                    _draw(by_bytes, line, [p.bytes for p in line], style)
    for axes, cost in ((by_time, "seconds, scan to table (warm)"), (by_bytes, "bytes of the table")):
        axes.set(xscale="log", yscale="log", xlabel=cost)
        axes.grid(alpha=0.25, which="major")
        axes.grid(alpha=0.1, which="minor")
    by_time.set_ylabel(f"mean ΔE*ab (1976) at {exposure_ru:g} RU")
    keys = [_key(name, palette.GREY, marker=marker, linestyle="none") for name, marker in markers.items()]
    by_bytes.legend(handles=keys, loc="best", fontsize=9)
    scaled = {point.method for point in points if point.scaled}
    names = {method: f"{method} (from a sample)" if method in scaled else method for method in methods}
    keys = [_key(names[method], _COLOURS[method], linewidth=2.5) for method in methods]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return png(figure)


def cost_against_size(curve: GrowthCurve) -> bytes:
    """Draw the seconds and the peak memory of every stage against the side of the scan, both axes logarithmic."""
    sides = [size.side for size in curve.sizes]
    seconds, mib, predicted = [], [], []
    for stage, colour in _STAGE_COLOURS.items():
        costs = [size.cost.stage(stage) for size in curve.sizes]
        name = stage.replace("_", " ")
        seconds.append(Series(name, sides, [cost.seconds for cost in costs], colour))
        mib.append(Series(name, sides, [cost.peak_bytes / 2**20 for cost in costs], colour))
        predicted.append(
            Series(f"{name}, predicted", sides, [cost.predicted_bytes / 2**20 for cost in costs], colour, "o:")
        )
    whole = [size.cost.seconds for size in curve.sizes]
    seconds.append(Series("from process start", sides, whole, palette.GREY))
    with_samples = [whole[-1] * (side / sides[-1]) ** 2 for side in sides]
    seconds.append(Series("in proportion to samples", sides, with_samples, palette.GREY, ":"))
    axes: dict[str, Any] = {"x_label": "samples a side", "x_scale": "log"}
    by_time = Chart("Seconds, scan to certified table", y_label="s", series=seconds, **axes)
    by_memory = Chart("Peak memory", y_label="MiB", series=[*mib, *predicted], **axes)
    return charts([[by_time, by_memory]], (5.5, 4.4))


def _key(label: str, colour: str, **style: Any) -> Line2D:
    """An entry of a legend."""
    return Line2D([], [], color=colour, label=label, **style)


def _lines(points: Sequence[Point]) -> list[list[Point]]:
    """The points as curves over one setting each: the paper's over resolution at one step, and over the step."""
    steps = [p for p in points if "step_nm" in p.settings]
    if not steps:
        return [sorted(points, key=lambda p: p.bytes)]
    base = max({p.settings["step_nm"] for p in steps}, key=lambda s: sum(p.settings["step_nm"] == s for p in steps))
    over_grid = [p for p in steps if p.settings["step_nm"] == base]
    sizes = {p.texels for p in steps if p.settings["step_nm"] != base}
    over_step = [p for p in steps if p.texels in sizes]
    return [sorted(over_grid, key=lambda p: p.texels), sorted(over_step, key=lambda p: p.settings["step_nm"])]


def _draw(axes: Any, line: Sequence[Point], cost: Sequence[float], style: dict[str, Any]) -> None:
    # hollow where scaled from a sample
    fill = {"markerfacecolor": "white"} if any(p.scaled for p in line) else {}
    axes.plot(cost, [p.error.mean for p in line], linewidth=1.0, markersize=5, alpha=0.85, **style, **fill)
