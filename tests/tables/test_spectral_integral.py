"""The spectral integral on rings against the reference, and its interpolation points against each other."""

import numpy as np
import pytest

from kernels import programs, spectral_operator
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.diffraction.reference import Reference
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import LaserLine, Light, Quadrature, trapezoid
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import line_points, quadrature, spectral_integral
from tests.diffraction.fields import SIGMA, power_spectrum_of, rough

LIGHT = Light()


# from the origin, where radii are mirrored, to the rim; with single rings and rings that share points
RHO = np.array([0.0, 0.004, 0.03, 0.4, 1.1, 1.13, 1.16, 1.9, 1.95, 2.0])


def integral_error(
    field: HeightField, power: power_spectrum.PolarPowerSpectrum, rule: Quadrature, w_terms: int
) -> float:
    """The largest error of the rings' integrals, relative to the sum of mean and local value of the reference."""
    terms = spectral_integral.integrate(
        power.values,
        power.radius_per_um,
        power.s_max_per_um,
        RHO,
        quadrature.uniform(rule, len(RHO)),
        w_terms,
    )
    assert terms.shape == (len(RHO), 3, w_terms, 32)
    reference = Reference(field, SIGMA, rule.lambda_min_nm)
    worst = 0.0
    for share in (0.05, 0.5, 0.97):
        cosines = np.cos(np.arange(w_terms) * np.arccos(2.0 * share - 1.0))
        found = np.einsum("rcka,k->rac", terms, cosines)
        phi = power.azimuths.phi()
        w = -share * np.sqrt(4.0 - RHO**2)
        uvw = np.stack(
            np.broadcast_arrays(RHO[:, None] * np.cos(phi), RHO[:, None] * np.sin(phi), w[:, None]), axis=-1
        )
        exact = np.nan_to_num(reference.power(uvw.reshape(-1, 3), rule.lambda_nm)) @ rule.weights
        exact = exact.reshape(found.shape)
        # at the rim |w| vanishes, and with it all light except the mirror's
        level = exact.mean(axis=(1, 2), keepdims=True) + 1e-7
        worst = max(worst, float(np.max(np.abs(found - exact) / (exact + level))))
    return worst


@pytest.mark.parametrize("w_terms", [8, 12])
@pytest.mark.parametrize(("range_nm", "tolerance"), [((380.0, 780.0), 6e-3), ((500.0, 560.0), 2.5e-2)])
def test_rings_agree_with_the_integral_of_the_reference(
    w_terms: int, range_nm: tuple[float, float], tolerance: float
) -> None:
    """For nodes in w in groups of eight and of four. A narrow range averages less of the error between radii."""
    field = rough()
    power = power_spectrum_of(field, Azimuths(32, 0.8, 0.2), range_nm[0])
    assert integral_error(field, power, trapezoid(Light(range_nm=range_nm), 5.0), w_terms) < tolerance


@pytest.mark.parametrize("step_nm", [60.0, 20.0])
def test_few_wavelengths_are_themselves_the_points(step_nm: float) -> None:
    """Few wavelengths do not average the error between radii, so radii are as close as for a laser line."""
    field, light = rough(), Light(range_nm=(500.0, 560.0))
    power = power_spectrum_of(field, Azimuths(32, 0.8, 0.2), 500.0, power_spectrum.SPACING_OF_A_LINE)
    rule = trapezoid(light, step_nm)
    rules = quadrature.uniform(rule, len(RHO))
    nodes = power.values.shape[2]
    points = line_points.choose(power.radius_per_um, nodes, power.s_max_per_um, RHO, rules)
    assert points.on_nodes.all()
    np.testing.assert_allclose(1e3 / points.kappa_per_um[: points.count[0]], rule.lambda_nm[::-1])
    assert integral_error(field, power, rule, 8) < 4e-3


@pytest.mark.parametrize(("height", "w_terms"), [(0.05, 8), (0.6, 36)])
def test_points_on_radii_and_between_them_give_equal_integrals(
    height: float, w_terms: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The points of all rings are forced to lie between radii, and the integrals compared."""
    power = power_spectrum_of(rough(height=height), Azimuths(32, 0.8, 0.2))
    rho = np.linspace(0.0, 2.0, 41)
    rules = quadrature.uniform(trapezoid(LIGHT, 5.0), len(rho))
    of = power.radius_per_um, power.s_max_per_um, rho, rules
    shape = power.values.shape[2]
    points = line_points.choose(of[0], shape, *of[1:])
    assert points.on_radii[-3:].all()
    assert not points.on_radii[:2].any()
    assert np.all(points.count >= 8)
    mixed = spectral_integral.integrate(power.values, *of, w_terms)
    monkeypatch.setattr(line_points, "_STEP_ON_RADII", 0.0)
    monkeypatch.setattr(line_points, "_STEP_IN_RADII", 0.1)
    assert not line_points.choose(of[0], shape, *of[1:]).on_radii[:-1].any()
    between = spectral_integral.integrate(power.values, *of, w_terms)
    level = np.sqrt(np.mean(between.astype(np.float64) ** 2, axis=(2, 3), keepdims=True))
    np.testing.assert_array_less(np.abs(mixed - between) / level, 2e-2)
    assert np.sqrt(np.mean(((mixed - between) / level) ** 2)) < 2e-3


@pytest.mark.parametrize("metal", [False, True])
def test_rings_that_share_points_agree_with_separate_rings(metal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    power, rings = power_spectrum_of(rough(), Azimuths(32, 0.8, 0.2)), Rings(140, 0.12)
    material = Material(fresnel="conductor") if metal else Material()
    rules = quadrature.uniform(trapezoid(LIGHT, 5.0), rings.count)
    of = power.radius_per_um, power.s_max_per_um, rings.rho(), rules
    nodes, reflectance = power.values.shape[2], Radiometry(LIGHT, material, SIGMA).reflectance
    points = line_points.choose(of[0], nodes, *of[1:])
    assert points.rings.sum() == rings.count
    assert points.rings.max() == 8
    assert len(points.rings) < 60
    np.testing.assert_array_less(
        points.kappa_per_um * of[2][points.first_ring].repeat(points.count), of[0][-1] + 1e-9
    )
    together = spectral_integral.integrate(power.values, *of, 12, reflectance)
    monkeypatch.setattr(line_points, "MOST_RINGS", 1)
    assert len(line_points.choose(of[0], nodes, *of[1:]).rings) == rings.count
    alone = spectral_integral.integrate(power.values, *of, 12, reflectance)
    level = np.sqrt(np.mean(alone.astype(np.float64) ** 2, axis=(2, 3), keepdims=True))
    np.testing.assert_array_less(np.abs(together - alone) / level, 2e-2)
    assert np.sqrt(np.mean(((together - alone) / level) ** 2)) < 1e-3


@pytest.mark.parametrize("at_once", [4, 3])
def test_lights_in_one_pass_have_the_tables_that_each_has_alone(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last bit, whether they share all points, some or none, and in as many passes as they need."""
    power, rings = power_spectrum_of(rough(), Azimuths(32, 0.8, 0.2)), Rings(140, 0.12)
    gold = Radiometry(LIGHT, Material(fresnel="conductor"), SIGMA)
    white = quadrature.choose(gold.illumination, rings.rho(), SIGMA, 3e-4)
    others = [
        quadrature.choose(Radiometry(light, Material(), SIGMA).illumination, rings.rho(), SIGMA, 3e-4)
        for light in (
            Light(illuminant="A"),
            Light(range_nm=(600.0, 620.0)),
            Light(illuminant=LaserLine(lambda_nm=532.0)),
        )
    ]
    assert not np.array_equal(white.count, others[0].count)
    integrands = [spectral_integral.Integrand(white, gold.reflectance), *map(spectral_integral.Integrand, others)]
    of = power.values, power.radius_per_um, power.s_max_per_um, rings.rho()
    alone = [spectral_integral.integrate(*of, each.quadratures, 8, each.reflectance) for each in integrands]
    monkeypatch.setattr(programs, "MOST_W_TERMS", 8 * at_once)
    together = spectral_integral.integrate_all(*of, integrands, 8)
    for one, same in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, same)


def test_white_lights_share_their_points_whatever_they_need_of_wavelengths() -> None:
    power, rho = power_spectrum_of(rough(), Azimuths(32, 0.8, 0.2)), Rings(140, 0.12).rho()
    found = []
    for name in ("A", "D65", "E"):
        light = Radiometry(Light(illuminant=name), Material(), SIGMA)
        rules = quadrature.choose(light.illumination, rho, SIGMA, 3e-4)
        points = line_points.choose(power.radius_per_um, power.values.shape[2], power.s_max_per_um, rho, rules)
        span, integrand = spectral_operator.whole_span(rho, points), spectral_integral.Integrand(rules)
        found.append(spectral_integral.on_rings(rho, points, span, integrand, 8).groups())
    assert found[0].keys() == found[1].keys() == found[2].keys()
