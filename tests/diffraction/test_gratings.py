"""Gratings: directions and efficiencies of the orders in closed form, and the side to which a blaze reflects."""

import numpy as np
import pytest
from scipy.special import jv

from pipeline.diffraction.reference import Reference, power_direct
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Rectangular, Sinusoid

PERIOD, SIGMA = 2.5, 6.0
NM = 550.0


def order_directions(orders: np.ndarray, w: float, nm: float = NM) -> np.ndarray:
    """(u, v, w) of orders m at u = m lambda / period, [D14] eq. 13."""
    u = orders * 1e-3 * nm / PERIOD
    return np.stack([u, np.zeros_like(u), np.full_like(u, w)], axis=-1)


def by_both_algorithms(field: HeightField, uvw: np.ndarray, nm: float) -> list[np.ndarray]:
    """|P|^2 by the direct sum and by `Reference`."""
    direct = power_direct(field, SIGMA, uvw, nm)
    return [direct, Reference(field, SIGMA, 380.0).power(uvw, np.array([nm]))[:, 0]]


@pytest.mark.parametrize("w", [-2.0, -1.3, -0.4])
@pytest.mark.parametrize("nm", [400.0, 700.0])
def test_orders_of_a_sinusoid_are_bessel_functions(w: float, nm: float) -> None:
    """|P|^2 = J_m(k w a)^2 at order m, to 1e-6, on both sides of the mirror direction."""
    amplitude = 0.1
    field = recipes.make(
        Sinusoid(kind="sinusoid", period_um=PERIOD, amplitude_um=amplitude, size_um=25.0, pitch_um=0.09)
    )
    orders = np.arange(-5.0, 6.0)
    expected = jv(orders, 2e3 * np.pi / nm * w * amplitude) ** 2
    for power in by_both_algorithms(field, order_directions(orders, w, nm), nm):
        np.testing.assert_allclose(power, expected, atol=1e-6)


@pytest.mark.parametrize("height", [0.1, 0.25])
def test_orders_of_a_blaze_follow_its_envelope(height: float) -> None:
    """|P|^2 = sinc^2(m + w H / lambda) for a sawtooth rising towards +x; sampling errs by (pi s / M)^2 / 3.

    The sign of the transform decides on which side the light leaves.
    """
    field = recipes.make(Blazed(kind="blazed", period_um=PERIOD, height_um=height, size_um=25.0, pitch_um=0.0625))
    samples = PERIOD / field.pitch_um[0]
    orders, w = np.arange(-4.0, 5.0), -1.95
    shift = orders + w * height / (1e-3 * NM)
    for power in by_both_algorithms(field, order_directions(orders, w), NM):
        np.testing.assert_allclose(power, np.sinc(shift) ** 2, atol=float(np.max((np.pi * shift / samples) ** 2)) / 3)
    # the other sign of the transform would exchange the orders 1 and -1
    assert power[orders == 1.0] > 3 * power[orders == -1.0]


def test_even_orders_of_a_symmetric_rectangle_vanish() -> None:
    """|P|^2 = 4 sin^2(k w H / 2) / (pi m)^2 for odd m, cos^2 at m = 0, 0 for even m (samples: Dirichlet)."""
    height, w = 0.12, -1.9
    field = recipes.make(
        Rectangular(kind="rectangular", period_um=PERIOD, height_um=height, duty=0.5, size_um=25.0, pitch_um=0.0625)
    )
    samples, half_phase = PERIOD / field.pitch_um[0], np.pi / (1e-3 * NM) * w * height
    orders = np.arange(-5.0, 6.0)
    # for a sampled rectangle sin(pi m / M) M replaces pi m
    sampled = np.where(orders == 0, 1.0, samples * np.sin(np.pi * orders / samples))
    odd = np.where(orders % 2 == 1, 4 * np.sin(half_phase) ** 2 / sampled**2, 0.0)
    expected = np.where(orders == 0, np.cos(half_phase) ** 2, odd)
    for power in by_both_algorithms(field, order_directions(orders, w), NM):
        np.testing.assert_allclose(power, expected, atol=1e-9)


@pytest.mark.parametrize("theta_deg", [0.0, 30.0, 75.0])
def test_first_order_obeys_the_grating_equation(theta_deg: float) -> None:
    """sin(phi) = sin(theta) - lambda / period ([D14] eq. 13), phi on the other side of the normal."""
    field = recipes.make(Sinusoid(kind="sinusoid", period_um=PERIOD, amplitude_um=0.08, size_um=25.0, pitch_um=0.09))
    reference = Reference(field, SIGMA, 380.0)
    wi = np.array([np.sin(np.radians(theta_deg)), 0.0, np.cos(np.radians(theta_deg))])
    expected = -(wi[0] - 1e-3 * NM / PERIOD)
    sin_r = expected + np.linspace(-0.02, 0.02, 2001)
    uvw = np.stack([-wi[0] - sin_r, np.zeros_like(sin_r), -wi[2] - np.sqrt(1 - sin_r**2)], axis=-1)
    peak = sin_r[np.argmax(reference.power(uvw, np.array([NM]))[:, 0])]
    # the slope of the envelope shifts the maximum, by much less than the lobe's width of sigma_f lambda = 0.015
    assert peak == pytest.approx(expected, abs=1e-3)
