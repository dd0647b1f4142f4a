"""Reflectance over viewing angle and wavelength ([D14] fig. 7), and its peaks by the position of the window."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm, PowerNorm
from matplotlib.figure import Figure

from pipeline.accuracy.plots import png
from pipeline.arrays import Array
from pipeline.evaluation.plots.charts import Series
from pipeline.evaluation.plots.palette import BLUE, ORANGE

_DECADES = 7.0
_GAMMA = 0.6
# on grey, against which coloured curves are seen
_MAP = "gray"
_BINS = 60


def reflectance(
    title: str, lambda_nm: Array, whole: tuple[Array, Array], near: tuple[Array, Array], curves: Sequence[Series]
) -> bytes:
    """Draw two images of (angles in degrees, values (angles, L)), PNG: all views, and the first order with curves."""
    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    figure.suptitle(title)
    top = float(whole[1].max())
    _draw(figure, left, lambda_nm, *whole, LogNorm(10.0**-_DECADES * top, top))
    left.set_title("all views, logarithmic", fontsize=10)
    # one speckle grain shall not make all others dark
    bright = float(np.quantile(near[1].max(axis=0), 0.9))
    _draw(figure, right, lambda_nm, *near, PowerNorm(_GAMMA, 0.0, bright))
    right.set_title("the first order and its curves", fontsize=10)
    for curve in curves:
        right.plot(curve.x, curve.y, curve.style, color=curve.colour, label=curve.label, linewidth=1.8)
    legend = right.legend(loc="upper right", fontsize=9, facecolor="#303030", framealpha=0.85, labelcolor="white")
    legend.get_frame().set_edgecolor("none")
    return png(figure)


def _draw(figure: Figure, axes: Any, lambda_nm: Array, angles: Array, values: Array, norm: Any) -> None:
    """Draw an image of values (angles, L) on even steps of both."""
    half_nm, half_deg = 0.5 * (lambda_nm[1] - lambda_nm[0]), 0.5 * (angles[1] - angles[0])
    extent = (lambda_nm[0] - half_nm, lambda_nm[-1] + half_nm, angles[0] - half_deg, angles[-1] + half_deg)
    shown = np.maximum(values, norm.vmin)
    image = axes.imshow(
        shown, norm=norm, cmap=_MAP, extent=extent, origin="lower", aspect="auto", interpolation="nearest"
    )
    axes.set(xlabel="wavelength (nm)", ylabel="viewing angle φ (°)")
    figure.colorbar(image, ax=axes, label="reflectance, C |P|²")


def histograms(panels: Sequence[tuple[str, Array, Sequence[float]]]) -> bytes:
    """Draw a histogram of the brightest period for every surface, PNG; lines mark the middle and sample 0.

    panels: title, periods in nm (positions, positions, 2 sides) of the window, and published periods to mark.
    """
    figure = Figure(figsize=(11.0, 2.9 * len(panels)), layout="constrained")
    rows = np.atleast_1d(figure.subplots(len(panels), 1))
    for axes, (title, all_periods, published) in zip(rows, panels, strict=True):
        ends = [float(all_periods.min()), float(all_periods.max()), *published]
        bins = np.linspace(min(ends), max(ends), _BINS + 1)
        middle = len(all_periods) // 2
        for side, (colour, end) in enumerate(((BLUE, "the axis’ end"), (ORANGE, "its other end"))):
            periods = all_periods[..., side]
            axes.hist(periods.ravel(), bins, color=colour, alpha=0.55, label=f"light from {end}")
            axes.axvline(periods[middle, middle], color=colour, lw=1.6, label="window in the middle")
            axes.axvline(periods[0, 0], color=colour, ls=":", lw=1.8, label="window on sample 0")
        for i, period in enumerate(published):
            axes.axvline(period, color="black", ls="--", lw=1.4, label=None if i else "published")
        axes.set(title=title, xlabel="brightest period (nm)", ylabel="positions of the window")
    handles, names = rows[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return png(figure)
