"""What a height field is like, in numbers a person can check before baking it."""

from dataclasses import dataclass
from math import asin, pi, sqrt

import numpy as np

from pipeline.arrays import Array
from pipeline.fourier import backend as fourier
from pipeline.surface.heightfield import HeightField
from pipeline.surface.periods import Period, dominant_periods

# [D14] 6.3 takes 500 nm for all visible light
_REPRESENTATIVE_WAVELENGTH_UM = 0.5


@dataclass(frozen=True)
class SurfaceStatistics:
    """Every value is JSON-able; pairs are (x, y).

    size_um, shape (ny, nx), pitch_um: of the patch.
    sigma_h_um: standard deviation of the height; range_um: peak to valley.
    g: (2 pi sigma_h / 0.5 um)^2, [D14] 6.3: below 1 Born's approximation would do, above 1 ray optics.
    band_limit_per_um: highest frequency the samples carry; reach_per_um: highest that light can ask for,
    2 / lambda_min; reach_covered: share of the disc of radius reach_per_um inside the band.
    periods: the strongest periods, by share.
    seam_step_um: rms height step across the seam from the last column (row) to the first;
    inner_step_um: rms step between neighbouring columns (rows) inside.
    seam_energy: share of the heights' variance that only closes the patch's edges upon each other;
    windows: patch size over the coherence window's sigma.
    """

    size_um: tuple[float, float]
    shape: tuple[int, int]
    pitch_um: tuple[float, float]
    sigma_h_um: float
    range_um: float
    g: float
    band_limit_per_um: tuple[float, float]
    reach_per_um: float
    reach_covered: float
    periods: tuple[Period, ...]
    seam_step_um: tuple[float, float]
    inner_step_um: tuple[float, float]
    seam_energy: float
    windows: tuple[float, float]


def measure(field: HeightField, sigma_um: float, lambda_min_nm: float) -> SurfaceStatistics:
    """The statistics of a field without holes.

    sigma_um: the coherence window's; lambda_min_nm: the shortest wavelength that will be asked for.
    """
    heights = field.heights_um
    sigma_h = float(np.std(heights))
    reach = 2e3 / lambda_min_nm
    size_x, size_y = field.size_um
    return SurfaceStatistics(
        size_um=field.size_um,
        shape=field.shape,
        pitch_um=field.pitch_um,
        sigma_h_um=sigma_h,
        range_um=2 * field.half_range_um,
        g=(2 * pi * sigma_h / _REPRESENTATIVE_WAVELENGTH_UM) ** 2,
        band_limit_per_um=field.band_limit_per_um,
        reach_per_um=reach,
        reach_covered=covered_share(*field.band_limit_per_um, reach),
        periods=dominant_periods(field, reach),
        seam_step_um=(_rms(heights[:, 0] - heights[:, -1]), _rms(heights[0] - heights[-1])),
        inner_step_um=(_rms(np.diff(heights, axis=1)), _rms(np.diff(heights, axis=0))),
        seam_energy=_seam_energy(heights),
        windows=(size_x / sigma_um, size_y / sigma_um),
    )


def _seam_energy(heights: Array) -> float:
    """Share of the variance in the smooth part of Moisan's decomposition (2011): a periodic surface has none.

    The part solves a Poisson equation whose sources are the steps across the patch's edges.
    """
    ny, nx = heights.shape
    turn_x, turn_y = (2.0 * np.pi * np.arange(n) / n for n in (nx, ny))
    # sources are two rows and two columns, whose transforms are those of lines
    rows = fourier.fft(heights[-1] - heights[0]) * (1.0 - np.exp(1j * turn_y))[:, None]
    columns = fourier.fft(heights[:, -1] - heights[:, 0])[:, None] * (1.0 - np.exp(1j * turn_x))
    waves = 2.0 * np.cos(turn_y)[:, None] + 2.0 * np.cos(turn_x)
    waves[0, 0] = np.inf  # the mean, relative to 4
    smooth = float(np.sum(np.abs((rows + columns) / (waves - 4.0)) ** 2)) / heights.size**2
    variance = float(np.var(heights))
    return smooth / variance if variance > 0.0 else 0.0


def _rms(values: Array) -> float:
    """Root mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def covered_share(half_width: float, half_height: float, radius: float) -> float:
    """Share of the disc of `radius` inside the centred box |fx| <= half_width, |fy| <= half_height; exact."""
    a, b = min(half_width, radius), min(half_height, radius)
    # where the disc's rim leaves the box's upper side
    corner = min(a, sqrt(radius**2 - b**2))
    quarter = b * corner + _under_arc(a, radius) - _under_arc(corner, radius)
    return 4 * quarter / (pi * radius**2)


def _under_arc(x: float, radius: float) -> float:
    """Integral of sqrt(radius^2 - x^2) from 0 to x."""
    return 0.5 * (x * sqrt(radius**2 - x**2) + radius**2 * asin(x / radius))
