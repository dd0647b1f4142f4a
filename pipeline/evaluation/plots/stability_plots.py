"""The stress test as a picture: error against height for both series."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from pipeline.accuracy.plots import png
from pipeline.diffraction.dft_stack import Basis
from pipeline.evaluation.plots import palette
from pipeline.evaluation.stability.case import Algorithm, Precision
from pipeline.evaluation.stability.verdict import CHEBYSHEV_TOLERANCE, Outcome

_CURVES: tuple[tuple[Basis, Precision, str], ...] = (
    ("taylor", "float32", palette.ORANGE),
    ("taylor", "float64", palette.VERMILION),
    ("chebyshev", "float32", palette.SKY),
    ("chebyshev", "float64", palette.BLUE),
)
_LOWEST, _HIGHEST = 1e-13, 1e3


def error_by_height(outcomes: Sequence[Outcome]) -> bytes:
    """Draw the worst error of |P|^2 against the span of heights, a curve a basis and precision, refusals shaded."""
    by_height = [outcome for outcome in outcomes if outcome.case.family.startswith("height")]

    def found(algorithm: Algorithm, basis: Basis, precision: Precision) -> tuple[list[float], list[float]]:
        """Heights and errors of one algorithm, by height."""
        points = sorted(
            (outcome.case.height_um, outcome.speckle_error)
            for outcome in by_height
            if outcome.speckle_error is not None
            and (outcome.case.algorithm, outcome.case.basis, outcome.case.precision) == (algorithm, basis, precision)
        )
        return [height for height, _ in points], [error for _, error in points]

    figure = Figure(figsize=(8.6, 5.2), layout="constrained")
    axes = figure.subplots()
    on_device: dict[str, Any] = {"marker": "o", "linestyle": "none", "markersize": 8, "markerfacecolor": "none"}
    for basis, precision, colour in _CURVES:
        axes.plot(*found("series", basis, precision), ".-", color=colour, label=f"{basis.capitalize()}, {precision}")
        axes.plot(*found("device", basis, precision), color=colour, **on_device)
    axes.plot([], [], color=palette.GREY, label="the same on the device", **on_device)
    refused = [outcome.case.height_um for outcome in by_height if outcome.verdict == "refused"]
    if refused:
        axes.axvspan(min(refused), 1e3, color=palette.ORANGE, alpha=0.10, linewidth=0)
        where = (1.05 * min(refused), 2.5 * _LOWEST)
        axes.text(*where, "the paper's tables, I_p in float32: refused", color=palette.VERMILION, fontsize=9)
    axes.axhline(CHEBYSHEV_TOLERANCE, color=palette.GREY, linestyle=":", linewidth=1)
    axes.text(1e-3, 1.6 * CHEBYSHEV_TOLERANCE, "tolerance of Chebyshev, float32", color=palette.GREY, fontsize=9)
    axes.set(xscale="log", yscale="log", ylim=(_LOWEST, _HIGHEST), xlim=(0.8e-3, 13.0))
    axes.set(
        xlabel="span of heights (µm)",
        ylabel="worst error of |P|² / max(|P|², 1e-3 of its mean)",
        title="Taylor fails where Chebyshev holds",
    )
    axes.grid(alpha=0.25)
    axes.legend(loc="upper left", fontsize=9)
    return png(figure)
