"""Stam's periodic bumps: one bump of given shape on a lattice of periods dx, dy ([D14] eq. 14 and 15, sec. 6.3).

Such a surface sends light into orders (n, m) at f = (n / dx, m / dy) alone, |c_nm|^2 of it each. Under the coherence
window an order is a peak of height |c_nm|^2 over an area pi sigma_f^2 of frequencies. [D14] makes of it a bound,
epsilon: an order counts where both u dx / lambda and v dy / lambda are within epsilon of whole numbers. The peak
keeps its height, so a mirror stays 1, and `matched_epsilon` is the bound at which its area is the window's too.

The colour follows the text. One delta function picks wavelengths, lambda = u dx / n; those count whose v dy / lambda
is within epsilon of a whole number m. A picked wavelength represents all that the bound lets through, which is
the delta's width in frequency times |d lambda / d(u / lambda)| = lambda^2 / |u|:

    2 epsilon / dx * lambda^2 / |u| = 2 epsilon lambda / n.

Then the axes change places. Orders with n and m both set are found twice, and each counts half; those on an axis
are found once, for the other delta picks no wavelength. The specular order is met by all wavelengths at once.
"""

from dataclasses import dataclass
from math import floor, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import STEP_NM
from pipeline.errors import ConfigError
from pipeline.evaluation.methods.method import Monochromatic, integrated, spread
from pipeline.optics.coherence import sigma_f
from pipeline.surface.heightfield import HeightField
from pipeline.surface.periods import dominant_periods

PUBLISHED_EPSILON = 0.01  # [D14] sec. 6.3, fig. 11(a)
PUBLISHED_SHARE = 0.5  # [D14] fig. 11: bumps are half as wide and as high as their period
_NO_WAVELENGTH_UM = 1e-6


@dataclass(frozen=True)
class RectangularBump:
    """`height_um` over the shares of both periods, else 0.

    `coefficients` of either bump are c_nm (...), the integral over one cell, divided by dx dy, of
    exp(i s b(x, y)) exp(2 pi i (n x / dx + m y / dy)) with s = k w.
    """

    height_um: float
    share_x: float = PUBLISHED_SHARE
    share_y: float = PUBLISHED_SHARE

    def coefficients(self, n: Array, m: Array, s_per_um: Array) -> NDArray[np.complex128]:
        """[n = m = 0] + (exp(i s H) - 1) a sinc(a n) b sinc(b m)."""
        raised = self.share_x * np.sinc(self.share_x * n) * self.share_y * np.sinc(self.share_y * m)
        return np.asarray(_flat(n, m) + (np.exp(1j * s_per_um * self.height_um) - 1.0) * raised)


@dataclass(frozen=True)
class TriangularBump:
    """A ridge along y that rises to `height_um` in the middle of its width, straight on both sides."""

    height_um: float
    share_x: float = PUBLISHED_SHARE
    share_y: float = PUBLISHED_SHARE

    def coefficients(self, n: Array, m: Array, s_per_um: Array) -> NDArray[np.complex128]:
        """[n = m = 0] + a (integral_0^1 exp(i z (1 - q)) cos(pi a n q) dq - sinc(a n)) b sinc(b m), z = s H."""
        z, turn = s_per_um * self.height_um, pi * self.share_x * n
        slopes = [0.5 * np.exp(0.5j * (z + t)) * np.sinc((z - t) / (2.0 * pi)) for t in (turn, -turn)]
        profile = self.share_x * (sum(slopes) - np.sinc(self.share_x * n))
        return np.asarray(_flat(n, m) + profile * self.share_y * np.sinc(self.share_y * m))


Bump = RectangularBump | TriangularBump


def _flat(n: Array, m: Array) -> Array:
    """c_nm of the plane between the bumps: all of it specular."""
    return np.asarray(np.where((n == 0) & (m == 0), 1.0, 0.0))


def estimated_periods(field: HeightField, highest_per_um: float) -> tuple[float, float]:
    """(dx, dy), um: the strongest period within 45 degrees of each axis.

    Along an axis without one, twice the distance at which the heights are least like themselves: the mean size of a
    bump and its gap. Along a grating's lines there is no such distance, and the patch is one period.
    """
    found = dominant_periods(field, highest_per_um)
    along_x = [p.period_um for p in found if abs(p.direction_deg) <= 45.0]
    along_y = [p.period_um for p in found if abs(p.direction_deg) > 45.0]
    dx = along_x[0] if along_x else _bump_and_gap(field.heights_um, field.pitch_um[0])
    dy = along_y[0] if along_y else _bump_and_gap(field.heights_um.T, field.pitch_um[1])
    return dx, dy


def _bump_and_gap(heights: Array, pitch_um: float) -> float:
    """Twice the lag of the autocorrelation's first minimum along the second axis, um; the patch where it has none."""
    spectrum = np.abs(fft.rfft(heights - heights.mean(), axis=1)) ** 2
    correlation = fft.irfft(spectrum.sum(axis=0), heights.shape[1])[: heights.shape[1] // 2]
    # rounding of a constant is no rise
    rises = np.diff(correlation) > 1e-9 * correlation[0]
    return 2.0 * pitch_um * float(np.argmax(rises)) if rises.any() else pitch_um * heights.shape[1]


def matched_epsilon(sigma_um: float, periods_um: tuple[float, float]) -> float:
    """The bound whose box of frequencies, 4 epsilon^2 / (dx dy), has the area of the window's peak, pi sigma_f^2."""
    return 0.5 * sqrt(pi * periods_um[0] * periods_um[1]) * sigma_f(sigma_um)


class StamBumps(Monochromatic):
    """The colour of a regular lattice of one bump, whatever else the surface may be."""

    source = "[S99] eq. 21-24, [D14] eq. 14, 15"
    # two periods, height, two shares and epsilon: nothing is tabulated
    stored_bytes = 6 * np.dtype(float).itemsize

    def __init__(
        self,
        field: HeightField,
        config: Config,
        periods_um: tuple[float, float] | None = None,
        bump: Bump | None = None,
        epsilon: float = PUBLISHED_EPSILON,
    ) -> None:
        """Periods are the surface's own unless given; the bump is that of fig. 11(a), rectangular, half of dx high.

        Raises ConfigError for a flat surface without `periods_um`, and for an epsilon outside (0, 0.5].
        """
        if not 0.0 < epsilon <= 0.5:
            raise ConfigError(config.name, [("epsilon", f"expected 0 < epsilon <= 0.5, got {epsilon:g}")])
        super().__init__(config)
        if periods_um is None:
            if field.half_range_um == 0.0:
                raise ConfigError(config.name, [("periods_um", "a flat surface has no period: give them")])
            periods_um = estimated_periods(field, 2e3 / config.light.lambda_min_nm)
        self.periods_um = periods_um
        self.bump = RectangularBump(PUBLISHED_SHARE * periods_um[0]) if bump is None else bump
        self.epsilon = epsilon

    def xyz(self, wi: Array, wr: Array) -> Array:
        # of a laser there are no wavelengths to pick from
        power = self.power if self._config.light.is_line else self._picked
        return integrated(power, self._config, wi, wr, STEP_NM)

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """|c_nm|^2 (directions, L) where both axes are within epsilon of an order, else 0: no band bounds a model."""
        per_um = 1e3 / np.asarray(lambda_nm, float)
        order_x, order_y = (
            np.multiply.outer(uvw[:, axis], period * per_um) for axis, period in enumerate(self.periods_um)
        )
        n, m = np.rint(order_x), np.rint(order_y)
        met = (np.abs(order_x - n) <= self.epsilon) & (np.abs(order_y - m) <= self.epsilon)
        return np.where(met, self._efficiency(n, m, np.multiply.outer(uvw[:, 2], per_um)), 0.0)

    def _efficiency(self, n: Array, m: Array, w_per_um: Array) -> Array:
        """|c_nm|^2 at w / lambda."""
        return np.asarray(np.abs(self.bump.coefficients(n, m, 2.0 * pi * w_per_um)) ** 2)

    def _picked(self, uvw: Array, lambda_nm: Array) -> Array:
        """|P|^2 (directions, L) at the nodes of a trapezoidal rule whose sum is the picked light."""
        per_um = 1e3 / lambda_nm
        specular = np.ones((len(uvw), len(lambda_nm)), bool)
        for axis, period in enumerate(self.periods_um):
            specular &= np.abs(np.multiply.outer(uvw[:, axis], period * per_um)) <= self.epsilon
        none = np.zeros(1)
        total = np.where(specular, self._efficiency(none, none, np.multiply.outer(uvw[:, 2], per_um)), 0.0)
        return total + self._lines(uvw, lambda_nm, 0) + self._lines(uvw, lambda_nm, 1)

    def _lines(self, uvw: Array, lambda_nm: Array, axis: int) -> Array:
        """The light of every wavelength that the delta function along an axis picks."""
        along, across = self.periods_um[axis], self.periods_um[1 - axis]
        n = np.arange(1, floor(along * 2e3 / lambda_nm[0]) + 1)
        picked_um = np.abs(uvw[:, axis, None]) * along / n
        order = uvw[:, 1 - axis, None] * across / np.maximum(picked_um, _NO_WAVELENGTH_UM)
        near = np.rint(order)
        met = (np.abs(order - near) <= self.epsilon) & (1e3 * picked_um >= lambda_nm[0])
        row, which = np.nonzero(met & (1e3 * picked_um <= lambda_nm[-1]))
        um, first, second = picked_um[row, which], np.sign(uvw[row, axis]) * n[which], near[row, which]
        orders = (first, second) if axis == 0 else (second, first)
        light = self._efficiency(orders[0], orders[1], uvw[row, 2] / um)
        # an order that both delta functions find counts half each time
        width_nm = 2e3 * self.epsilon * um / n[which] * np.where(second == 0.0, 1.0, 0.5)
        return spread(row, 1e3 * um, light * width_nm, lambda_nm, len(uvw))
