"""The reference: closed forms of flat surfaces, signs, symmetries, and agreement of the two algorithms."""

import numpy as np
import pytest

from pipeline.diffraction.reference import Reference, power_direct, xyz_direct
from pipeline.errors import AccuracyError
from pipeline.optics import brdf, geometry
from pipeline.optics.brdf import Radiometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import LaserLine, Light, trapezoid
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.tables.evaluate import Map

LAMBDA_NM = 550.0


def rough(ny: int, nx: int, pitch: tuple[float, float], height: float, seed: int = 3) -> HeightField:
    """White noise, which has all frequencies and no symmetry."""
    return HeightField(np.random.default_rng(seed).uniform(-height, height, (ny, nx)), pitch)


def pairs(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random unit vectors wi and wr (count, 3)."""
    rng = np.random.default_rng(seed)
    theta, phi = np.arccos(rng.uniform(0.1, 1.0, (2, count))), rng.uniform(0, 2 * np.pi, (2, count))
    return geometry.direction(theta[0], phi[0]), geometry.direction(theta[1], phi[1])


def test_power_of_a_mirror_is_the_transform_of_the_window() -> None:
    """|P|^2 = exp(-|f|^2 / sigma_f^2): a Gaussian lobe of width sigma_f, 1 at its peak."""
    field = HeightField(np.full((160, 160), 7.0), (0.1, 0.1))
    u = np.linspace(-0.1, 0.1, 21)
    uvw = np.stack([u, 0.3 * u, np.full_like(u, -1.9)], axis=-1)
    f2 = (uvw[:, 0] ** 2 + uvw[:, 1] ** 2) / (1e-3 * LAMBDA_NM) ** 2
    expected = np.exp(-f2 / sigma_f(3.0) ** 2)
    np.testing.assert_allclose(power_direct(field, 3.0, uvw, LAMBDA_NM), expected, atol=1e-14)


def test_a_plane_rising_towards_x_reflects_towards_minus_x() -> None:
    """At normal incidence on a slope of angle a, the light leaves at 2 a on the other side of the normal."""
    slope = np.tan(np.radians(2.0))
    x = (np.arange(400) - 200) * 0.05
    field = HeightField(np.tile(slope * x, (400, 1)), (0.05, 0.05))
    angles = np.radians(np.linspace(-8.0, 8.0, 161))
    wi = np.broadcast_to([0.0, 0.0, 1.0], (161, 3))
    wr = np.stack([np.sin(angles), np.zeros(161), np.cos(angles)], axis=-1)
    power = power_direct(field, 2.0, geometry.uvw(wi, wr), LAMBDA_NM)
    assert np.degrees(angles[np.argmax(power)]) == pytest.approx(-4.0, abs=0.11)


def test_direct_sum_equals_an_explicit_sum_over_samples_and_copies() -> None:
    """P = sum g p exp(+2 pi i f.x) / sum g, by loops over the samples and the copies of the patch."""
    field, sigma = rough(6, 8, (0.3, 0.25), 0.1), 0.8
    uvw = np.array([[0.4, -0.7, -1.3], [-0.9, 0.2, -1.1]])
    copies, k = 5, 2 * np.pi / (1e-3 * LAMBDA_NM)
    x, y = field.coordinates_um()
    amplitude, total = np.zeros(2, complex), 0.0
    for cy in range(-copies, copies + 1):
        for cx in range(-copies, copies + 1):
            for j in range(6):
                for i in range(8):
                    px, py = x[i] + cx * field.size_um[0], y[j] + cy * field.size_um[1]
                    g = np.exp(-(px**2 + py**2) / (2 * sigma**2))
                    total += g
                    f = uvw[:, :2] / (1e-3 * LAMBDA_NM)
                    phase = k * uvw[:, 2] * field.heights_um[j, i] + 2 * np.pi * (f[:, 0] * px + f[:, 1] * py)
                    amplitude += g * np.exp(1j * phase)
    np.testing.assert_allclose(power_direct(field, sigma, uvw, LAMBDA_NM), np.abs(amplitude / total) ** 2, rtol=1e-12)


@pytest.mark.parametrize(
    ("field", "sigma"),
    [
        (rough(64, 64, (0.1, 0.1), 0.2), 2.0),
        (rough(48, 90, (0.13, 0.09), 0.35), 1.5),
        (rough(65, 33, (0.1, 0.1), 0.05), 6.0),
        (rough(80, 80, (0.1, 0.1), 2.0), 0.3),
        (rough(40, 40, (0.1, 0.1), 10.0), 0.3),
        (HeightField(np.zeros((32, 32)), (0.1, 0.1)), 1.0),
    ],
    ids=[
        "square",
        "oblong",
        "odd, window over many copies",
        "4 um tall, window of three pixels",
        "20 um tall",
        "flat",
    ],
)
def test_reference_agrees_with_the_direct_sum(field: HeightField, sigma: float) -> None:
    """The Jacobi-Anger expansion and the gather agree with the direct sum to 1e-9 of the mirror."""
    reference = Reference(field, sigma, 380.0)
    wi, wr = pairs(40)
    uvw = np.concatenate([geometry.uvw(wi, wr), [[0.0, 0.0, -2.0], [0.0, 0.0, -1e-3], [-1.2, 0.4, -1e-9]]])
    for nm in (380.0, 500.0, 780.0):
        direct = power_direct(field, sigma, uvw, nm)
        np.testing.assert_allclose(reference.power(uvw, np.array([nm]))[:, 0], direct, atol=1e-9)
        assert np.nanmax(direct) > 1e-4


@pytest.mark.parametrize("theta_deg", [0.0, 35.0], ids=["normal light: opposite views share f", "oblique light"])
def test_the_rows_of_a_map_agree_with_the_direct_sum(theta_deg: float) -> None:
    """Views of equal v share sums over columns; some lie beyond the Nyquist limits. To 1e-9 of the mirror."""
    field, nm = rough(48, 90, (0.23, 0.19), 0.15), np.array([390.0, 391.0, 500.0, 610.0, 780.0])
    wr = Map(15).views()
    uvw = geometry.uvw(np.broadcast_to(geometry.direction(np.radians(theta_deg), 0.3), wr.shape), wr)
    direct = np.stack([power_direct(field, 2.0, uvw, one) for one in nm], axis=-1)
    found = Reference(field, 2.0, 380.0).power(uvw, nm)
    np.testing.assert_allclose(found, direct, atol=1e-9)
    assert np.nanmax(direct) > 1e-3
    assert 0.0 < np.mean(np.isnan(found)) < 0.5


def test_the_power_of_a_direction_does_not_depend_on_the_other_directions() -> None:
    """In any order, alone or together with others of the same v, and repeated: equal to rounding."""
    reference = Reference(rough(40, 56, (0.1, 0.1), 0.2), 1.5, 380.0)
    rng, nm = np.random.default_rng(4), np.array([420.0, 555.0])
    u, w = rng.uniform(-1.2, 1.2, 90), rng.choice([-1.7, -1.1, -0.4], 90)
    uvw = np.stack([u, rng.choice([0.0, -0.31, 0.31, 0.9], 90), w], axis=-1)
    uvw = np.concatenate([uvw, uvw[:20], -uvw[:20] * [1.0, 1.0, -1.0]])
    together = reference.power(uvw, nm)
    shuffled = rng.permutation(len(uvw))
    np.testing.assert_allclose(reference.power(uvw[shuffled], nm), together[shuffled], rtol=1e-9, atol=1e-15)
    alone = np.concatenate([reference.power(one[None], nm) for one in uvw])
    np.testing.assert_allclose(together, alone, rtol=1e-9, atol=1e-15)


def test_frequencies_beyond_the_nyquist_limit_count_as_dark() -> None:
    """XYZ of a direction is the integral over the wavelengths within the limit."""
    field, light, material = rough(32, 32, (0.3, 0.3), 0.1), Light(), Material(normalisation="relative")
    wi, wr = np.array([[0.0, 0.0, 1.0]]), geometry.direction(np.array([np.radians(65.0)]), np.array([0.0]))
    rule = trapezoid(light, 1.0)
    power = Reference(field, 2.0, 380.0).power(geometry.uvw(wi, wr), rule.lambda_nm)
    known = np.isfinite(power[0])
    assert 0.2 < np.mean(known) < 0.8
    expected = brdf.direction_factor(material, rule, wi, wr) * (power[0, known] @ rule.weights[known])
    found = Reference(field, 2.0, 380.0).xyz(light, material, wi, wr)
    np.testing.assert_allclose(found[0], expected, rtol=1e-12)


def test_opposite_views_of_a_map_are_opposite_to_the_last_bit() -> None:
    """Hence one sum serves two views under a light at normal incidence."""
    for size in (61, 300, 301):
        views = Map(size).views()
        np.testing.assert_array_equal(views[::-1], views * [-1.0, -1.0, 1.0])


def test_heights_outside_the_window_change_nothing() -> None:
    """A step of a micrometre at the edge of the patch is ten sigma from the middle; it is cut off."""
    heights = rough(120, 120, (0.1, 0.1), 0.05).heights_um
    stepped = heights.copy()
    stepped[:, :8] += 1.0
    wi, wr = pairs(20)
    uvw, nm = geometry.uvw(wi, wr), np.array([LAMBDA_NM])
    flat, tall = (Reference(HeightField(h, (0.1, 0.1)), 0.5, 380.0).power(uvw, nm) for h in (heights, stepped))
    np.testing.assert_allclose(tall, flat, atol=1e-12)


def test_a_window_finer_than_the_samples_is_refused() -> None:
    """Below 1.2 pitches the sum over samples differs from the window's integral, and so do the two algorithms."""
    field = rough(32, 32, (0.1, 0.12), 0.05)
    with pytest.raises(AccuracyError, match=r"sigma_um = 0.14 .* at least 1.2 pitches, 0.144 um"):
        Reference(field, 0.14, 380.0)
    wi, wr = pairs(20)
    uvw = geometry.uvw(wi, wr)
    fast = Reference(field, 0.144, 380.0).power(uvw, np.array([LAMBDA_NM]))[:, 0]
    np.testing.assert_allclose(fast, power_direct(field, 0.144, uvw, LAMBDA_NM), atol=1e-9)


def test_a_constant_added_to_the_heights_changes_nothing() -> None:
    field = rough(40, 40, (0.1, 0.1), 0.2)
    lifted = HeightField(field.heights_um + 123.4, field.pitch_um)
    wi, wr = pairs(10)
    before, after = (power_direct(f, 1.5, geometry.uvw(wi, wr), LAMBDA_NM) for f in (field, lifted))
    np.testing.assert_allclose(after, before, rtol=1e-9)


def test_power_is_nan_beyond_the_nyquist_limit() -> None:
    """A pitch of 0.3 um limits |f| to 1.67 / um, which light of 0.55 um reaches at u = 0.917."""
    field = rough(32, 32, (0.3, 0.3), 0.1)
    uvw = np.array([[0.90, 0.0, -1.0], [0.93, 0.0, -1.0], [0.0, -0.93, -1.0]])
    for power in (
        power_direct(field, 2.0, uvw, LAMBDA_NM),
        Reference(field, 2.0, 380.0).power(uvw, np.array([550.0])),
    ):
        np.testing.assert_array_equal(np.isfinite(np.ravel(power)), [True, False, False])


def test_the_brdf_is_reciprocal() -> None:
    """XYZ / cos(ti) is symmetric in light and view, to rounding (Helmholtz)."""
    reference = Reference(rough(64, 64, (0.1, 0.1), 0.15), 2.0, 380.0)
    wi, wr = pairs(200)
    for material in (
        Material(),
        Material(fresnel="conductor"),
        Material(fresnel="dielectric", normalisation="absolute"),
    ):
        there = reference.xyz(Light(), material, wi, wr, step_nm=20.0) / wi[:, 2:]
        back = reference.xyz(Light(), material, wr, wi, step_nm=20.0) / wr[:, 2:]
        np.testing.assert_allclose(there, back, rtol=1e-11)


def test_spectral_integrals_of_the_two_algorithms_agree() -> None:
    """XYZ of gold in steps of 1 nm."""
    field, material = rough(24, 24, (0.1, 0.1), 0.1), Material(fresnel="conductor")
    spectrum = Light(range_nm=(500.0, 560.0))
    wi, wr = pairs(3)
    fast = Reference(field, 0.8, 500.0).xyz(spectrum, material, wi, wr)
    np.testing.assert_allclose(fast, xyz_direct(field, 0.8, spectrum, material, wi, wr), rtol=1e-8)


def test_a_mirror_at_normal_incidence_has_one_ru() -> None:
    """Y = 1 for every material in the relative normalisation."""
    reference = Reference(HeightField(np.zeros((64, 64)), (0.1, 0.1)), 1.0, 380.0)
    straight = np.array([[0.0, 0.0, 1.0]])
    for fresnel in ("none", "schlick", "dielectric", "conductor"):
        material = Material(fresnel=fresnel, normalisation="relative")
        xyz = reference.xyz(Light(), material, straight, straight)
        assert xyz[0, 1] == pytest.approx(1.0, abs=1e-12)


def test_one_ru_is_a_mirror_in_both_normalisations() -> None:
    """In RU, absolute and relative values of a perfect mirror are equal for a laser line."""
    spectrum, straight = Light(illuminant=LaserLine(lambda_nm=532.0)), np.array([[0.0, 0.0, 1.0]])
    reference = Reference(HeightField(np.zeros((64, 64)), (0.1, 0.1)), 1.0, 532.0)
    wi, wr = pairs(20)
    found = []
    for normalisation in ("relative", "absolute"):
        material = Material(fresnel="none", normalisation=normalisation)
        unit = Radiometry(spectrum, material, 1.0, 1.0).unit
        assert reference.xyz(spectrum, material, straight, straight)[0, 1] / unit == pytest.approx(1.0, rel=1e-12)
        found.append(reference.xyz(spectrum, material, wi, wr) / unit)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)


@pytest.mark.parametrize("fresnel", ["none", "schlick", "dielectric", "conductor"])
@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_one_ru_is_a_flat_sample_that_mirrors_along_its_normal(fresnel: str, normalisation: str) -> None:
    """Exposures and error budgets in RU mean the same in both normalisations, for every material."""
    reference = Reference(HeightField(np.zeros((64, 64)), (0.1, 0.1)), 1.0, 380.0)
    material, straight = Material(fresnel=fresnel, normalisation=normalisation), np.array([[0.0, 0.0, 1.0]])
    unit = Radiometry(Light(), material, 1.0).unit
    assert reference.xyz(Light(), material, straight, straight)[0, 1] / unit == pytest.approx(1.0, rel=1e-9)
    assert normalisation == "absolute" or unit == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("theta_deg", [0.0, 40.0])
def test_absolute_normalisation_gives_a_perfect_mirror_an_albedo_of_one(theta_deg: float) -> None:
    """The integral of f cos(tr) over the lobe is 1 +- 1e-3 for a window of 16 um."""
    sigma = 16.25
    reference = Reference(HeightField(np.zeros((700, 700)), (0.1, 0.1)), sigma, 500.0)
    wi = geometry.direction(np.radians(theta_deg), 0.3)
    # the width of the lobe in (u, v) is a few sigma_f lambda
    axis = np.linspace(-6, 6, 81) * sigma_f(sigma) * 0.5
    du = axis[1] - axis[0]
    x, y = np.meshgrid(axis - wi[0], axis - wi[1])
    wr = np.stack([x.ravel(), y.ravel(), np.sqrt(1 - x.ravel() ** 2 - y.ravel() ** 2)], axis=-1)
    lit = np.broadcast_to(wi, wr.shape)
    material = Material(fresnel="none", shadowing=False, normalisation="absolute")
    spectrum = Light(illuminant="E", range_nm=(499.0, 501.0))
    brdf = reference.xyz(spectrum, material, lit, wr)[:, 1] / wi[2]
    # d omega cos(tr) = du dv
    assert np.sum(brdf) * du * du == pytest.approx(1.0, abs=1e-3)
