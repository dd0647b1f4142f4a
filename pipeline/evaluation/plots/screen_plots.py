"""Images of a screen by each method, and their errors."""

from collections.abc import Mapping

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from pipeline.accuracy.plots import png
from pipeline.arrays import Array
from pipeline.optics.colour import delta_e, pixels

_ERRORS = (0.01, 100.0)


def sheet(truth: Array, images: Mapping[str, Array], side_mm: float, dim_ru: float, bright_ru: float) -> bytes:
    """Draw XYZ images (pixels, pixels, 3) and the exact one at two exposures, with errors at the brighter; PNG."""
    columns = {"exact": truth, **images}
    figure = Figure(figsize=(2.75 * len(columns), 8.4), layout="constrained")
    panels = figure.subplots(3, len(columns), sharex=True, sharey=True)
    half = 0.5 * side_mm
    extent = (-half, half, -half, half)
    scale = LogNorm(*_ERRORS)
    for column, (name, image) in enumerate(columns.items()):
        panels[0, column].set_title(name, fontsize=10)
        for axes, exposure in zip(panels[:2, column], (dim_ru, bright_ru), strict=True):
            axes.imshow(pixels(image, exposure), extent=extent, interpolation="nearest")
        if column > 0:
            error = np.clip(delta_e(image, truth, bright_ru), *_ERRORS)
            panels[2, column].imshow(error, extent=extent, cmap="magma", norm=scale, interpolation="nearest")
            panels[2, column].set_xlabel("x (mm)")
    panels[1, 0].set_xlabel("x (mm)")
    panels[1, 0].tick_params(labelbottom=True)
    for axes, exposure in zip(panels[:2, 0], (dim_ru, bright_ru), strict=True):
        axes.set(ylabel=f"{exposure:g} RU\ny (mm)", xticks=[-half, 0, half], yticks=[-half, 0, half])
    # the exact image has no error: its place holds the scale of the others'
    panels[2, 0].set_axis_off()
    bar = figure.colorbar(ScalarMappable(scale, "magma"), cax=panels[2, 0].inset_axes((0.8, 0.0, 0.1, 1.0)))
    bar.ax.yaxis.set_ticks_position("left")
    bar.ax.yaxis.set_label_position("left")
    bar.set_label(f"ΔE*ab (1976) at {bright_ru:g} RU")
    return png(figure)
