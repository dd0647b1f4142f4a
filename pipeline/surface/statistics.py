"""Statistics of a height field, to check before a bake."""

from dataclasses import dataclass
from math import asin, pi, sqrt

import numpy as np

from pipeline.arrays import Array
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.periods import Period, dominant_periods

# [D14] sec. 6.3 takes 500 nm for all visible light
_REPRESENTATIVE_WAVELENGTH_UM = 0.5
# rows of a spectrum or of heights that are held at once
_ROWS_AT_ONCE = 64


@dataclass(frozen=True)
class SurfaceStatistics:
    """Statistics of one height field; every value can be written as JSON, and pairs are (x, y).

    size_um, shape (ny, nx), pitch_um: of the patch.
    sigma_h_um: standard deviation of the heights. range_um: peak to valley.
    g: (2 pi sigma_h / 0.5 um)^2, [D14] sec. 6.3: well below 1 Born's approximation holds, well above 1 ray optics.
    band_limit_per_um: Nyquist limits. reach_per_um: the highest frequency that light can reach, 2 / lambda_min.
    reach_covered: share of the disc of radius reach_per_um within the Nyquist limits.
    periods: the strongest periods, by falling share.
    seam_step_um: rms height step across the seam, from the last column (row) to the first.
    inner_step_um: rms height step between neighbouring columns (rows) inside the patch.
    seam_energy: share of the heights' variance in the smooth component that joins opposite edges (Moisan 2011).
    windows: size of the patch over sigma of the coherence window.
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
    """Measures the statistics of a field without holes.

    sigma_um: standard deviation of the coherence window, um. lambda_min_nm: the shortest wavelength, nm.
    """
    heights = field.heights_um
    variance = _variance(heights)
    sigma_h = sqrt(variance)
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
        inner_step_um=(_inner_step(heights.T), _inner_step(heights)),
        seam_energy=_seam_energy(heights, variance),
        windows=(size_x / sigma_um, size_y / sigma_um),
    )


def measuring_bytes(extent: Extent, lambda_min_nm: float) -> int:
    """Computes the memory in which `measure` works, bytes.

    In `periods`, the half of the transform along x that views can reach and eight arrays of the frequencies that they
    can reach.
    """
    share_x, share_y = (min(1.0, 2.0 * pitch * 2e3 / lambda_min_nm) for pitch in extent.pitch_um)
    return 8 * round(extent.samples * (share_x + 8 * share_x * share_y))


def _variance(heights: Array) -> float:
    """Computes the mean square deviation from the mean, um^2."""
    mean, total = float(np.mean(heights)), 0.0
    for first in range(0, len(heights), _ROWS_AT_ONCE):
        deviations = heights[first : first + _ROWS_AT_ONCE] - mean
        total += float(np.sum(np.vecdot(deviations, deviations)))
    return total / heights.size


def _seam_energy(heights: Array, variance: float) -> float:
    """Computes the share of the variance in the smooth component of Moisan's decomposition (2011).

    The component solves a Poisson equation whose sources are the steps across the seams; it is 0 for a periodic
    surface.
    """
    ny, nx = heights.shape
    # heights are real: the other half of the columns holds conjugates, which counts a column twice
    turn_x = 2.0 * np.pi * np.arange(nx // 2 + 1) / nx
    turn_y = 2.0 * np.pi * np.arange(ny) / ny
    twice = np.full(nx // 2 + 1, 2.0)
    twice[[0, *([-1] if nx % 2 == 0 else [])]] = 1.0
    # the sources lie in two rows and two columns, so that one-dimensional transforms suffice
    across, along = np.fft.rfft(heights[-1] - heights[0]), np.fft.fft(heights[:, -1] - heights[:, 0])
    step_x, step_y = 1.0 - np.exp(1j * turn_x), 1.0 - np.exp(1j * turn_y)
    smooth = 0.0
    for first in range(0, ny, _ROWS_AT_ONCE):
        rows = slice(first, first + _ROWS_AT_ONCE)
        sources = across * step_y[rows, None] + along[rows, None] * step_x
        waves = 2.0 * np.cos(turn_y[rows])[:, None] + 2.0 * np.cos(turn_x)
        if first == 0:
            waves[0, 0] = np.inf  # removes the mean, for which waves - 4 would be 0
        smooth += float(np.sum(twice * (sources.real**2 + sources.imag**2) / (waves - 4.0) ** 2))
    smooth /= heights.size**2
    return smooth / variance if variance > 0.0 else 0.0


def _inner_step(lines: Array) -> float:
    """Computes the root mean square of the differences between neighbouring lines (n, length)."""
    total = 0.0
    for first in range(0, len(lines) - 1, _ROWS_AT_ONCE):
        total += float(np.sum(np.diff(lines[first : first + _ROWS_AT_ONCE + 1], axis=0) ** 2))
    return sqrt(total / max(1, (len(lines) - 1) * lines.shape[1]))


def _rms(values: Array) -> float:
    """Computes the root mean square; 0 for an empty array."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def covered_share(half_width: float, half_height: float, radius: float) -> float:
    """Computes the share of the disc of `radius` within the box |fx| <= half_width, |fy| <= half_height, exactly."""
    a, b = min(half_width, radius), min(half_height, radius)
    # x at which the circle meets the upper side of the box
    corner = min(a, sqrt(radius**2 - b**2))
    quarter = b * corner + _under_arc(a, radius) - _under_arc(corner, radius)
    return 4 * quarter / (pi * radius**2)


def _under_arc(x: float, radius: float) -> float:
    """Integrates sqrt(radius^2 - x^2) from 0 to x."""
    return 0.5 * (x * sqrt(radius**2 - x**2) + radius**2 * asin(x / radius))
