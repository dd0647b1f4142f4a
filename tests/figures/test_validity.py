"""The coupled-wave solver against published and analytic cases, the page and the domain it holds."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.figures import coupled_wave, validity
from pipeline.figures.coupled_wave import Grating, Resolution
from pipeline.figures.validity import Case
from pipeline.optics import fresnel
from pipeline.optics import validity as domain
from pipeline.surface.statistics import Period

needs_solver = pytest.mark.skipif(not coupled_wave.available(), reason="meent, of the extra bench, is not installed")


def test_a_staircase_is_solid_under_its_columns() -> None:
    """Three heights of a blaze: two layers, the upper one under one column."""
    stairs = coupled_wave.staircase(validity.sawtooth, 3)
    np.testing.assert_array_equal(stairs.solid, [[False, False, True], [False, True, True]])
    np.testing.assert_allclose(stairs.thickness, 1.0 / 3.0)
    # both flanks of a sinusoid are in one layer
    assert len(coupled_wave.staircase(validity.cosine, 24).thickness) == 11


@needs_solver
@pytest.mark.parametrize("polarisation", coupled_wave.POLARISATIONS)
@pytest.mark.parametrize("index", [1.37 + 7.62j, 1.5 + 1e-6j])
def test_a_flat_surface_reflects_as_fresnel_says(polarisation: coupled_wave.Polarisation, index: complex) -> None:
    theta = 0.6
    flat = Grating(lambda x: np.zeros_like(x), 2.3, theta, index)
    found = coupled_wave.solve(flat, np.ones(1), polarisation, Resolution(3, 4))[0]
    eta = np.array([np.cos(theta), np.sqrt(1.0 - np.sin(theta) ** 2 / index**2)])
    weights = np.array([1.0, index]) if polarisation == "TE" else np.array([index, 1.0])
    a, b = weights * eta
    np.testing.assert_allclose(found, np.eye(7)[3] * np.abs((a - b) / (a + b)) ** 2, atol=1e-6)


@needs_solver
@pytest.mark.parametrize(
    ("polarisation", "order", "published"),
    [("TM", 0, {10: 0.84211, 20: 0.84425}), ("TE", 1, {10: 0.76227, 20: 0.73857})],
)
def test_a_lamellar_metal_grating_converges_as_published(
    polarisation: coupled_wave.Polarisation, order: int, published: dict[int, float]
) -> None:
    """Lalanne & Hugonin 2000, tables 1 and 2: five digits at every truncation."""
    for orders, value in published.items():
        found = coupled_wave.solve(validity._LAMELLAR, np.ones(1), polarisation, Resolution(orders, 2))
        assert found[0, orders + order] == pytest.approx(value, abs=1e-5)


@needs_solver
@pytest.mark.parametrize("polarisation", coupled_wave.POLARISATIONS)
def test_a_metal_without_losses_keeps_all_light(polarisation: coupled_wave.Polarisation) -> None:
    """eps = -100: orders share exactly what comes in, at any resolution."""
    grating = Grating(validity.sawtooth, 3.3, 0.3, 1e-7 + 10.0j)
    found = coupled_wave.solve(grating, np.array([0.1, 0.4]), polarisation, Resolution(8, 8))
    np.testing.assert_allclose(np.sum(found, axis=1), 1.0, atol=1e-5)


@needs_solver
def test_light_and_view_may_change_places() -> None:
    """Reciprocity of an order's efficiency: from theta to its direction, and back."""
    period, theta, index = 2.3, 0.25, 1.37 + 7.62j
    there = Grating(validity.sawtooth, period, theta, index)
    # travels towards +x at sin t, leaves towards sin t - 1 / period; back it travels towards 1 / period - sin t
    back = replace(there, theta=float(np.arcsin(1.0 / period - np.sin(theta))))
    for polarisation in coupled_wave.POLARISATIONS:
        one, other = (
            coupled_wave.solve(each, np.array([0.3]), polarisation, Resolution(10, 8))[0, 11]
            for each in (there, back)
        )
        assert one == pytest.approx(other, rel=1e-6)


@needs_solver
@pytest.mark.parametrize(
    "key", [key for key in validity._INTEGRAL if key[3] <= 3.05 and key != validity._RESONANCE], ids=str
)
def test_extrapolated_waves_meet_a_boundary_integral(key: tuple[str, str, float, float, float]) -> None:
    """Two rigorous methods, one number, in unpolarised light."""
    case, depth = Case(*key[:4]), np.array([key[4]])
    found = np.mean(validity.rigorous(case, depth))
    assert found == pytest.approx(validity._INTEGRAL[key], abs=validity._RELIABLE[case.material])


@needs_solver
@pytest.mark.parametrize("shape", validity.SHAPES)
def test_long_shallow_gratings_are_scalar(shape: str) -> None:
    """Signs and factors of both sides: at 12 wavelengths and a tenth deep they differ by little of the order itself."""
    case, depth = Case(shape, validity.DIELECTRIC, 30.0, 12.6), np.array([0.1])
    found = validity.solve(case, depth)
    assert abs(found.error[0]) < 0.02 * found.rigorous[0]
    # the other side's order of a blaze is another one
    if shape == "blaze":
        grating = Grating(validity.sawtooth, case.period, 0.0, validity.INDICES[case.material])
        orders = coupled_wave.solve(grating, np.array([0.3]), "TE", Resolution(16, 12))[0]
        assert orders[17] > 3.0 * orders[15]


def test_the_scalar_side_is_the_reflectance_of_a_mirror_where_all_light_goes_one_way() -> None:
    """A blaze of half a wavelength in a period without end: R |c_1|^2 G / w^2 = R(ti)."""
    case = Case("blaze", validity.METAL, 0.0, 1e4)
    ours, bare = validity.scalar(case, np.array([0.5]))
    assert ours[0] == pytest.approx(1.0, abs=1e-6)
    assert bare[0] == pytest.approx(1.0, abs=1e-6)
    assert fresnel.reflectance(1.0, validity.INDICES[validity.METAL]) == pytest.approx(0.914, abs=1e-3)


def test_the_quoted_table_falls_with_period_and_rises_with_depth() -> None:
    for errors in (domain.SMOOTH, domain.EDGED):
        table = np.array(errors)
        assert table.shape == (len(domain.PERIODS), len(domain.DEPTHS))
        assert np.all(np.diff(table, axis=0) <= 0.0)
        assert np.all(np.diff(table, axis=1) >= 0.0)
    assert np.all(np.array(domain.SMOOTH) <= np.array(domain.EDGED))


def test_a_surface_finds_its_place() -> None:
    """Between the table's lines the coarser class counts; finer and deeper ones are beyond it."""
    found = domain.place(2.5, 0.02, 500.0)
    assert found.period == pytest.approx(5.0)
    # 2 sqrt(2) 0.04 = 0.113 and sqrt(12) 0.04 = 0.139: both above 0.1
    assert (found.smooth, found.edged) == (domain.SMOOTH[2][1], domain.EDGED[2][1])
    assert found.within
    assert domain.place(0.6, 0.02, 500.0).smooth is None
    deep = domain.place(2.5, 0.08, 500.0)
    assert (deep.smooth, deep.edged) == (domain.SMOOTH[2][3], None)
    assert not deep.within


def test_harmonics_are_no_periods_of_their_own() -> None:
    blaze = [Period(2.5, 0.0, 0.6), Period(1.25, 0.5, 0.15), Period(0.84, -0.5, 0.07)]
    assert domain.finest_period_um(blaze) == 2.5
    assert domain.finest_period_um([*blaze, Period(1.25, 60.0, 0.1)]) == 1.25
    assert domain.finest_period_um([*blaze, Period(1.7, 0.0, 0.1)]) == 1.7
    assert domain.finest_period_um([]) == np.inf
