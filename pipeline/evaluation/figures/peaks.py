"""The first order of a surface in one plane of incidence: peaks of its reflectance, and the lines behind them.

Along the plane a view is named by f = (sin theta_i - sin phi) / lambda, 1/um: the frequency whose first order it
meets (pipeline.optics.gratings), so that a peak at f is a period 1 / f.

Under a window of sigma a grating's order is a line exp(-(f - f0)^2 / sigma_f^2), and whatever multiplies it moves its
peak by sigma_f^2 / 2 times the logarithmic slope: the factor C = F^2 G / (F0^2 w^2), and the order's own strength,
which changes with s = k |w|. A line has neither: it is the maximum of |P(f; s)|^2 over f while s stays what it is
at the peak.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi

import numpy as np
from scipy.signal import find_peaks

from pipeline.arrays import Array
from pipeline.errors import AccuracyError
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import folded_window, sigma_f
from pipeline.optics.gratings import in_plane
from pipeline.optics.light import Quadrature
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField

# |P|^2 (directions, L) for uvw (directions, 3) and wavelengths in nm (L,)
Power = Callable[[Array, Array], Array]

# [D14] eq. 4 has no shadowing
BRDF = Material(shadowing=False, normalisation="relative")
# Schlick's term needs no wavelengths
_NO_LIGHT = Quadrature(np.empty(0), np.empty((0, 3)))
_GRID_STEPS = 4  # a sigma_f: a parabola through three such samples of a Gaussian's logarithm is exact
# of sigma_f: central differences of a Gaussian's logarithm are exact at any step, so rounding may choose it
_NEWTON_STEP, _NEWTON_ROUNDS, _FARTHEST_MOVE = 0.02, 12, 0.25


@dataclass(frozen=True)
class Plane:
    """A plane of incidence: the light's polar angle and azimuth, radians."""

    theta_i: float
    azimuth: float

    def phi(self, f: Array, lambda_um: Array) -> Array:
        """Return viewing angles of frequencies, radians; NaN beyond the horizon. `f` and `lambda_um` broadcast."""
        sine = np.sin(self.theta_i) - f * lambda_um
        return np.arcsin(np.where(np.abs(sine) < 1.0, sine, np.nan))

    def directions(self, f: Array, lambda_um: Array) -> tuple[Array, Array]:
        """Return wi and wr (..., 3)."""
        return in_plane(self.theta_i, self.azimuth, self.phi(f, lambda_um))


@dataclass(frozen=True)
class Band:
    """The range in which peaks are looked for: frequencies from `low` to `high`, 1/um, and the window's sigma_f."""

    low: float
    high: float
    sigma_f: float

    def grid(self) -> Array:
        """Return frequencies a quarter of sigma_f apart."""
        return np.linspace(self.low, self.high, int(np.ceil(_GRID_STEPS * (self.high - self.low) / self.sigma_f)) + 1)


def band_of(periods_um: tuple[float, float], sigma_um: float) -> Band:
    """Return the band of a range of periods."""
    return Band(1.0 / max(periods_um), 1.0 / min(periods_um), sigma_f(sigma_um))


def reflectance(power: Power, plane: Plane, f: Array, lambda_nm: Array, material: Material = BRDF) -> Array:
    """Return C |P|^2 (L, k) at frequencies `f` (k,) or (L, k); 0 beyond the horizon and the Nyquist limits."""
    lambda_um = 1e-3 * lambda_nm[:, None]
    wi, wr = plane.directions(*np.broadcast_arrays(f, lambda_um))
    seen = np.isfinite(wr[..., 0])
    wr = np.where(seen[..., None], wr, [0.0, 0.0, 1.0])
    values = _own_wavelength(power, geometry.uvw(wi, wr), lambda_nm)
    return np.where(seen, np.nan_to_num(values) * brdf.direction_factor(material, _NO_LIGHT, wi, wr), 0.0)


def _own_wavelength(power: Power, uvw: Array, lambda_nm: Array) -> Array:
    """|P|^2 (L, k) of `uvw` (L, k, 3), each row at its own wavelength."""
    return np.stack([power(row, np.array([nm]))[:, 0] for row, nm in zip(uvw, lambda_nm, strict=True)])


def brightest(values: Array, f: Array) -> Array:
    """Return the frequency (L,) of each row's largest value (L, k) on a grid `f` (k,), refined by a parabola."""
    place, rows = np.clip(np.argmax(values, axis=1), 1, len(f) - 2), np.arange(len(values))
    tiny = np.finfo(float).tiny
    # through the logarithms of three samples: exact for a Gaussian
    below, here, above = (np.log(np.maximum(values[rows, place + k], tiny)) for k in (-1, 0, 1))
    bend = below - 2.0 * here + above
    offset = np.where(bend < 0.0, 0.5 * (below - above) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return np.asarray(f[place] + np.clip(offset, -1.0, 1.0) * (f[1] - f[0]))


def persistent(values: Array, f: Array, count: int, apart: float) -> Array:
    """Return the frequencies (count,) where the mean over wavelengths of `values` (L, k) is brightest.

    Each row is divided by its largest value. Only local maxima count, and none within `apart` of a brighter one.
    Raises AccuracyError where there are fewer.
    """
    mean = np.mean(values / values.max(axis=1, keepdims=True), axis=0)
    tops = find_peaks(mean, distance=max(1.0, apart / (f[1] - f[0])))[0]
    if len(tops) < count:
        raise AccuracyError(f"expected {count} peaks of the reflectance, found {len(tops)}: too small a patch?")
    return np.asarray(f[tops[np.argsort(-mean[tops])[:count]]])


def peaks(
    power: Power, plane: Plane, start: Array, lambda_nm: Array, width: float, material: Material = BRDF
) -> Array:
    """Find frequencies (L,) of the reflectance's maxima near `start` (L,) by Newton's method; `width` is sigma_f."""
    return _climb(lambda f: reflectance(power, plane, f, lambda_nm, material), start, width)


def lines(power: Power, plane: Plane, start: Array, lambda_nm: Array, width: float) -> Array:
    """Find frequencies (L,) of the lines near `start` (L,): maxima of |P(f; s)|^2 at the s of the line itself."""
    lambda_um = 1e-3 * lambda_nm[:, None]
    towards = -np.array([np.cos(plane.azimuth), np.sin(plane.azimuth)])

    def at_one_s(f: Array) -> Array:
        # the middle column is the place itself
        cosine = np.cos(plane.phi(f[:, 1:2], lambda_um))
        w = np.broadcast_to(-(np.cos(plane.theta_i) + cosine), f.shape)
        uvw = np.concatenate([f[..., None] * lambda_um[..., None] * towards, w[..., None]], axis=-1)
        return _own_wavelength(power, uvw, lambda_nm)

    return _climb(at_one_s, start, width)


def _climb(values: Callable[[Array], Array], start: Array, width: float) -> Array:
    """Maxima (L,) of the logarithm of values (L, 3) given for frequencies (L, 3), by Newton's method from `start`."""
    step, farthest = _NEWTON_STEP * width, _FARTHEST_MOVE * width
    f = start.copy()
    for _ in range(_NEWTON_ROUNDS):
        below, here, above = np.log(values(f[:, None] + step * np.array([-1.0, 0.0, 1.0]))).T
        slope, bend = (above - below) / (2.0 * step), (above - 2.0 * here + below) / step**2
        # outside a peak's convex part it climbs
        move = np.where(bend < 0.0, -slope / np.where(bend < 0.0, bend, 1.0), np.sign(slope) * farthest)
        f = f + np.clip(move, -farthest, farthest)
        if np.max(np.abs(move)) < 1e-9 * width:
            break
    return f


def by_position(field: HeightField, sigma_um: float, s_per_um: float, f: Array, count: int) -> Array:
    """Return |P(f; s)|^2 (count, count, 2, k) with the window at a grid of positions on the patch, along y, then x.

    `f` (k,) is along x, met with the light at azimuth 0 and then at 180 degrees (P at -f and at f). The position
    [0, 0] is sample 0, and [count // 2, count // 2] the middle where `count` is even.
    """
    ny, nx = field.shape
    pitch_x, pitch_y = field.pitch_um
    p = np.exp(1j * s_per_um * field.centred().heights_um)
    along_y = folded_window(ny, pitch_y, sigma_um, 0.0).real
    at_y = np.stack([np.roll(along_y, _sample(ny, i, count) - ny // 2) for i in range(count)])
    waves = np.stack([folded_window(nx, pitch_x, sigma_um, sign * each) for sign in (-1, 1) for each in f])
    total = along_y.sum() * folded_window(nx, pitch_x, sigma_um, 0.0).real.sum()
    seen = at_y @ p
    columns = [np.roll(seen, nx // 2 - _sample(nx, i, count), axis=1) @ waves.T for i in range(count)]
    power = np.abs(np.stack(columns, axis=1) / total) ** 2
    return np.asarray(power.reshape(count, count, 2, len(f)))


def _sample(samples: int, position: int, count: int) -> int:
    return samples * position // count


def phase_rate(plane: Plane, f: float, lambda_nm: float) -> float:
    """Return s = k w, 1/um, negative, of a view at f."""
    lambda_um = 1e-3 * lambda_nm
    cosine = float(np.cos(plane.phi(np.array(f), np.array(lambda_um))))
    return -2.0 * pi / lambda_um * (cos(plane.theta_i) + cosine)
