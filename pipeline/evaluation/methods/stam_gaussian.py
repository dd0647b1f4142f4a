"""Stam's Gaussian random surface: the expectation of |P|^2 from the heights' autocorrelation alone ([S99] eq. 12).

For heights that are jointly Gaussian, E[p(x) p*(x + d)] = exp(-g (1 - C(d))), g = (k w sigma_h)^2. A window of
autocorrelation A(d) then sees

    E|P|^2(f) = integral A(d) exp(-g (1 - C(d))) exp(2 pi i f.d) dd / (integral of the window)^2.

C repeats with the patch, so the exponential has a discrete spectrum q at the frequencies phi of the patch's DFT, and

    E|P|^2(f) = sum_phi q(phi; g) W(f - phi),    W the window's |transform|^2, 1 at its peak.

A mirror has q = 1 at phi = 0 alone and gives W(f), as it does in every other method. Stam expands exp(g C) in powers,
exp(-g) g^n / n! FT{C^n}. Chebyshev polynomials need fewer, and their factors stay below 2 at any g:
exp(-z (1 - t)) = sum_n (2 - [n = 0]) exp(-z) I_n(z) T_n(t), t = (C - middle) / H, z = g H, |t| <= 1.
"""

from dataclasses import dataclass
from math import floor, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.sparse import csr_array
from scipy.special import ive, j1

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import expansion
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.evaluation.plain_numpy import chebyshev_terms
from pipeline.optics.coherence import sigma_f
from pipeline.surface.heightfield import HeightField

# [D14] sec. 6.3: the circular aperture of 100 um before the laser
PUBLISHED_DISC_RADIUS_UM = 50.0
# of the mirror's peak: the share of the omitted terms in E|P|^2
_TOLERANCE = 1e-10
# of its peak: where a window's |transform|^2 is cut about each coefficient but the specular one, which is never cut.
# A Gaussian's falls steeply; a disc's falls with the cube, and its tails are left out of the diffuse light alone
_GAUSSIAN_CUT, _DISC_CUT = 1e-9, 1e-4
_PAIRS_AT_ONCE = 50_000


@dataclass(frozen=True)
class GaussianWindow:
    """exp(-r^2 / (2 sigma^2)), the coherence window of every other method.

    Windows have `reach_per_um`, how far from its peak their |transform|^2 is followed, and `power`, which gives that
    at distances from its peak, 1 there.
    """

    sigma_um: float

    @property
    def reach_per_um(self) -> float:
        return sigma_f(self.sigma_um) * sqrt(log(1.0 / _GAUSSIAN_CUT))

    def power(self, f_per_um: Array) -> Array:
        """exp(-f^2 / sigma_f^2)."""
        return np.asarray(np.exp(-((f_per_um / sigma_f(self.sigma_um)) ** 2)))


@dataclass(frozen=True)
class DiscWindow:
    """A circular aperture, [D14] sec. 6.3: Airy's pattern.

    sigma_um: of the Gaussian window with the same effective area, 4 pi sigma^2 = (integral of g)^2 / integral of g^2.
    """

    radius_um: float = PUBLISHED_DISC_RADIUS_UM

    @property
    def sigma_um(self) -> float:
        return 0.5 * self.radius_um

    @property
    def reach_per_um(self) -> float:
        # (2 J_1(x) / x)^2 stays below 8 / (pi x^3)
        return float((8.0 / (pi * _DISC_CUT)) ** (1.0 / 3.0) / (2.0 * pi * self.radius_um))

    def power(self, f_per_um: Array) -> Array:
        """(2 J_1(x) / x)^2, x = 2 pi radius f."""
        x = np.maximum(2.0 * pi * self.radius_um * np.abs(f_per_um), 1e-9)
        return np.asarray((2.0 * j1(x) / x) ** 2)


Window = GaussianWindow | DiscWindow


def autocovariance(field: HeightField) -> Array:
    """mean of h(x) h(x + d) about the mean height, um^2 (ny, nx), of the periodic patch; d = 0 at [0, 0]."""
    heights = field.heights_um - field.heights_um.mean()
    power = np.abs(fft.rfft2(heights)) ** 2
    return np.asarray(fft.irfft2(power, heights.shape) / heights.size)


@dataclass(frozen=True)
class _Grid:
    """The patch's frequencies that a view can reach, and a window's reach more on every side.

    spacing_per_um, band_per_um: (x, y). reach: coefficients (x, y) on either side of the nearest one.
    rows, columns: the DFT's indices, may be negative; columns begin `reach` below 0, for spectra are even.
    """

    spacing_per_um: tuple[float, float]
    band_per_um: tuple[float, float]
    reach: tuple[int, int]
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]

    @property
    def zero(self) -> tuple[int, int]:
        """Row and column of f = 0."""
        return len(self.rows) // 2, self.reach[0]

    def neighbours(self, fx: Array, fy: Array) -> tuple[NDArray[np.intp], Array]:
        """Flat indices of the coefficients about frequencies with fx >= 0, and their distances, (pairs, y, x)."""
        (dx, dy), (reach_x, reach_y) = self.spacing_per_um, self.reach
        column = np.rint(fx / dx).astype(int)[:, None] + np.arange(-reach_x, reach_x + 1)
        row = np.rint(fy / dy).astype(int)[:, None] + np.arange(-reach_y, reach_y + 1)
        apart = np.hypot((fy[:, None] - row * dy)[:, :, None], (fx[:, None] - column * dx)[:, None, :])
        cells = ((row + self.zero[0]) * len(self.columns))[:, :, None] + (column + self.zero[1])[:, None, :]
        return cells, apart


def _grid(shape: tuple[int, int], pitch_um: tuple[float, float], reach_per_um: float, lambda_min_nm: float) -> _Grid:
    spacing = (1.0 / (shape[1] * pitch_um[0]), 1.0 / (shape[0] * pitch_um[1]))
    band = (0.5 / pitch_um[0], 0.5 / pitch_um[1])
    reach_x, reach_y = (floor(reach_per_um / d + 0.5) for d in spacing)
    highest = expansion.W_MAX / (1e-3 * lambda_min_nm)
    x, y = (floor(min(highest, b) / d + 0.5) for b, d in zip(band, spacing, strict=True))
    rows, columns = np.arange(-y - reach_y, y + reach_y + 1), np.arange(-reach_x, x + reach_x + 1)
    return _Grid(spacing, band, (reach_x, reach_y), rows, columns)


class GaussianSurface:
    """E|P|^2 of Gaussian random heights under a window, from their autocovariance."""

    def __init__(
        self, covariance_um2: Array, pitch_um: tuple[float, float], window: Window, lambda_min_nm: float
    ) -> None:
        """`covariance_um2` (ny, nx) repeats with the patch and has d = 0 at [0, 0]."""
        top, bottom = float(covariance_um2[0, 0]), float(covariance_um2.min())
        self._window, self._half_range_um2 = window, 0.5 * (top - bottom)
        self._grid = _grid(np.shape(covariance_um2), pitch_um, window.reach_per_um, lambda_min_nm)
        s_max = expansion.largest_phase(1.0, lambda_min_nm)
        terms = _terms_for(s_max**2 * self._half_range_um2)
        t = (covariance_um2 - 0.5 * (top + bottom)) / (self._half_range_um2 or 1.0)
        self._diffuse, self._specular = self._transformed(t, terms)

    def _transformed(self, t: Array, terms: int) -> tuple[Array, Array]:
        """Spectra of T_n(t): (coefficients, terms) without the one at f = 0, and that one, (terms,)."""
        ny, nx = t.shape
        wrapped = np.ix_(self._grid.rows % ny, self._grid.columns % nx)
        spectra = np.empty((len(self._grid.rows), len(self._grid.columns), terms))
        for n, term in zip(range(terms), chebyshev_terms(t), strict=False):
            # C is real and even, and so is its transform
            spectra[..., n] = fft.fft2(term, workers=-1).real[wrapped] / t.size
        specular = spectra[self._grid.zero].copy()
        spectra[self._grid.zero] = 0.0
        return spectra.reshape(-1, terms), specular

    @property
    def stored_bytes(self) -> int:
        """Of the spectra of all polynomials in C."""
        return self._diffuse.nbytes + self._specular.nbytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return E|P|^2 (directions, L); NaN beyond the Nyquist limits."""
        per_um = 1e3 / np.asarray(lambda_nm, float)
        fx, fy, f_w = (np.multiply.outer(uvw[:, axis], per_um).ravel() for axis in range(3))
        out = np.full(len(fx), np.nan)
        band_x, band_y = self._grid.band_per_um
        known = np.flatnonzero((np.abs(fx) <= band_x) & (np.abs(fy) <= band_y))
        for first in range(0, len(known), _PAIRS_AT_ONCE):
            part = known[first : first + _PAIRS_AT_ONCE]
            z = (2.0 * pi * f_w[part]) ** 2 * self._half_range_um2
            out[part] = np.einsum("pn,pn->p", self._windowed(fx[part], fy[part]), self._factors(z))
        return out.reshape(len(uvw), len(per_um))

    def _factors(self, z: Array) -> Array:
        """(2 - [n = 0]) exp(-z) I_n(z), (pairs, terms)."""
        n = np.arange(len(self._specular))
        return np.asarray(np.where(n == 0, 1.0, 2.0) * ive(n, z[:, None]))

    def _windowed(self, fx: Array, fy: Array) -> Array:
        """The spectra of all polynomials seen through the window at frequencies (pairs,): (pairs, terms)."""
        # even spectra: the half with fx >= 0 is kept
        turn = np.where(fx < 0.0, -1.0, 1.0)
        cells, apart = self._grid.neighbours(turn * fx, turn * fy)
        ends = np.arange(0, cells.size + 1, cells[0].size)
        weights = self._window.power(apart).ravel()
        gather = csr_array((weights, cells.ravel(), ends), shape=(len(fx), len(self._diffuse)))
        specular = np.outer(self._window.power(np.hypot(fx, fy)), self._specular)
        return np.asarray(gather @ self._diffuse + specular)


class StamGaussian(Monochromatic):
    """Stam's expectation with the autocorrelation that the scan itself has, as [D14] sec. 6.3 uses it."""

    source = "[S99] eq. 12, [D14] sec. 6.3"

    def __init__(self, field: HeightField, config: Config, window: Window | None = None) -> None:
        """The coherence window of the config unless another is given, such as the text's `DiscWindow()`."""
        window = window or GaussianWindow(config.coherence.sigma_um)
        # `absolute` multiplies by the window's area
        coherence = config.coherence.model_copy(update={"sigma_um": window.sigma_um})
        super().__init__(config.model_copy(update={"coherence": coherence}))
        lambda_min = config.light.lambda_min_nm
        self._surface = GaussianSurface(autocovariance(field), field.pitch_um, window, lambda_min)
        self.stored_bytes = self._surface.stored_bytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        return self._surface.power(uvw, lambda_nm)


def _terms_for(z: float) -> int:
    """How many terms leave less than the tolerance of exp(-z (1 - t)): the tail of 2 exp(-z) I_n(z)."""
    # exp(-z) I_n(z) falls like exp(-n^2 / (2 z)) once n is beyond sqrt(z)
    orders = np.arange(int(8.0 * sqrt(z)) + 40)
    tail: Array = 2.0 * np.cumsum(ive(orders, z)[::-1])[::-1]
    return max(1, int(np.searchsorted(-tail, -_TOLERANCE)))
