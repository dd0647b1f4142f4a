"""Draws docs/spectral_operator.svg: the lines of a ring through the (r, s) plane, and the points that rings share.

python docs/spectral_operator_figure.py
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# um; rho of the first ring; t of the ring that shares its lines; radii, twenty times as far apart as they are
SHORTEST, LONGEST, RHO, T, SPACING = 0.38, 0.78, 0.8, 1.15, 0.19
S_NODES, W_TERMS, ORDER = 14, 4, 8
S_MAX = 1.1 * 4.0 * np.pi / SHORTEST
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "0.75"


def nodes(count: int) -> np.ndarray:
    """Chebyshev's nodes on [0, 1], (count,)."""
    return 0.5 * (1.0 + np.cos(np.pi * (np.arange(count) + 0.5) / count))


def plane(axes: Axes) -> None:
    """The grid of E, and where one ring asks for it."""
    low, high, w_max = 1.0 / LONGEST, 1.0 / SHORTEST, np.sqrt(4.0 - RHO**2)
    radii = np.arange(0.0, 2.7, SPACING)
    axes.vlines(radii, 0.0, S_MAX, color=GREY, lw=0.6)
    axes.hlines(S_MAX * nodes(S_NODES), 0.0, radii[-1], color=GREY, lw=0.6)
    for m, w in enumerate(w_max * nodes(W_TERMS)):
        slope = 2.0 * np.pi * w / RHO
        on = radii[(radii > RHO * low - SPACING) & (radii < RHO * high + SPACING)]
        lit = RHO * np.array([low, high])
        axes.plot([0.0, on[-1]], [0.0, slope * on[-1]], color=BLUE, lw=0.8, ls=":")
        axes.plot(lit, slope * lit, color=BLUE, lw=1.8)
        axes.plot(on, slope * on, "o", color=BLUE, ms=4)
        axes.annotate(f"$w_{m}$", (on[-1] + 0.04, slope * on[-1]), color=BLUE, va="center")
    axes.axhline(2.0 * np.pi * w_max * high, color=ORANGE, lw=0.8, ls="--")
    axes.text(0.03, 2.0 * np.pi * w_max * high - 0.3, r"$2\pi w_{max}/\lambda_{min}$", color=ORANGE, va="top")
    axes.set(
        xlim=(0.0, radii[-1]),
        ylim=(0.0, S_MAX),
        xlabel=r"$r = |f| = \rho\,\kappa$, 1/um",
        ylabel=r"$s = 2\pi\,|w|\,\kappa$, 1/um",
        title=rf"E's radii and nodes in s; lines of the ring $\rho$ = {RHO}",
    )


def line(axes: Axes) -> None:
    """One line over kappa: the points of a group, and the wavelengths of two of its rings."""
    lambdas = np.linspace(LONGEST, SHORTEST, 17)
    first, last = np.floor(RHO / LONGEST / SPACING) - 3, np.ceil(T * RHO / SHORTEST / SPACING) + 3
    points = np.arange(first, last + 1) * SPACING / RHO
    axes.plot(points, np.zeros(len(points)), "o", color=BLUE, ms=5)
    for height, at in ((1.0, 1.0 / lambdas), (2.0, T / lambdas)):
        axes.plot(at, np.full(len(at), height), "|", color=ORANGE, ms=11, mew=1.4)
    wanted = 1.0 / lambdas[8]
    begin = np.searchsorted(points, wanted) - ORDER // 2
    for kappa in points[begin : begin + ORDER]:
        axes.plot([kappa, wanted], [0.06, 0.88], color=GREY, lw=0.9, zorder=0)
    axes.set_yticks(
        [0.0, 1.0, 2.0],
        [r"points $\kappa_p$", "wavelengths of\nring $\\rho$: $1/\\lambda$", "of ring $t\\rho$:\n$t/\\lambda$"],
    )
    axes.set(
        ylim=(-0.6, 2.6),
        xlabel=r"$\kappa$ on the line of the ring $\rho$, 1/um",
        title=rf"One line for two rings, t = {T}; Lagrange on {ORDER} points",
    )


def main() -> None:
    # the same bytes from the same drawing
    mpl.rcParams.update({"svg.hashsalt": "spectral_operator", "font.size": 9, "axes.titlesize": 9})
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(5, 4))
    plane(left)
    line(right)
    figure.savefig(Path(__file__).with_name("spectral_operator.svg"), metadata={"Date": None})


if __name__ == "__main__":
    main()
