"""E(r, phi, s) against sums over samples, and the spectral operator against the reference's integral."""

import numpy as np
import pytest

from pipeline.diffraction import expansion, power_spectrum
from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.errors import AccuracyError
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import LaserLine, Light, Quadrature, trapezoid
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import line_points, quadrature, spectral, spectral_integral
from pipeline.tables.polar import table as polar

SIGMA = 2.0
LIGHT = Light()


def rough(ny: int = 120, nx: int = 90, height: float = 0.1, pitch: tuple[float, float] = (0.1, 0.09)) -> HeightField:
    """White noise: every frequency, no symmetry."""
    return HeightField(np.random.default_rng(3).uniform(-height, height, (ny, nx)), pitch)


def spectrum_of(
    field: HeightField, azimuths: Azimuths, lambda_min_nm: float = 380.0, spacing: float = power_spectrum.SPACING
) -> power_spectrum.PolarPowerSpectrum:
    z = expansion.largest_phase(field.half_range_um, lambda_min_nm)
    terms, nodes = (expansion.chebyshev_order(z, tolerance) + 1 for tolerance in (1e-6, 1e-5))
    radius = power_spectrum.radii(SIGMA, 2e3 / lambda_min_nm, spacing)
    built = power_spectrum.chebyshev_stack(field, SIGMA, radius[-1], terms, 1e-6)
    return power_spectrum.build(built, azimuths, radius, lambda_min_nm, nodes)


@pytest.mark.parametrize("height", [0.0, 0.1, 0.6])
def test_every_node_is_the_sum_over_samples(height: float) -> None:
    """Both half turns, one vector of terms and several, and zero where the scan knows nothing."""
    field, azimuths = rough(height=height), Azimuths(64, 0.6, 0.3)
    power = spectrum_of(field, azimuths)
    rng = np.random.default_rng(0)
    tile, ring, node, lane = (rng.integers(n, size=150) for n in power.values.shape)
    r, phi = power.radius_per_um[ring], azimuths.angles()[16 * tile + lane]
    # at 1 um, (u, v) is the frequency and |w| = s / (2 pi)
    uvw = np.stack([r * np.cos(phi), r * np.sin(phi), -power.s_per_um[node] / (2.0 * np.pi)], axis=-1)
    expected = power_direct(field, SIGMA, uvw, 1000.0)
    found = power.values[tile, ring, node, lane]
    unknown = np.isnan(expected)
    assert np.all(found[unknown] == 0.0)
    level = np.mean(expected[~unknown])
    np.testing.assert_allclose(found[~unknown], expected[~unknown], rtol=1e-4, atol=2e-4 * level)


def test_what_the_scan_does_not_know_is_zero() -> None:
    field = rough(pitch=(0.2, 0.2))
    power = spectrum_of(field, Azimuths(32))
    r, phi = power.radius_per_um, power.azimuths.angles()[0]
    assert phi == 0.0
    np.testing.assert_array_equal(power.values[0, :, :, 0].max(axis=1) == 0.0, r > 2.5)


def test_thinned_azimuths_are_those_of_a_coarser_grid() -> None:
    field = rough()
    fine, coarse = (spectrum_of(field, Azimuths(n, 0.7, 0.1)) for n in (128, 64))
    thinned = fine.thinned(2)
    assert thinned.azimuths == coarse.azimuths
    np.testing.assert_allclose(thinned.values, coarse.values, rtol=1e-4, atol=1e-7)


# the origin, where radii are mirrored, and out to the rim; rings alone and rings that share points
RHO = np.array([0.0, 0.004, 0.03, 0.4, 1.1, 1.13, 1.16, 1.9, 1.95, 2.0])


def integral_error(
    field: HeightField, power: power_spectrum.PolarPowerSpectrum, rule: Quadrature, w_terms: int
) -> float:
    """The largest difference between rings' integrals and the reference's, over the mean and what is there."""
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
        phi = power.azimuths.angles()
        w = -share * np.sqrt(4.0 - RHO**2)
        uvw = np.stack(
            np.broadcast_arrays(RHO[:, None] * np.cos(phi), RHO[:, None] * np.sin(phi), w[:, None]), axis=-1
        )
        exact = np.nan_to_num(reference.power(uvw.reshape(-1, 3), rule.lambda_nm)) @ rule.weights
        exact = exact.reshape(found.shape)
        # at the rim |w| vanishes and with it all light but the mirror's
        level = exact.mean(axis=(1, 2), keepdims=True) + 1e-7
        worst = max(worst, float(np.max(np.abs(found - exact) / (exact + level))))
    return worst


@pytest.mark.parametrize("w_terms", [8, 12])
@pytest.mark.parametrize(("range_nm", "tolerance"), [((380.0, 780.0), 6e-3), ((500.0, 560.0), 2.5e-2)])
def test_a_ring_holds_the_integral_over_wavelengths(
    w_terms: int, range_nm: tuple[float, float], tolerance: float
) -> None:
    """Nodes of w by eight and by four. A narrow range averages less of what the radii's distance leaves."""
    field = rough()
    power = spectrum_of(field, Azimuths(32, 0.8, 0.2), range_nm[0])
    assert integral_error(field, power, trapezoid(Light(range_nm=range_nm), 5.0), w_terms) < tolerance


@pytest.mark.parametrize("step_nm", [60.0, 20.0])
def test_few_wavelengths_are_their_own_points(step_nm: float) -> None:
    """Nothing averages what interpolation leaves: radii are as near as for a line."""
    field, light = rough(), Light(range_nm=(500.0, 560.0))
    power = spectrum_of(field, Azimuths(32, 0.8, 0.2), 500.0, power_spectrum.SPACING_OF_A_LINE)
    rule = trapezoid(light, step_nm)
    rules = quadrature.uniform(rule, len(RHO))
    nodes = power.values.shape[2]
    points = line_points.choose(power.radius_per_um, nodes, power.s_max_per_um, RHO, rules)
    assert points.on_nodes.all()
    np.testing.assert_allclose(1e3 / points.kappa_per_um[: points.count[0]], rule.lambda_nm[::-1])
    assert integral_error(field, power, rule, 8) < 4e-3


@pytest.mark.parametrize(("height", "w_terms"), [(0.05, 8), (0.6, 36)])
def test_points_on_radii_and_between_them_give_one_integral(
    height: float, w_terms: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every ring that is allowed on radii, forced between them, where interpolation over r is the old one."""
    power = spectrum_of(rough(height=height), Azimuths(32, 0.8, 0.2))
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
def test_rings_that_share_points_give_what_each_gives_alone(metal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    power, rings = spectrum_of(rough(), Azimuths(32, 0.8, 0.2)), Rings(140, 0.12)
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


@pytest.mark.slow
def test_wavelengths_follow_the_radius() -> None:
    """Near the mirror direction a few, at the rim many; and the estimate bounds what is measured."""
    rho, tolerance = Rings(40, 0.1).rho(), 1e-3
    light = Radiometry(LIGHT, Material(), 16.25).integrand
    rules = quadrature.choose(light, rho, 16.25, tolerance)
    assert np.all(np.diff(rules.count) >= 0)
    assert rules.count[0] <= 41
    assert rules.count[-1] >= 201
    # independent waves in the window, as speckle has them
    rng = np.random.default_rng(5)
    x, exact = rng.normal(0.0, 16.25 / np.sqrt(2.0), 4000), light(0.05)
    for ring in (5, 20, 39):
        chosen = slice(rules.first[ring], rules.first[ring] + rules.count[ring])

        def answer(lambda_um: np.ndarray, weights: np.ndarray, rho_of_ring: float = rho[ring]) -> np.ndarray:
            return np.exp(2j * np.pi * np.outer(x, rho_of_ring / lambda_um)) @ weights[:, 1]

        error = answer(rules.lambda_um[chosen], rules.weights[chosen]) - answer(1e-3 * exact.lambda_nm, exact.weights)
        assert np.sqrt(np.mean(np.abs(error) ** 2)) < 2.0 * tolerance


def test_every_ring_keeps_the_white() -> None:
    """20 nm alone would miss a hundredth of Z's whole integral, in the mirror direction above all."""
    light = Radiometry(LIGHT, Material(), 16.25).integrand
    rules = quadrature.choose(light, Rings(40, 0.1).rho(), 16.25, 1e-3)
    white = light(0.05).weights.sum(axis=0)
    for first, count in zip(rules.first, rules.count, strict=True):
        np.testing.assert_allclose(rules.weights[first : first + count].sum(axis=0), white, rtol=1e-4)


def test_a_laser_line_needs_one_wavelength() -> None:
    light = Light(illuminant=LaserLine(lambda_nm=532.0))
    rules = quadrature.choose(Radiometry(light, Material(), 16.25).integrand, np.arange(3.0), 16.25, 1e-3)
    np.testing.assert_array_equal(rules.lambda_um, [0.532])
    np.testing.assert_array_equal(rules.count, [1, 1, 1])


def test_a_window_too_wide_for_the_finest_step_is_refused() -> None:
    with pytest.raises(AccuracyError, match="steps finer than"):
        quadrature.choose(Radiometry(LIGHT, Material(), 300.0).integrand, np.array([2.0]), 300.0, 1e-4)


def test_a_mirror_keeps_its_lobe() -> None:
    """|P|^2 = exp(-(rho / lambda)^2 / sigma_f^2) at every w: the whole table in closed form."""
    field = HeightField(np.full((100, 100), 3.0), (0.15, 0.15))
    power = spectrum_of(field, Azimuths(32))
    rings, rule = Rings(120, 0.1), trapezoid(LIGHT, 5.0)
    table = polar.build(
        power, rings, quadrature.uniform(rule, 120), 4, lambda nm, cos: np.ones((*cos.shape, len(nm)))
    )
    rho, phi = np.linspace(0.0, 0.3, 40), np.linspace(0.0, 6.0, 40)
    uvw = np.stack([rho * np.cos(phi), rho * np.sin(phi), np.full(40, -1.3)], axis=-1)
    lobe = np.exp(-((rho[:, None] / (1e-3 * rule.lambda_nm)) ** 2) * (2.0 * np.pi * SIGMA) ** 2)
    np.testing.assert_allclose(table.look_up(uvw), lobe @ rule.weights, atol=3e-5)


def test_the_spectral_form_answers_every_wavelength_without_integration() -> None:
    """Between all nodes, against sums over samples; the speckle's mean is what errors are held against."""
    field = rough(height=0.08)
    power = spectrum_of(field, Azimuths(1536), spacing=power_spectrum.SPACING_OF_A_LINE)
    table = spectral.build(power)
    rng = np.random.default_rng(6)
    rho, phi, share = rng.uniform(0.05, 1.9, 60), rng.uniform(-np.pi, np.pi, 60), rng.uniform(0.1, 1.0, 60)
    uvw = np.stack([rho * np.cos(phi), rho * np.sin(phi), -share * np.sqrt(4.0 - rho**2)], axis=-1)
    wavelengths = np.array([380.0, 455.5, 633.0, 780.0])
    exact = np.stack([np.nan_to_num(power_direct(field, SIGMA, uvw, nm)) for nm in wavelengths], axis=-1)
    found = spectral.look_up(table, uvw, wavelengths)
    error = np.abs(found - exact) / (exact + np.median(exact))
    assert np.percentile(error, 90) < 2e-3
    assert error.max() < 3e-2


def test_the_spectral_form_says_where_it_ends() -> None:
    table = spectral.build(spectrum_of(rough(), Azimuths(64), 500.0))
    found = spectral.look_up(table, np.array([[1.9, 0.0, -0.1], [0.1, 0.0, -1.9]]), np.array([400.0, 500.0]))
    np.testing.assert_array_equal(np.isnan(found), [[True, False], [True, False]])
