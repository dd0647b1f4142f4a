"""Plots of the validation report, each returned as PNG bytes."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from threading import Lock
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from pipeline.accuracy.checks import MAP_SIZE, MapCheck
from pipeline.accuracy.convergence import Curve
from pipeline.arrays import Array
from pipeline.diffraction.tiles import AZIMUTHS, RINGS, Tiles
from pipeline.optics.colour import pixels
from pipeline.scene.model import Scene
from pipeline.scene.visited import CELLS, SAMPLES, rho_max, visited
from pipeline.surface.heightfield import HeightField

_DPI = 110
_MOST_PIXELS = 512
# as small as at zlib's usual level 6, in less time
_PNG_LEVEL = 3


def png(figure: Figure) -> bytes:
    """Draws a figure as PNG."""
    buffer = io.BytesIO()
    FigureCanvasAgg(figure)
    # without creation time and version, equal data give equal files
    figure.savefig(
        buffer, format="png", dpi=_DPI, metadata={"Software": None}, pil_kwargs={"compress_level": _PNG_LEVEL}
    )
    return buffer.getvalue()


def height_map(field: HeightField) -> bytes:
    """Plots a height field, nm over um, with y up."""
    figure = Figure(figsize=(5.6, 4.6), layout="constrained")
    axes = figure.subplots()
    skip = max(1, max(field.shape) // _MOST_PIXELS)
    width, height = field.size_um
    extent = (-width / 2, width / 2, -height / 2, height / 2)
    image = axes.imshow(
        1e3 * field.heights_um[::skip, ::skip],
        origin="lower",
        extent=extent,
        cmap="copper",
        interpolation="antialiased",
    )
    axes.set(xlabel="x (µm)", ylabel="y (µm)", title="Height field")
    figure.colorbar(image, label="height (nm)")
    return png(figure)


def _axes_of_map(axes: Any, title: str) -> None:
    axes.set(xlabel="sin θ cos φ", ylabel="sin θ sin φ", title=title)
    axes.set_xticks([-1, 0, 1])
    axes.set_yticks([-1, 0, 1])


def visited_directions(scene: Scene, tiles: Tiles | None = None) -> bytes:
    """Plots what a scene visits: its weight over (u, v), over a table's tiles, and over |(u, v)| and |w|."""
    found = visited(scene, SAMPLES)
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    over_uv, over_w = figure.subplots(1, 2)
    u, v, w = found.uvw.T
    rho, weight = np.hypot(u, v), 100.0 * found.weight
    limits = ((-2.0, 2.0), (-2.0, 2.0))
    _weights(over_uv, np.histogram2d(u, v, CELLS, limits, weights=weight))
    if tiles is not None:
        over_uv.add_collection(LineCollection(_outlines(tiles), colors="0.75", linewidths=0.4, zorder=0))
    # 2 is the horizon of both directions; the second circle ends what a table answers
    for radius, style in ((2.0, "-"), (rho_max(scene), "--")):
        over_uv.add_patch(Circle((0.0, 0.0), radius, fill=False, linestyle=style, color="0.4", linewidth=0.8))
    over_uv.set(xlabel="u", ylabel="v", title="visited (u, v)", aspect="equal")
    image = _weights(over_w, np.histogram2d(rho, np.abs(w), CELLS, ((0.0, 2.0), (0.0, 2.0)), weights=weight))
    ring = np.linspace(0.0, 2.0, 200)
    over_w.plot(ring, np.sqrt(4.0 - ring**2), color="0.4", linewidth=0.8)
    over_w.set(xlabel="|(u, v)|", ylabel="|w|", title="visited |w| at each ring")
    figure.colorbar(image, ax=over_w, label="weight of a cell (%)")
    return png(figure)


def _outlines(tiles: Tiles) -> list[Array]:
    """Computes the outlines (points, 2) of the tiles in (u, v): arcs along their first and last rings."""
    rho, found = tiles.grid.rings.rho(), []
    # the last sector ends where the first begins
    phi = np.append(tiles.grid.azimuths.phi(), tiles.grid.azimuths.phi()[0])
    for band, sector in np.argwhere(tiles.covered):
        ends = rho[[RINGS * band, min(RINGS * (band + 1), len(rho) - 1)]]
        along = phi[AZIMUTHS * sector : AZIMUTHS * (sector + 1) + 1]
        angle, radius = np.concatenate([along, along[::-1]]), np.repeat(ends, len(along))
        outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        found.append(np.concatenate([outline, outline[:1]]))
    return found


def _weights(axes: Any, counted: tuple[Array, Array, Array]) -> Any:
    """Draws weights of cells (x, y), with their edges; empty cells stay white."""
    weight, x, y = counted
    return axes.pcolormesh(x, y, np.where(weight > 0.0, weight, np.nan).T, norm=LogNorm(), cmap="viridis")


@dataclass(frozen=True)
class _Comparison:
    """A figure of three maps; `drawing` is held while it is filled and drawn."""

    figure: Figure
    panels: Sequence[Any]
    images: Sequence[Any]
    drawing: Lock


@cache
def _comparison() -> _Comparison:
    """Makes the figure of all map comparisons: its axes take as long as to draw it."""
    # a constrained layout would take as long as the drawing
    figure = Figure(figsize=(11.0, 3.7))
    panels = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.05, right=0.92, bottom=0.13, top=0.9, wspace=0.25)
    blank = (
        np.zeros((MAP_SIZE, MAP_SIZE, 3), np.uint8),
        np.zeros((MAP_SIZE, MAP_SIZE, 3), np.uint8),
        np.zeros((MAP_SIZE, MAP_SIZE)),
    )
    images = [axes.imshow(one, extent=(-1, 1, -1, 1), cmap="magma") for axes, one in zip(panels, blank, strict=True)]
    for axes in panels:
        _axes_of_map(axes, "")
    figure.colorbar(images[2], cax=figure.add_axes((0.935, 0.13, 0.012, 0.77)), label="ΔE*ab (1976)")
    return _Comparison(figure, panels, images, Lock())


def map_comparison(check: MapCheck, show_ru: float, error_ru: float, light: str) -> bytes:
    """Plots the map of one light: reference, table, and the CIELAB error between them.

    show_ru: exposure of the two maps, RU. error_ru: that of the error, RU, which is [accuracy]'s. light: its name for
    the titles.
    """
    drawn, error = _comparison(), np.where(check.views.inside, check.delta_e, np.nan)
    shown = (pixels(check.reference, show_ru), pixels(check.table, show_ru), error)
    titles = (
        f"reference, {light}, {show_ru:g} RU",
        f"table, {light}, {show_ru:g} RU",
        f"CIELAB error, {error_ru:g} RU",
    )
    with drawn.drawing:
        for axes, image, data, title in zip(drawn.panels, drawn.images, shown, titles, strict=True):
            image.set_data(data)
            axes.set_title(title)
        drawn.images[2].set_clim(0.0, max(1e-3, np.nanpercentile(error, 99.5)))
        return png(drawn.figure)


def convergence(curves: Sequence[Curve], exposure_ru: float) -> bytes:
    """Plots the mean CIELAB error against each setting, at an exposure, RU; the chosen value is marked."""
    figure = Figure(figsize=(11.0, 3.2), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(curves)))
    for axes, curve in zip(panels, curves, strict=True):
        # smaller errors cannot be seen on any display; 1e-6 keeps zeros on the logarithmic axis
        axes.plot(curve.values, np.maximum(curve.errors, 1e-6), "o-", color="#2a6f97")
        axes.axvline(curve.chosen, color="#bb3e03", linestyle="--", linewidth=1, label=f"chosen: {curve.chosen:g}")
        axes.set_yscale("log")
        unit = f" ({curve.unit})" if curve.unit else ""
        axes.set(xlabel=f"{curve.setting}{unit}")
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=8)
    panels[0].set_ylabel(f"mean ΔE at {exposure_ru:g} RU")
    return png(figure)
