"""The strongest periods of a height field: the lobes of its power spectrum, found by mean shift."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from math import atan2, degrees, log, pi

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.fourier.lengths import next_fast
from pipeline.surface.heightfield import HeightField

# fewer repeats across the patch cannot be distinguished from waviness
_FEWEST_REPEATS = 4.0
# width of the smoothing kernel and radius of a lobe, as shares of the lobe's frequency; and their least values in
# bins, because the window spreads even a single line over some bins
_KERNEL, _KERNEL_BINS = 1 / 6, 1.0
_RADIUS, _RADIUS_BINS = 1 / 6, 3.0
# least power per bin, relative to the mean on the ring of the same |f|; isotropic noise remains below
_LEAST_CONTRAST = 5.0
# a single line with a tenth of the variance is reported even beside lobes of the same |f|, such as a disc's pits: its
# peak exceeds the rest of the ring by _LINE_CONTRAST, and noise of the same frequency, which interferes, leaves this
# share within _LINE_BINS of it
_LINE_SHARE, _LINE_CONTRAST, _LINE_BINS = 0.07, 8.0, 2.0
# least share of the variance
_LEAST_SHARE = 0.005
# rows or columns that are transformed at once
_LINES_AT_ONCE = 32
# how far a kernel's tail is followed, in standard deviations
_KERNEL_SIGMAS = 6.0


@dataclass(frozen=True)
class Period:
    """One line or lobe of the height's power spectrum, at a frequency f.

    period_um: 1 / |f|, um. direction_deg: azimuth of f from +x, degrees, in (-90, 90].
    share: share of the heights' variance in the lobe.
    """

    period_um: float
    direction_deg: float
    share: float


@dataclass(frozen=True)
class _HeightSpectrum:
    """The power spectrum of a windowed height field.

    power: variance per bin (my, mx). fx (mx,), fy (my,): frequencies, 1/um, ascending through 0.
    bin_per_um: distance of the frequencies along (x, y), 1/um. variance: sum of the power over all frequencies.
    """

    power: Array
    fx: Array
    fy: Array
    bin_per_um: tuple[float, float]
    variance: float


def dominant_periods(field: HeightField, highest_per_um: float, count: int = 4) -> tuple[Period, ...]:
    """Finds the strongest lobes of the height's power spectrum.

    A lobe is a mode of the spectrum smoothed over a sixth of its frequency, so that the speckles into which disorder
    splits a line count as one lobe. Its centre is a fixed point of mean shift, which locates a single line to a small
    fraction of a bin. Lobes with fewer than four repeats across the patch, with less than 0.5 % of the variance, or
    hardly brighter than other azimuths of the same |f| are omitted, but no single line with a tenth of the variance.

    field: without holes. highest_per_um: the highest frequency of interest, 1/um. count: the most periods to return.
    Returns the periods by falling share of the variance.
    """
    spectrum = _spectrum(field, highest_per_um, _gaussian)
    finest = cache(lambda: _spectrum(field, highest_per_um, _hann))
    if spectrum.variance == 0:
        return ()
    middles: list[complex] = []
    found: list[Period] = []
    for start in _candidates(spectrum, highest_per_um):
        middle = _middle(spectrum, start)
        if _repeats(spectrum, middle) < 0.95 * _FEWEST_REPEATS or _is_known(spectrum, middle, middles):
            continue
        share = _share(spectrum, middle)
        if share == 0:
            middle, share = _strong_line(finest(), middle)
            if _is_known(spectrum, middle, middles):
                continue
        if share >= _LEAST_SHARE:
            middles.append(middle)
            found.append(_period(middle, share))
        if len(found) == count:
            break
    return tuple(sorted(found, key=lambda period: -period.share))


def _repeats(spectrum: _HeightSpectrum, frequency: complex) -> float:
    """Computes how often a frequency repeats across the patch."""
    return abs(complex(frequency.real / spectrum.bin_per_um[0], frequency.imag / spectrum.bin_per_um[1]))


def _is_known(spectrum: _HeightSpectrum, middle: complex, others: list[complex]) -> bool:
    """Whether the lobe, or its mirror image at -f, overlaps one of the others."""
    rx, ry = _extent(spectrum, middle, _RADIUS, _RADIUS_BINS)
    for other in others:
        qx, qy = _extent(spectrum, other, _RADIUS, _RADIUS_BINS)
        for gap in (middle - other, middle + other):
            if abs(complex(gap.real / (rx + qx), gap.imag / (ry + qy))) < 1:
                return True
    return False


def _extent(spectrum: _HeightSpectrum, frequency: complex, share: float, bins: float) -> tuple[float, float]:
    """Computes a share of |f|, but at least `bins` bins, along (x, y), 1/um."""
    bin_x, bin_y = spectrum.bin_per_um
    return max(share * abs(frequency), bins * bin_x), max(share * abs(frequency), bins * bin_y)


def _period(frequency: complex, share: float) -> Period:
    """Converts the frequency of a lobe, fx + i fy in 1/um, to a period."""
    direction = degrees(atan2(frequency.imag, frequency.real))
    if not -90 < direction <= 90:
        direction += 180 if direction <= -90 else -180
    return Period(1 / abs(frequency), direction, share)


def _spectrum(field: HeightField, highest_per_um: float, window_of: Callable[[int], Array]) -> _HeightSpectrum:
    """Computes the power spectrum of a field for |fx|, |fy| <= `highest_per_um`, under a window along both axes."""
    ny, nx = field.shape
    along_y, along_x = window_of(ny), window_of(nx)
    heights = field.heights_um
    mean = float(np.sum(along_y * np.vecdot(heights, along_x)) / (np.sum(along_y) * np.sum(along_x)))
    weight = float(np.sum(along_y**2) * np.sum(along_x**2))
    x, fx = _ascending(nx, field.pitch_um[0], highest_per_um)
    y, fy = _ascending(ny, field.pitch_um[1], highest_per_um)
    # a real transform gives half of the spectrum; the other half equals it at opposite frequencies
    opposite = x > nx // 2
    columns = np.where(opposite, nx - x, x)
    half = np.empty((ny, int(columns.max(initial=0)) + 1), complex)

    def transform_rows(rows: slice) -> float:
        seen = (heights[rows] - mean) * along_y[rows, None] * along_x
        half[rows] = np.fft.rfft(seen, axis=1)[:, : half.shape[1]]
        # a matrix product would start competing threads
        return float(np.sum(np.vecdot(seen, seen)))

    def transform_columns(part: slice) -> None:
        half[:, part] = np.fft.fft(half[:, part], axis=0)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        # by Parseval's theorem, the sum over all frequencies; the rounding errors of a flat field count as 0
        variance = sum(pool.map(transform_rows, _parts(ny))) / weight
        list(pool.map(transform_columns, _parts(half.shape[1])))
    peak = max(float(heights.max()), -float(heights.min()))
    variance = variance if variance > (1e-12 * peak) ** 2 else 0.0
    power = np.empty((len(y), len(x)))
    for side, rows in ((~opposite, y), (opposite, -y % ny)):
        for part in _parts(len(rows)):
            power[part, side] = np.abs(half[np.ix_(rows[part], columns[side])]) ** 2 / (heights.size * weight)
    size_x, size_y = field.size_um
    return _HeightSpectrum(power, fx, fy, (1 / size_x, 1 / size_y), variance)


def _parts(count: int) -> list[slice]:
    """Divides rows or columns into parts that fit into a core's cache."""
    return [slice(first, min(first + _LINES_AT_ONCE, count)) for first in range(0, count, _LINES_AT_ONCE)]


def _ascending(samples: int, pitch_um: float, highest_per_um: float) -> tuple[np.ndarray, Array]:
    """Returns the indices of a transform and their frequencies, 1/um, ascending from -highest to highest."""
    place, frequency = np.fft.fftshift(np.arange(samples)), np.fft.fftshift(np.fft.fftfreq(samples, pitch_um))
    kept = np.abs(frequency) <= highest_per_um
    return place[kept], frequency[kept]


def _hann(samples: int) -> Array:
    """Returns a centred Hann window (samples,), under which lines are half as wide as under the Gaussian."""
    window: Array = np.cos(np.pi * (np.arange(samples) - 0.5 * (samples - 1)) / (samples + 1)) ** 2
    return window


def _gaussian(samples: int) -> Array:
    """Returns a centred Gaussian window (samples,) whose standard deviation is an eighth of its length.

    It has no side lobes that could be mistaken for lines.
    """
    window: Array = np.exp(-0.5 * ((np.arange(samples) - 0.5 * (samples - 1)) / (samples / 8)) ** 2)
    return window


def _candidates(spectrum: _HeightSpectrum, highest_per_um: float) -> list[complex]:
    """Finds local maxima of the smoothed spectrum in one half plane, as fx + i fy, by falling power of their lobes.

    Each octave of |f| is smoothed by a kernel of its own width. Octaves overlap, so that no maximum lies between two.
    """
    bin_area = spectrum.bin_per_um[0] * spectrum.bin_per_um[1]
    lowest = _FEWEST_REPEATS * min(spectrum.bin_per_um)
    highest = float(np.hypot(np.max(np.abs(spectrum.fx), initial=0.0), np.max(np.abs(spectrum.fy), initial=0.0)))
    candidates: list[tuple[float, complex]] = []
    near: _HeightSpectrum | None = None
    while lowest < highest:
        width_x, width_y = _extent(spectrum, complex(1.4 * lowest), _KERNEL, _KERNEL_BINS)
        # what the kernel moves to the octave, and one bin for the neighbours of a maximum
        reach_x, reach_y = (
            2.5 * lowest + _KERNEL_SIGMAS * width + bin_
            for width, bin_ in zip((width_x, width_y), spectrum.bin_per_um, strict=True)
        )
        before, near = near, _cut(spectrum, reach_x, reach_y)
        if before is None or before.power.shape != near.power.shape:
            transform = np.fft.rfft2(near.power, _fast(near.power.shape))
        density = _smooth(near, transform, width_x, width_y)
        # all power of a lobe narrower than the kernel, and a part of a wider one's: hence the lower threshold
        power_of_density = 2 * 2 * pi * width_x * width_y / bin_area
        bright = np.argwhere(density > 0.25 * _LEAST_SHARE * spectrum.variance / power_of_density)
        fx, fy = near.fx[bright[:, 1]], near.fy[bright[:, 0]]
        radius = np.hypot(fx, fy)
        repeats = np.hypot(fx / spectrum.bin_per_um[0], fy / spectrum.bin_per_um[1])
        wanted = (repeats >= _FEWEST_REPEATS) & (radius <= highest_per_um) & ((fx > 0) | ((fx == 0) & (fy > 0)))
        wanted &= (radius >= 0.8 * lowest) & (radius <= 2.5 * lowest)
        peaks = bright[wanted][_is_maximum(density, bright[wanted])]
        candidates += [(float(density[j, i] * power_of_density), complex(near.fx[i], near.fy[j])) for j, i in peaks]
        lowest *= 2
    candidates.sort(key=lambda entry: -entry[0])
    return [frequency for _, frequency in candidates]


def _is_maximum(density: Array, places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether no neighbour of a place is brighter, (n,); places: rows and columns (n, 2)."""
    (rows, columns), (last_row, last_column) = places.T, (n - 1 for n in density.shape)
    here = density[rows, columns]
    is_highest = np.ones(len(places), bool)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            beside = np.clip(rows + down, 0, last_row), np.clip(columns + right, 0, last_column)
            is_highest &= here >= density[beside]
    return is_highest


def _cut(spectrum: _HeightSpectrum, reach_x: float, reach_y: float) -> _HeightSpectrum:
    """Returns the part of the spectrum with |fx| <= reach_x and |fy| <= reach_y, 1/um."""
    x, y = np.flatnonzero(np.abs(spectrum.fx) <= reach_x), np.flatnonzero(np.abs(spectrum.fy) <= reach_y)
    columns, rows = slice(x[0], x[-1] + 1), slice(y[0], y[-1] + 1)
    return replace(spectrum, power=spectrum.power[rows, columns], fx=spectrum.fx[columns], fy=spectrum.fy[rows])


def _smooth(spectrum: _HeightSpectrum, transform: NDArray[np.complex128], width_x: float, width_y: float) -> Array:
    """Convolves the power with a Gaussian of standard deviations `width_x`, `width_y`, 1/um.

    transform: rfft2 of the power, padded with zeros to sizes with fast transforms.
    """
    my, mx = _fast(spectrum.power.shape)
    gain_x = np.exp(-2 * (pi * width_x / spectrum.bin_per_um[0] * np.fft.rfftfreq(mx)) ** 2)
    gain_y = np.exp(-2 * (pi * width_y / spectrum.bin_per_um[1] * np.fft.fftfreq(my)) ** 2)
    rows, columns = spectrum.power.shape
    smoothed = transform * gain_y[:, None]
    smoothed *= gain_x
    np.fft.ifft(smoothed, axis=0, out=smoothed)
    return np.fft.irfft(smoothed[:rows], mx)[:, :columns]


def _fast(shape: tuple[int, ...]) -> tuple[int, int]:
    """Returns the next sizes with fast transforms."""
    my, mx = (next_fast(n) for n in shape)
    return my, mx


def _near(
    spectrum: _HeightSpectrum, middle: complex, reach_x: float, reach_y: float
) -> tuple[NDArray[np.complex128], Array]:
    """Returns the frequencies fx + i fy within a rectangle about `middle`, and their power, both (n,).

    reach_x, reach_y: half sides of the rectangle, 1/um.
    """
    in_x = np.abs(spectrum.fx - middle.real) <= reach_x
    in_y = np.abs(spectrum.fy - middle.imag) <= reach_y
    frequencies = spectrum.fx[in_x] + 1j * spectrum.fy[in_y][:, None]
    return frequencies.ravel(), spectrum.power[np.ix_(in_y, in_x)].ravel()


def _middle(spectrum: _HeightSpectrum, start: complex) -> complex:
    """Locates the centre of the lobe near `start`.

    Where a single line holds half of the lobe's power, this is the line's frequency: neighbours then do not shift it.
    """
    middle = _mean_shift(spectrum, start, _extent(spectrum, start, _KERNEL, _KERNEL_BINS), reach=2.5)
    line_width = _extent(spectrum, start, 0.0, _KERNEL_BINS)
    frequencies, power = _near(spectrum, middle, *_extent(spectrum, middle, _RADIUS, _RADIUS_BINS))
    line = _mean_shift(spectrum, complex(frequencies[np.argmax(power)]), line_width, reach=4.0)
    line_extent = _extent(spectrum, line, 0.0, _RADIUS_BINS)
    is_line = np.sum(_near(spectrum, line, *line_extent)[1]) > 0.5 * np.sum(power)
    return line if is_line else middle


def _mean_shift(spectrum: _HeightSpectrum, start: complex, width: tuple[float, float], reach: float) -> complex:
    """Locates the mode near `start` of the spectrum smoothed by a Gaussian of standard deviations `width`, 1/um.

    The mode is the fixed point of the kernel-weighted mean of frequencies. Only frequencies within `reach` widths of
    `start` count, because a stronger neighbour, such as a harmonic, would attract the mean.
    """
    frequencies, power = _near(spectrum, start, reach * width[0], reach * width[1])
    middle = start
    for _ in range(200):
        gap = frequencies - middle
        weights = power * np.exp(-0.5 * ((gap.real / width[0]) ** 2 + (gap.imag / width[1]) ** 2))
        shifted = complex(np.sum(weights * frequencies) / np.sum(weights))
        step, middle = abs(shifted - middle), shifted
        if step < 1e-7 * abs(start):
            break
    return middle


def _share(spectrum: _HeightSpectrum, middle: complex) -> float:
    """Computes the share of the variance in the lobes at +-f; 0 for a lobe without contrast to other azimuths."""
    rx, ry = _extent(spectrum, middle, _RADIUS, _RADIUS_BINS)
    frequencies, power = _near(spectrum, middle, rx, ry)
    inside = _inside(frequencies - middle, rx, ry)
    lobe = float(np.sum(power[inside]))
    outermost = abs(middle) + min(rx, ry)
    near = _cut(spectrum, outermost, outermost)
    ring = near.power[np.abs(np.hypot(near.fx, near.fy[:, None]) - abs(middle)) <= min(rx, ry)]
    # lobes hardly change the median of the ring; that of speckle, whose power is exponential, is log 2 of the mean
    noise = float(np.median(ring)) / log(2)
    is_lobe = lobe > _LEAST_CONTRAST * noise * np.count_nonzero(inside)
    return 2 * lobe / spectrum.variance if is_lobe else 0.0


def _strong_line(spectrum: _HeightSpectrum, start: complex) -> tuple[complex, float]:
    """Finds the strongest line near `start`, in a spectrum under a Hann window.

    Returns its frequency and its share of the variance; 0 unless this is about a tenth, and the line exceeds all else
    at the same |f|.
    """
    frequencies, power = _near(spectrum, start, *_extent(spectrum, start, 0.0, _RADIUS_BINS))
    one_bin = _extent(spectrum, start, 0.0, 1.0)
    line = _mean_shift(spectrum, complex(frequencies[np.argmax(power)]), one_bin, reach=_LINE_BINS)
    reach_x, reach_y = _extent(spectrum, line, 0.0, _LINE_BINS)
    frequencies, power = _near(spectrum, line, reach_x, reach_y)
    core = power[_inside(frequencies - line, reach_x, reach_y)]
    share = 2 * float(np.sum(core)) / spectrum.variance
    if share < _LINE_SHARE or _repeats(spectrum, line) < 0.95 * _FEWEST_REPEATS:
        return line, 0.0
    outermost = abs(line) + min(reach_x, reach_y)
    near = _cut(spectrum, outermost, outermost)
    all_frequencies = near.fx + 1j * near.fy[:, None]
    ring = np.abs(np.abs(all_frequencies) - abs(line)) <= min(reach_x, reach_y)
    for lobe in (line, -line):
        ring &= ~_inside(all_frequencies - lobe, 1.5 * reach_x, 1.5 * reach_y)
    noise = float(np.median(near.power[ring])) / log(2) if ring.any() else 0.0
    return line, share if float(np.max(core)) > _LINE_CONTRAST * noise else 0.0


def _inside(gaps: NDArray[np.complex128], rx: float, ry: float) -> NDArray[np.bool_]:
    """Whether frequencies relative to a middle lie within the ellipse of radii rx, ry, 1/um."""
    within: NDArray[np.bool_] = (gaps.real / rx) ** 2 + (gaps.imag / ry) ** 2 <= 1
    return within
