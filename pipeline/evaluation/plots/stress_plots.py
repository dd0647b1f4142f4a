"""The stress sweep as a picture: where Taylor dies and Chebyshev does not."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from pipeline.accuracy.plots import png
from pipeline.evaluation.stability.judging import CHEBYSHEV_TOLERANCE, Outcome

_CURVES = (
    ("taylor", "float32", "Taylor, float32", "#ca6702"),
    ("taylor", "float64", "Taylor, float64", "#9b2226"),
    ("chebyshev", "float32", "Chebyshev, float32", "#0a9396"),
    ("chebyshev", "float64", "Chebyshev, float64", "#005f73"),
)
_LOWEST, _HIGHEST = 1e-13, 1e3


def error_by_height(outcomes: Sequence[Outcome]) -> bytes:
    """PNG: worst error of |P|^2 against the span of heights, one curve a basis and precision; refusals shaded."""
    figure = Figure(figsize=(8.6, 5.2), layout="constrained")
    axes = figure.subplots()
    for basis, precision, label, colour in _CURVES:
        axes.plot(*_columns(_found(outcomes, "series", basis, precision)), ".-", color=colour, label=label)
        on_device = _found(outcomes, "device", basis, precision)
        axes.plot(*_columns(on_device), "o", color=colour, markerfacecolor="none", markersize=8)
    axes.plot([], [], "o", color="0.3", markerfacecolor="none", markersize=8, label="the same on the device")
    _refusals(axes, outcomes)
    axes.axhline(CHEBYSHEV_TOLERANCE, color="0.3", linestyle=":", linewidth=1)
    axes.text(1e-3, 1.6 * CHEBYSHEV_TOLERANCE, "promised of Chebyshev, float32", color="0.3", fontsize=9)
    axes.set(xscale="log", yscale="log", ylim=(_LOWEST, _HIGHEST), xlim=(0.8e-3, 13.0))
    axes.set(
        xlabel="span of heights (µm)",
        ylabel="worst error of |P|² / max(|P|², 1e-3 of its mean)",
        title="Where Taylor dies and Chebyshev does not",
    )
    axes.grid(alpha=0.25)
    axes.legend(loc="upper left", fontsize=9)
    return png(figure)


def _found(outcomes: Sequence[Outcome], way: str, basis: str, precision: str) -> list[tuple[float, float]]:
    """(height, error) of the height family's cells of one way, by height."""
    return sorted(
        (outcome.cell.height_um, outcome.speckle)
        for outcome in outcomes
        if outcome.speckle is not None
        and outcome.cell.family.startswith("height")
        and (outcome.cell.way, outcome.cell.basis, outcome.cell.precision) == (way, basis, precision)
    )


def _columns(points: list[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [height for height, _ in points], [error for _, error in points]


def _refusals(axes: Any, outcomes: Sequence[Outcome]) -> None:
    """Shades the heights at which the paper's tables are refused."""
    refused = [
        outcome.cell.height_um
        for outcome in outcomes
        if outcome.cell.family.startswith("height") and outcome.verdict == "refused"
    ]
    if refused:
        axes.axvspan(min(refused), axes.get_xlim()[1] * 10.0, color="#ca6702", alpha=0.10, linewidth=0)
        axes.text(
            1.05 * min(refused),
            2.5 * _LOWEST,
            "the paper's tables, I_p in float32: refused",
            color="#9b2226",
            fontsize=9,
        )
