"""Reflectance over viewing angle and wavelength ([D14] fig. 7), and what the window's place does to its peaks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm, PowerNorm
from matplotlib.figure import Figure

from pipeline.accuracy.plots import png
from pipeline.arrays import Array

_DECADES = 7.0
_GAMMA = 0.6
# on grey, so that curves and image are told apart
_MAP = "gray"
_MEASURED = "#e8000b"
_IDEAL = ("#00c8ff", "#ffd000")
# Okabe and Ito 2008
_SIDES = ("#0072b2", "#e69f00")
_BINS = 60


@dataclass(frozen=True)
class Curve:
    """Viewing angles (L,), degrees, at wavelengths (L,), nm; measured ones are drawn solid."""

    name: str
    lambda_nm: Array
    angle_deg: Array
    measured: bool


@dataclass(frozen=True)
class Places:
    """Periods, nm (places, places, 2 sides); those published; those of the window in the middle and on sample 0."""

    title: str
    periods: Array
    published: Sequence[float]
    middle: Array
    sample_zero: Array


def reflectance(
    title: str, lambda_nm: Array, whole: tuple[Array, Array], near: tuple[Array, Array], curves: Sequence[Curve]
) -> bytes:
    """Two images of (angles in degrees, values (angles, L)): all views in decades, the first order with curves."""
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
    ideal = iter(_IDEAL)
    for curve in curves:
        look: dict[str, Any] = (
            {"color": _MEASURED, "linewidth": 2.2}
            if curve.measured
            else {"color": next(ideal), "linewidth": 1.5, "linestyle": (0, (2.0, 3.0))}
        )
        right.plot(curve.lambda_nm, curve.angle_deg, label=curve.name, **look)
    legend = right.legend(loc="upper right", fontsize=9, facecolor="#303030", framealpha=0.85, labelcolor="white")
    legend.get_frame().set_edgecolor("none")
    return png(figure)


def _draw(figure: Figure, axes: Any, lambda_nm: Array, angles: Array, values: Array, norm: Any) -> None:
    """An image of values (angles, L) on even steps of both."""
    half_nm, half_deg = 0.5 * (lambda_nm[1] - lambda_nm[0]), 0.5 * (angles[1] - angles[0])
    extent = (lambda_nm[0] - half_nm, lambda_nm[-1] + half_nm, angles[0] - half_deg, angles[-1] + half_deg)
    shown = axes.imshow(
        np.maximum(values, norm.vmin),
        norm=norm,
        cmap=_MAP,
        extent=extent,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )
    axes.set(xlabel="wavelength (nm)", ylabel="viewing angle φ (°)")
    figure.colorbar(shown, ax=axes, label="reflectance, C |P|²")


def places(all_places: Sequence[Places]) -> bytes:
    """A histogram for every surface: the brightest period by where the window stands, published ones marked."""
    figure = Figure(figsize=(11.0, 2.9 * len(all_places)), layout="constrained")
    rows = np.atleast_1d(figure.subplots(len(all_places), 1))
    for axes, each in zip(rows, all_places, strict=True):
        low = min(float(each.periods.min()), *each.published)
        high = max(float(each.periods.max()), *each.published)
        bins = np.linspace(low, high, _BINS + 1)
        for side, colour in enumerate(_SIDES):
            name = f"light from {'the axis’ end' if side == 0 else 'its other end'}"
            axes.hist(each.periods[..., side].ravel(), bins, color=colour, alpha=0.55, label=name)
            axes.axvline(each.middle[side], color=colour, linewidth=1.6, label="window in the middle")
            axes.axvline(
                each.sample_zero[side], color=colour, linestyle=":", linewidth=1.8, label="window on sample 0"
            )
        for i, period in enumerate(each.published):
            axes.axvline(period, color="black", linestyle="--", linewidth=1.4, label=None if i else "published")
        axes.set(title=each.title, xlabel="brightest period (nm)", ylabel="places of the window")
    handles, names = rows[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return png(figure)
