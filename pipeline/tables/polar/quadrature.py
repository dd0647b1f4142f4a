"""The wavelength quadrature of every ring, chosen by an estimate of its error.

Along a ray, |P|^2 is a Fourier integral over the autocorrelation of the coherence window, exp(-x^2 / (4 sigma^2)). On
a ring rho, a quadrature with weights q_l integrates the wave at lag x to

    D(x rho) = sum_l q_l exp(2 pi i x rho / lambda_l)

In speckle the waves have independent amplitudes, so the relative error of the integral is the root mean square of the
error of D over the window. Outer rings need small steps; rings near the mirror direction need few wavelengths.
"""

from collections.abc import Callable
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from kernels.spectral_operator import RingQuadratures as RingQuadratures
from pipeline.arrays import Array
from pipeline.errors import AccuracyError
from pipeline.optics.light import FINE_STEP_NM, Light, Quadrature

_STEPS_NM = (20.0, 10.0, 5.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
# the step that D65 takes beside the mirror direction, where the window asks for none
_STEP_OF_DAYLIGHT_NM = 4.0
# the squared autocorrelation of the window, exp(-x^2 / (2 sigma^2)), is 3e-4 at 4 sigma
_REACH_SIGMAS, _POINTS = 4.0, 48
_GRID_POINTS = 256
# complex multiply-adds of a product that OpenBLAS leaves on one thread (below 2^16): threads wait for each other at a
# barrier, on busy cores up to 40 ms for a product of 0.4 ms (801 wavelengths)
_PRODUCT = 2**15


def choose(
    integrand: Callable[[float], Quadrature], rho: Array, sigma_um: float, tolerance: float
) -> RingQuadratures:
    """Chooses for every ring the coarsest quadrature whose estimated relative error is at most `tolerance`.

    Weights are scaled so that every quadrature integrates white as a step of 1 nm does; 20 nm alone err by 1 %.

    integrand: makes the quadrature for a step in nm; for a laser line it has one wavelength whatever the step.
    rho: |(u, v)| of the rings (n_rings,), ascending, dimensionless.
    sigma_um: standard deviation of the coherence window, um.
    Returns the wavelengths and weights of every ring. Raises AccuracyError if the finest step errs by more.
    """
    white = integrand(FINE_STEP_NM)
    if len(white.lambda_nm) == 1:
        return uniform(white, len(rho))
    usual = _usual(white.lambda_nm[0], white.lambda_nm[-1], rho, sigma_um)
    steps = (_scaled_to(white, integrand(step)) for step in _STEPS_NM)
    coarse = next(steps)
    x = np.linspace(0.0, _REACH_SIGMAS * sigma_um, _POINTS)
    share = np.exp(-0.5 * (x / sigma_um) ** 2)
    share /= share.sum()
    y = np.linspace(0.0, x[-1] * rho[-1], _points(x[-1] * rho[-1], coarse))
    chosen, open_, rules = np.full(len(rho), -1), np.arange(len(rho)), [coarse]
    response = _response(coarse, y)
    for finer in steps:
        response_finer = _response(finer, y)
        error = np.max(np.abs(response - response_finer) ** 2, axis=1)
        left = np.sqrt(np.interp(np.outer(rho[open_], x), y, error) @ share)
        chosen[open_[left <= tolerance]] = len(rules) - 1
        open_ = open_[left > tolerance]
        if not len(open_):
            return _assemble(rules, chosen, usual)
        rules.append(finer)
        response = response_finer
    raise AccuracyError(
        f"wavelength quadrature needs steps finer than {_STEPS_NM[-2]} nm for an error of {tolerance:.1g}; "
        "raise accuracy.delta_e, or narrow spectrum.range_nm"
    )


def expected(light: Light, rho: Array, sigma_um: float) -> RingQuadratures:
    """Estimates the wavelengths of every ring without a search: six to each beat across the window, 21 to 3201.

    light: its range or line is read. rho: |(u, v)| of the rings (n_rings,). sigma_um: width of the window, um.
    Returns evenly spaced wavelengths without weights.
    """
    if light.is_line:
        return uniform(Quadrature(np.array([light.lambda_min_nm]), np.zeros((1, 3))), len(rho))
    low, high = light.range_nm
    rules = [Quadrature(nodes, np.zeros((len(nodes), 3))) for nodes in _nodes(low, high)]
    return _assemble(rules, _beats(low, high, rho, sigma_um), _usual(low, high, rho, sigma_um))


def _nodes(low_nm: float, high_nm: float) -> list[Array]:
    """Returns the wavelengths of every step, nm."""
    return [np.linspace(low_nm, high_nm, max(1, ceil((high_nm - low_nm) / step - 1e-9)) + 1) for step in _STEPS_NM]


def _beats(low_nm: float, high_nm: float, rho: Array, sigma_um: float) -> np.ndarray:
    """Finds the step, by its index, that has six wavelengths to each beat across the window, (n_rings,)."""
    needed = 1e-3 * low_nm * high_nm / (6.0 * sigma_um * np.maximum(rho, 1e-9))
    return np.asarray(np.minimum(np.searchsorted(-np.array(_STEPS_NM), -needed), len(_STEPS_NM) - 1))


def _usual(low_nm: float, high_nm: float, rho: Array, sigma_um: float) -> np.ndarray:
    """Estimates how many wavelengths the most structured lights of a range need on every ring, (n_rings,)."""
    index = np.maximum(_beats(low_nm, high_nm, rho, sigma_um), _STEPS_NM.index(_STEP_OF_DAYLIGHT_NM))
    return np.asarray(np.array([len(nodes) for nodes in _nodes(low_nm, high_nm)])[index])


def _scaled_to(white: Quadrature, rule: Quadrature) -> Quadrature:
    """Scales each channel of a quadrature to the integral that `white` gives."""
    found, asked = rule.weights.sum(axis=0), white.weights.sum(axis=0)
    # avoid 0 / 0 for a channel without weight
    scale = np.divide(asked, found, out=np.ones(3), where=found != 0.0)
    return Quadrature(rule.lambda_nm, rule.weights * scale)


def uniform(rule: Quadrature, rings: int) -> RingQuadratures:
    """Assigns one quadrature to every one of `rings` rings."""
    return _assemble([rule], np.zeros(rings, int), np.full(rings, len(rule.lambda_nm)))


def _points(y_max: float, rule: Quadrature) -> int:
    """Computes how many samples of D on [0, y_max] resolve the beat of the first and the last wavelength."""
    beat = 1e3 / rule.lambda_nm[0] - 1e3 / rule.lambda_nm[-1]
    return max(_GRID_POINTS, int(1.5 * beat * y_max))


def _response(rule: Quadrature, y: Array) -> Array:
    """Computes D(y) (len(y), 3) of X, Y, Z relative to the channels' integrals, for evenly spaced y from 0.

    exp(i(a + b)) = exp(ia) exp(ib): y is split into coarse offsets and a fine run, so that D(y) is a matrix product.
    """
    # this length of the run balances the work, since its waves are multiplied by three channels
    run = ceil(sqrt(len(y) / 3.0))
    starts, within = _waves(rule, y[::run]), _waves(rule, y[:run])
    # avoid 0 / 0 for channels with almost no weight, such as Z under a red laser
    total = np.maximum(np.abs(rule.weights).sum(axis=0), 1e-3 * np.abs(rule.weights[:, 1]).sum())
    shared = (within[:, None] * (rule.weights / total).T.astype(np.float32)).reshape(3 * run, -1)
    at_once = max(1, _PRODUCT // (len(starts) * len(shared)))
    parts = range(0, len(rule.lambda_nm), at_once)
    found = sum(starts[:, at : at + at_once] @ shared[:, at : at + at_once].T for at in parts)
    return np.asarray(found).reshape(-1, 3)[: len(y)]


def _waves(rule: Quadrature, y: Array) -> NDArray[np.complex64]:
    """Computes exp(2 pi i y / lambda), (len(y), L)."""
    turns = np.outer(y, 1e3 / rule.lambda_nm)
    # without whole turns the phase is accurate in single precision, whose sine and cosine are much faster
    turns -= np.rint(turns)
    phase = (2.0 * np.pi * turns).astype(np.float32)
    waves = np.empty(phase.shape, np.complex64)
    waves.real, waves.imag = np.cos(phase), np.sin(phase)
    return waves


def _assemble(rules: list[Quadrature], chosen: np.ndarray, usual: np.ndarray) -> RingQuadratures:
    """Concatenates the quadratures in use.

    chosen: index of the quadrature of each ring (n_rings,). usual: as in `RingQuadratures`.
    """
    used = sorted(set(chosen.tolist()))
    count = np.array([len(rules[k].lambda_nm) for k in used])
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    place = np.searchsorted(used, chosen)
    return RingQuadratures(
        1e-3 * np.concatenate([rules[k].lambda_nm for k in used]),
        np.concatenate([rules[k].weights for k in used]),
        first[place],
        count[place],
        usual,
    )
