"""The number of terms that a series of exp(i k w h) needs, and its truncation and rounding errors.

Heights are scaled to t = h / H in [-1, 1], and the phase is z t with z = k |w| H.
"""

from dataclasses import dataclass
from math import ceil, exp, pi

import numpy as np

from pipeline.arrays import Array
from pipeline.errors import AccuracyError
from pipeline.fourier.lengths import next_fast
from pipeline.optics.light import Quadrature
from pipeline.surface.heightfield import HeightField

# with a larger relative error a table has not one correct digit
LARGEST_TOLERANCE = 0.1
W_MAX = 2.0  # |w| = cos ti + cos tr
_MOST_TERMS = 400
# errors of |P|^2 below this share of the mirror's are absolute, not relative: 1e-4 of it is 1e-7 of the mirror
MIRROR_SHARE = 1e-3
# rms relative rounding error of numbers distributed evenly over a binade, in half an ulp at its lower end: sqrt(1/3)
# for the position within the ulp, 2^-0.5 for the position within the binade
_ROUNDING_RMS = 0.41
# above this phase float64 cannot represent the sum either, and the estimate exp(2 z) is enough
_HOPELESS_PHASE = 40.0
# samples of waves that are transformed at once for Bessel functions
_BESSEL_SAMPLES = 2**18


def largest_phase(half_range_um: float, lambda_min_nm: float) -> float:
    """Computes z = k |w| H, radians, for normal incidence and a normal view (|w| = 2).

    half_range_um: H, um. lambda_min_nm: shortest wavelength, nm.
    """
    return 2.0 * pi / (1e-3 * lambda_min_nm) * W_MAX * half_range_um


@dataclass(frozen=True)
class TaylorPlan:
    """The Taylor series chosen for a height field.

    order: N, the highest power ([D14] eq. 6).
    truncation: bound on the error of exp(i k w h) at the worst sample, due to the omitted terms.
    rounding: expected (rms) error of |P|^2, due to I_p in float32.
    """

    order: int
    truncation: float
    rounding: float

    @property
    def error(self) -> float:
        """Predicted error of |P|^2 relative to max(local value, 1e-3); truncation enters by both amplitudes."""
        return 2.0 * self.truncation + self.rounding


def plan_taylor(field: HeightField, quadrature: Quadrature, tolerance: float, order: int | None = None) -> TaylorPlan:
    """Chooses the order N of a Taylor series and predicts its error ([D14] eq. 6).

    field: heights. quadrature: wavelengths and weights of the tables.
    tolerance: error of |P|^2 allowed, relative to max(local value, 1e-3 of the mirror).
    order: N if it is given, None to choose the smallest.
    Returns the order with its errors. Raises AccuracyError if they exceed the tolerance in float32 tables.
    """
    z = largest_phase(field.half_range_um, quadrature.lambda_min_nm)
    chosen = order if order is not None else planned_order(z, tolerance)
    plan = TaylorPlan(chosen, _taylor_remainder(z, chosen), float32_rounding(field, quadrature))
    if plan.error > tolerance:
        raise AccuracyError(_refusal(plan, field, tolerance, order is not None))
    return plan


def _refusal(plan: TaylorPlan, field: HeightField, tolerance: float, order_was_given: bool) -> str:
    text = (
        f"Taylor tables of order N = {plan.order} would err by {plan.error:.1e} of |P|^2 "
        f"(truncation {2 * plan.truncation:.1e}, float32 rounding {plan.rounding:.1e}), "
        f"but table.tolerance asks for {tolerance:.1e}; heights span {2 * field.half_range_um:.3g} um. "
    )
    if order_was_given and 2.0 * plan.truncation > 0.5 * tolerance:
        return text + 'Set table.terms = "auto", or a higher number.'
    # half as much again leaves room for truncation, whose share of the tolerance grows with it
    enough = 1.5 * plan.rounding
    if enough <= LARGEST_TOLERANCE:
        return text + f"Set table.tolerance = {enough:.0e}, or lower the heights (a scan's: surface.clip_percentile)."
    return text + "Lower the heights (a scan's outliers: surface.clip_percentile); no tolerance helps."


def planned_order(z: float, tolerance: float) -> int:
    """Computes the order N that `plan_taylor` chooses for the phase z, radians."""
    # truncation, which enters twice, gets two fifths of the tolerance; rounding does not depend on the order
    return taylor_order(z, 0.2 * tolerance)


def taylor_order(z: float, tolerance: float) -> int:
    """Computes the smallest N whose Lagrange remainder is at most `tolerance` for the phase z, radians."""
    for order in range(1, _MOST_TERMS):
        if _taylor_remainder(z, order) <= tolerance:
            return order
    return _MOST_TERMS


def _taylor_remainder(z: float, order: int) -> float:
    """Computes Lagrange's bound z^(N+1) / (N+1)! on |exp(i z t) - sum_(n <= N) (i z t)^n / n!| for |t| <= 1."""
    n = np.arange(1, order + 2)
    # e^700 is near the largest number of float64
    return exp(min(float(np.sum(np.log(max(z, 1e-300) / n))), 700.0))


def float32_rounding(field: HeightField, quadrature: Quadrature) -> float:
    """Estimates the error of |P|^2 when I_p are rounded to float32.

    The terms of [D14] eq. 10 cancel, which amplifies rounding by the ratio of their sum to |P|^2. The estimate is the
    larger of two, away from the mirror direction and in it. Wavelengths are averaged with the weights of the
    quadrature; the worst channel and |w| count.

    field: heights. quadrature: wavelengths and weights of the tables.
    Returns the expected error relative to max(local value, 1e-3 of the mirror).
    """
    half_ulp = float(np.finfo(np.float32).eps) / 2
    z_max = largest_phase(field.half_range_um, quadrature.lambda_min_nm)
    if z_max > _HOPELESS_PHASE:
        return half_ulp * exp(min(2.0 * z_max, 700.0))
    t, share = _height_histogram(field)
    return half_ulp * max(_diffuse_loss(t, share, z_max, quadrature), _specular_loss(t, share, z_max, quadrature))


def _height_histogram(field: HeightField) -> tuple[Array, Array]:
    """Computes a histogram of t = h / H: bin centres and shares of the samples."""
    heights = field.centred().heights_um / max(field.half_range_um, 1e-300)
    counts, edges = np.histogram(heights, bins=512, range=(-1.0, 1.0))
    return 0.5 * (edges[1:] + edges[:-1]), counts / counts.sum()


def _term_factors(z: Array, z_max: float) -> Array:
    """Computes z^n / n! (L, n) for phases z (L,), up to the n at which they are negligible."""
    n = np.arange(1, int(3.0 * z_max) + 30)
    return np.cumprod(np.concatenate([np.ones((len(z), 1)), z[:, None] / n], axis=1), axis=1)


def _channel_shares(quadrature: Quadrature) -> Array:
    """Computes each wavelength's share of its channel (L, 3); 0 for a channel without weight, as Z of a red laser."""
    return np.asarray(quadrature.weights / np.maximum(np.abs(quadrature.weights).sum(axis=0), 1e-300))


def _diffuse_loss(t: Array, share: Array, z_max: float, quadrature: Quadrature) -> float:
    """Computes A^2, A = sum_n z^n / n! sqrt(mean t^2n), the amplification away from the mirror direction.

    By Parseval's theorem each term has this rms value where P has 1.
    """
    factors = _term_factors(z_max * quadrature.lambda_min_nm / quadrature.lambda_nm, z_max)
    root_mean_powers = np.sqrt(t ** (2 * np.arange(factors.shape[1])[:, None]) @ share)
    weights = np.abs(_channel_shares(quadrature))
    return float(np.max(weights.T @ (factors @ root_mean_powers) ** 2))


def _specular_loss(t: Array, share: Array, z_max: float, quadrature: Quadrature) -> float:
    """Computes the rms sum of w^p I_p relative to max(sum_p w^p I_p, 1e-3) at (u, v) = 0, where FT{t^n} = mean(t^n).

    Rounding errors of different p are independent, so their squares add up.
    """
    kh = z_max / W_MAX * quadrature.lambda_min_nm / quadrature.lambda_nm
    factors = _term_factors(kh, z_max)
    n = np.arange(factors.shape[1])
    terms = factors * 1j**n * (t ** n[:, None] @ share)
    products = np.array([np.convolve(g.real, g.real) + np.convolve(g.imag, g.imag) for g in terms])
    i_p = _channel_shares(quadrature).T @ products
    w = np.linspace(W_MAX / 32, W_MAX, 32)[:, None]
    powers = i_p[:, None, :] * (-w) ** np.arange(i_p.shape[1])
    rounded = _ROUNDING_RMS * np.sqrt(np.sum(powers**2, axis=-1))
    return float(np.max(rounded / np.maximum(np.sum(powers, axis=-1), MIRROR_SHARE)))


def bessel(orders: int, z: Array) -> Array:
    """Computes J_n(z) for n = 0 .. orders - 1 and z >= 0 (k,), to the rounding of z. Returns (orders, k).

    J_n are the Fourier coefficients of exp(i z sin t), a smooth and periodic function: a transform of M samples errs
    by J_(M - n) alone, and J_m(z) < 1e-16 for m = 2 z + 64. scipy.special has them too, but its import takes longer
    than all that a bake needs of them.
    """
    samples = next_fast(orders + 2 * ceil(float(np.max(z, initial=0.0))) + 64)
    waves = np.sin(2.0 * pi / samples * np.arange(samples))
    found = np.empty((orders, len(z)))
    at_once = max(1, _BESSEL_SAMPLES // samples)
    for first in range(0, len(z), at_once):
        some = slice(first, first + at_once)
        found[:, some] = np.fft.fft(np.exp(1j * np.outer(z[some], waves)))[:, :orders].real.T / samples
    return found


def chebyshev_order(z: float, tolerance: float) -> int:
    """Computes the smallest N with 2 sum_(n > N) |J_n(z)| <= `tolerance`, the tail of the Jacobi-Anger expansion.

    z: phase, radians. tolerance: error allowed in exp(i z t).
    """
    tail: Array = 2.0 * np.cumsum(np.abs(bessel(int(z) + 400, np.array([z]))[:, 0])[::-1])[::-1]
    return max(1, int(np.argmax(tail <= tolerance)) - 1)
