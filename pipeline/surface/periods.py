"""The strongest periods of a height field: lobes of its power spectrum, found by mean shift."""

from dataclasses import dataclass
from math import atan2, degrees, log, pi

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from pipeline.arrays import Array
from pipeline.fourier import backend as fourier
from pipeline.surface.heightfield import HeightField

# a period must repeat this often across the patch to be told from waviness
_FEWEST_REPEATS = 4.0
# of a lobe's frequency: the kernel that finds its middle, and the radius whose power is its share; never
# less than these numbers of bins, in which the window spreads even a single line
_KERNEL, _KERNEL_BINS = 1 / 6, 1.0
_RADIUS, _RADIUS_BINS = 1 / 6, 3.0
# power per bin over that of its ring; noise without a direction stays below
_LEAST_CONTRAST = 5.0
_LEAST_SHARE = 0.005


@dataclass(frozen=True)
class Period:
    """One line or lobe of the height's power spectrum.

    period_um: 1 / |f|; direction_deg: azimuth of the frequency vector from +x, in (-90, 90].
    share: part of the height's variance in the lobe.
    """

    period_um: float
    direction_deg: float
    share: float


@dataclass(frozen=True)
class _HeightSpectrum:
    """Power (variance a bin) of a windowed field on centred frequencies fx (mx,), fy (my,), 1/um."""

    power: Array
    fx: Array
    fy: Array
    bin_per_um: tuple[float, float]
    variance: float


def dominant_periods(field: HeightField, highest_per_um: float, count: int = 4) -> tuple[Period, ...]:
    """The strongest lobes of the height's power spectrum, at most `count`, by falling share of variance.

    A lobe is a mode of the spectrum smoothed over a sixth of its frequency, so the many speckles that
    disorder makes of one line count as one; its middle is a mean-shift fixed point, which for a single line
    is exact far below a bin. Left out: frequencies above `highest_per_um`, fewer than four repeats across
    the patch, lobes below 0.5 % of the variance, and those hardly above their own ring.
    """
    spectrum = _spectrum(field, highest_per_um)
    if spectrum.variance == 0:
        return ()
    middles: list[complex] = []
    found: list[Period] = []
    for start in _candidates(spectrum, highest_per_um):
        middle = _middle(spectrum, start)
        if _repeats(spectrum, middle) < 0.95 * _FEWEST_REPEATS or _is_known(spectrum, middle, middles):
            continue
        share = _share(spectrum, middle)
        if share >= _LEAST_SHARE:
            middles.append(middle)
            found.append(_period(middle, share))
        if len(found) == count:
            break
    return tuple(sorted(found, key=lambda period: -period.share))


def _repeats(spectrum: _HeightSpectrum, frequency: complex) -> float:
    """How often a frequency repeats across the patch."""
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
    """A share of |f|, but no less than some bins, along (x, y), 1/um."""
    bin_x, bin_y = spectrum.bin_per_um
    return max(share * abs(frequency), bins * bin_x), max(share * abs(frequency), bins * bin_y)


def _period(frequency: complex, share: float) -> Period:
    """A lobe at +-`frequency` as a period."""
    direction = degrees(atan2(frequency.imag, frequency.real))
    if not -90 < direction <= 90:
        direction += 180 if direction <= -90 else -180
    return Period(1 / abs(frequency), direction, share)


def _spectrum(field: HeightField, highest_per_um: float) -> _HeightSpectrum:
    """Power spectrum under a Gaussian window (sigma an eighth of the patch), cut at |fx|, |fy| <= highest.

    Under a Gaussian a line stays a Gaussian, without side lobes that could pass for lines.
    """
    ny, nx = field.shape
    window = _window(ny)[:, None] * _window(nx)
    seen = (field.heights_um - float(np.sum(field.heights_um * window) / np.sum(window))) * window
    weight = float(np.sum(window**2))
    # Parseval's sum over all frequencies; rounding of a flat field is no structure
    peak, variance = float(np.max(np.abs(field.heights_um))), float(np.vdot(seen, seen)) / weight
    variance = variance if variance > (1e-12 * peak) ** 2 else 0.0
    x, fx = _ascending(nx, field.pitch_um[0], highest_per_um)
    y, fy = _ascending(ny, field.pitch_um[1], highest_per_um)
    # the half spectrum of real samples holds the rest at the opposite frequency
    opposite = x > nx // 2
    rows, columns = np.where(opposite, -y[:, None], y[:, None]) % ny, np.where(opposite, nx - x, x)
    power = np.abs(fourier.rfft2(seen)[rows, columns]) ** 2 / (seen.size * weight)
    size_x, size_y = field.size_um
    return _HeightSpectrum(power, fx, fy, (1 / size_x, 1 / size_y), variance)


def _ascending(samples: int, pitch_um: float, highest_per_um: float) -> tuple[np.ndarray, Array]:
    """Places in a transform, and their frequencies, up to the highest on either side of 0."""
    place, frequency = fft.fftshift(np.arange(samples)), fft.fftshift(fft.fftfreq(samples, pitch_um))
    kept = np.abs(frequency) <= highest_per_um
    return place[kept], frequency[kept]


def _window(samples: int) -> Array:
    """Gaussian over the samples, standard deviation an eighth of them, centred."""
    window: Array = np.exp(-0.5 * ((np.arange(samples) - 0.5 * (samples - 1)) / (samples / 8)) ** 2)
    return window


def _candidates(spectrum: _HeightSpectrum, highest_per_um: float) -> list[complex]:
    """Frequencies fx + i fy of local maxima in one half plane, by falling power of their lobes.

    Octave by octave, each with a kernel of its own size; octaves overlap, so none falls between two.
    """
    fx, fy = spectrum.fx, spectrum.fy[:, None]
    radius = np.hypot(fx, fy)
    repeats = np.hypot(fx / spectrum.bin_per_um[0], fy / spectrum.bin_per_um[1])
    allowed = (repeats >= _FEWEST_REPEATS) & (radius <= highest_per_um) & ((fx > 0) | ((fx == 0) & (fy > 0)))
    bin_area = spectrum.bin_per_um[0] * spectrum.bin_per_um[1]
    lowest = _FEWEST_REPEATS * min(spectrum.bin_per_um)
    candidates: list[tuple[float, complex]] = []
    # padded with zeros to sizes that transform fast
    my, mx = (fft.next_fast_len(n, real=True) for n in spectrum.power.shape)
    transform = fourier.rfft2(spectrum.power, (my, mx))
    while lowest < float(radius.max()):
        width_x, width_y = _extent(spectrum, complex(1.4 * lowest), _KERNEL, _KERNEL_BINS)
        density = _smooth(spectrum, transform, (my, mx), width_x, width_y)
        peaks = allowed & (radius >= 0.8 * lowest) & (radius <= 2.5 * lowest)
        peaks &= density == ndimage.maximum_filter(density, 3)
        # of a lobe narrower than the kernel this is all, of a wider one a part: let no weak one pass by
        power = density * (2 * 2 * pi * width_x * width_y / bin_area)
        peaks &= power > 0.25 * _LEAST_SHARE * spectrum.variance
        candidates += [(float(power[j, i]), complex(fx[i], fy[j, 0])) for j, i in np.argwhere(peaks)]
        lowest *= 2
    candidates.sort(key=lambda entry: -entry[0])
    return [frequency for _, frequency in candidates]


def _smooth(
    spectrum: _HeightSpectrum,
    transform: NDArray[np.complex128],
    padded: tuple[int, int],
    width_x: float,
    width_y: float,
) -> Array:
    """The power convolved with a Gaussian of widths `width_x`, `width_y`, 1/um.

    transform: half spectrum of the power, `padded` with zeros to that shape (my, mx).
    """
    my, mx = padded
    gain_x = np.exp(-2 * (pi * width_x / spectrum.bin_per_um[0] * fft.rfftfreq(mx)) ** 2)
    gain_y = np.exp(-2 * (pi * width_y / spectrum.bin_per_um[1] * fft.fftfreq(my)) ** 2)
    rows, columns = spectrum.power.shape
    return fourier.irfft2(transform * gain_y[:, None] * gain_x, padded)[:rows, :columns]


def _near(
    spectrum: _HeightSpectrum, middle: complex, reach_x: float, reach_y: float
) -> tuple[NDArray[np.complex128], Array]:
    """Frequencies fx + i fy within a rectangle about `middle` (half sides, 1/um), and their power; flat."""
    in_x = np.abs(spectrum.fx - middle.real) <= reach_x
    in_y = np.abs(spectrum.fy - middle.imag) <= reach_y
    frequencies = spectrum.fx[in_x] + 1j * spectrum.fy[in_y][:, None]
    return frequencies.ravel(), spectrum.power[np.ix_(in_y, in_x)].ravel()


def _middle(spectrum: _HeightSpectrum, start: complex) -> complex:
    """The middle of the lobe near `start`.

    If half the lobe's power is one line, the line's place, which neighbours then cannot pull away.
    """
    middle = _mean_shift(spectrum, start, _extent(spectrum, start, _KERNEL, _KERNEL_BINS), reach=2.5)
    line_width = _extent(spectrum, start, 0.0, _KERNEL_BINS)
    frequencies, power = _near(spectrum, middle, *_extent(spectrum, middle, _RADIUS, _RADIUS_BINS))
    line = _mean_shift(spectrum, complex(frequencies[np.argmax(power)]), line_width, reach=4.0)
    line_extent = _extent(spectrum, line, 0.0, _RADIUS_BINS)
    is_line = np.sum(_near(spectrum, line, *line_extent)[1]) > 0.5 * np.sum(power)
    return line if is_line else middle


def _mean_shift(spectrum: _HeightSpectrum, start: complex, width: tuple[float, float], reach: float) -> complex:
    """The mode near `start` of the spectrum smoothed by a Gaussian of these standard deviations, 1/um.

    It is the kernel-weighted mean of frequencies that reproduces itself, among those within `reach` widths
    of `start`: a stronger neighbour, such as a harmonic, must not draw it away.
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
    """Share of the variance in the lobes at +-f; 0 for a lobe that does not stand out of its ring."""
    rx, ry = _extent(spectrum, middle, _RADIUS, _RADIUS_BINS)
    frequencies, power = _near(spectrum, middle, rx, ry)
    gap = frequencies - middle
    inside = (gap.real / rx) ** 2 + (gap.imag / ry) ** 2 <= 1
    lobe = float(np.sum(power[inside]))
    distance = np.hypot(spectrum.fx, spectrum.fy[:, None])
    ring = spectrum.power[np.abs(distance - abs(middle)) <= min(rx, ry)]
    # the median knows the ring's noise without its lobes; of speckle, exponential, it is log 2 of the mean
    usual = float(np.median(ring)) / log(2)
    stands_out = lobe > _LEAST_CONTRAST * usual * np.count_nonzero(inside)
    return 2 * lobe / spectrum.variance if stands_out else 0.0
