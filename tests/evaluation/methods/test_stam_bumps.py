"""Stam's periodic bumps: closed forms of their orders, and the exact reference on the surface they assume."""

import numpy as np
import pytest

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.errors import ConfigError
from pipeline.evaluation.methods.method import Monochromatic, integrated
from pipeline.evaluation.methods.stam_bumps import (
    Bump,
    RectangularBump,
    StamBumps,
    TriangularBump,
    estimated_periods,
    matched_epsilon,
)
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import make
from pipeline.surface.recipes.parameters import Blazed, Elaphe, Mirror
from pipeline.surface.source import SurfaceSource

PERIOD_X, PERIOD_Y = 2.0, 1.6
BUMPS = [RectangularBump(0.13, 0.5, 0.25), TriangularBump(0.31, 0.5, 0.25)]


def config_of(sigma_um: float, **sections: object) -> Config:
    surface = SurfaceSource(recipe=Mirror(kind="mirror"))
    sections = {"material": Material(normalisation="relative"), **sections}
    coherence = Coherence(sigma_um=sigma_um)
    return Config(name="test", surface=surface, coherence=coherence, **sections)


def cell(bump: Bump, columns: int, rows: int) -> Array:
    """Heights of one cell at the middles of its samples, the bump in the middle, um."""
    q_x = 2.0 * np.abs((np.arange(columns) + 0.5) / columns - 0.5) / bump.share_x
    q_y = 2.0 * np.abs((np.arange(rows) + 0.5) / rows - 0.5) / bump.share_y
    profile = np.ones(columns) if isinstance(bump, RectangularBump) else 1.0 - q_x
    return bump.height_um * np.where(q_y < 1.0, 1.0, 0.0)[:, None] * np.where(q_x < 1.0, profile, 0.0)


@pytest.mark.parametrize("bump", BUMPS, ids=["rectangular", "triangular"])
@pytest.mark.parametrize("s_per_um", [-31.0, -12.7])
def test_coefficients_are_the_integral_over_a_cell(bump: Bump, s_per_um: float) -> None:
    """c_nm by the midpoint rule on 1024 x 512 samples of exp(i s b)."""
    heights = cell(bump, 1024, 512)
    x, y = (np.arange(1024) + 0.5) / 1024 - 0.5, (np.arange(512) + 0.5) / 512 - 0.5
    p = np.exp(1j * s_per_um * heights)
    for n, m in ((0, 0), (1, 0), (0, 1), (2, -3), (-5, 1), (0, 4)):
        direct = np.exp(2j * np.pi * m * y) @ p @ np.exp(2j * np.pi * n * x) / p.size
        found = bump.coefficients(np.array(n), np.array(m), np.array(s_per_um))
        assert abs(found - direct) < 2e-5


@pytest.mark.parametrize("bump", BUMPS, ids=["rectangular", "triangular"])
def test_orders_share_all_light(bump: Bump) -> None:
    """Parseval: sum |c_nm|^2 = 1, the far orders' tails aside."""
    n, m = np.meshgrid(np.arange(-300, 301), np.arange(-300, 301))
    assert np.sum(np.abs(bump.coefficients(n, m, np.array(-21.0))) ** 2) == pytest.approx(1.0, abs=4e-3)


def test_a_bump_without_height_is_a_mirror() -> None:
    """All light in the specular order, 1 within epsilon of it."""
    flat = HeightField(np.zeros((16, 16)), (0.1, 0.1))
    for bump in (RectangularBump(0.0), TriangularBump(0.0)):
        method = StamBumps(flat, config_of(2.0), (PERIOD_X, PERIOD_Y), bump)
        uvw = np.array([[0.0, 0.0, -1.9], [0.003, 0.0, -1.9], [0.25, 0.0, -1.9]])
        np.testing.assert_allclose(method.power(uvw, np.array([500.0]))[:, 0], [1.0, 0.0, 0.0], atol=1e-12)
        straight = np.array([[0.0, 0.0, 1.0]])
        assert method.xyz(straight, straight)[0, 1] == pytest.approx(1.0)


def tiled(bump: Bump, repeats: int) -> HeightField:
    """A surface of nothing but such bumps, 80 x 64 samples each."""
    return HeightField(np.tile(cell(bump, 80, 64), (repeats, repeats)), (PERIOD_X / 80, PERIOD_Y / 64))


@pytest.mark.parametrize("bump", BUMPS, ids=["rectangular", "triangular"])
def test_the_exact_sum_has_these_orders(bump: Bump) -> None:
    """On a surface of such bumps |P|^2 at (n / dx, m / dy) is |c_nm|^2: the window's peak is 1. Samples cost 1 %."""
    method = StamBumps(tiled(bump, 4), config_of(1.6), (PERIOD_X, PERIOD_Y), bump)
    nm = 520.0
    orders = [(0, 0), (1, 0), (-1, 0), (0, 1), (1, -1), (3, 0), (-2, 2)]
    uvw = np.array([[n * 0.52 / PERIOD_X, m * 0.52 / PERIOD_Y, -1.6] for n, m in orders])
    exact = Reference(tiled(bump, 4), 1.6, 380.0).power(uvw, np.array([nm]))
    found = method.power(uvw, np.array([nm]))
    np.testing.assert_allclose(found, exact, rtol=0.015, atol=3e-5)


def neighbourhood(u: tuple[float, float], v: tuple[float, float]) -> tuple[Array, Array]:
    """Light from the normal, views over a rectangle of (u, v)."""
    x, y = np.meshgrid(np.linspace(*u, 81), np.linspace(*v, 81))
    wr = np.stack([-x.ravel(), -y.ravel(), np.sqrt(1.0 - x.ravel() ** 2 - y.ravel() ** 2)], axis=-1)
    return np.broadcast_to([0.0, 0.0, 1.0], wr.shape), wr


@pytest.mark.parametrize(
    ("u", "v"),
    [((0.12, 0.45), (-0.1, 0.1)), ((-0.1, 0.1), (0.12, 0.55)), ((0.12, 0.45), (0.15, 0.55)), ((-0.07, 0.07),) * 2],
    ids=["order (1, 0)", "order (0, 1)", "order (1, 1)", "specular"],
)
def test_colours_of_an_order_are_the_exact_ones(u: tuple[float, float], v: tuple[float, float]) -> None:
    """Summed over the views that an order's visible light reaches, epsilon matched to the window: within 3 %."""
    bump, repeats, sigma = BUMPS[0], 8, 3.2
    settings = config_of(sigma)
    epsilon = matched_epsilon(sigma, (PERIOD_X, PERIOD_Y))
    wi, wr = neighbourhood(u, v)
    found = StamBumps(tiled(bump, repeats), settings, (PERIOD_X, PERIOD_Y), bump, epsilon).xyz(wi, wr)
    reference = Reference(tiled(bump, repeats), sigma, 380.0)
    exact = reference.xyz(settings.light, settings.material, wi, wr, step_nm=4.0)
    np.testing.assert_allclose(found.mean(axis=0), exact.mean(axis=0), rtol=0.03)


def test_picked_wavelengths_are_the_bound_integrated() -> None:
    """The delta's colour is that of the bound on both axes, integrated at 1 nm, over a neighbourhood."""
    bump, settings = BUMPS[1], config_of(2.0, spectrum=Light(range_nm=(450.0, 650.0)))
    method = StamBumps(tiled(bump, 1), settings, (PERIOD_X, PERIOD_Y), bump, 0.03)
    wi, wr = neighbourhood((0.15, 0.7), (0.2, 0.65))
    bounded = integrated(method.power, settings, wi, wr, step_nm=1.0)
    np.testing.assert_allclose(method.xyz(wi, wr).mean(axis=0), bounded.mean(axis=0), rtol=0.02)


def test_a_wider_bound_fills_the_bands_along_both_axes() -> None:
    """[D14] fig. 11(a) and (b): colour off the axes' exact lines comes with epsilon, across and along."""
    bump = RectangularBump(0.2)
    wi, wr = neighbourhood((-0.6, 0.6), (-0.6, 0.6))
    u, v = np.abs(wr[:, 0]), np.abs(wr[:, 1])
    lit = {}
    for epsilon in (0.01, 0.1):
        y = StamBumps(tiled(bump, 1), config_of(2.0), (PERIOD_X, PERIOD_Y), bump, epsilon).xyz(wi, wr)[:, 1]
        horizontal, vertical = (v > 0.005) & (v < 0.02) & (u > 0.2), (u > 0.005) & (u < 0.02) & (v > 0.25)
        lit[epsilon] = np.mean(y[horizontal] > 0.0), np.mean(y[vertical] > 0.0)
    assert max(lit[0.01]) < 0.1
    assert min(lit[0.1]) > 0.8


def test_a_laser_is_seen_where_both_orders_are_near() -> None:
    """One wavelength: nothing to pick, so the bound alone."""
    settings = config_of(2.0, spectrum=Light(illuminant=LaserLine(lambda_nm=532.0)))
    method = StamBumps(tiled(BUMPS[0], 1), settings, (PERIOD_X, PERIOD_Y), BUMPS[0])
    on, off = 0.532 / PERIOD_X, 0.532 / PERIOD_X * 1.02
    wr = np.array([[-u, 0.0, np.sqrt(1.0 - u**2)] for u in (on, off)])
    y = method.xyz(np.broadcast_to([0.0, 0.0, 1.0], wr.shape), wr)[:, 1]
    assert y[0] > 0.0
    assert y[1] == 0.0


def test_exchanging_light_and_view_changes_nothing_but_the_cosine() -> None:
    method = StamBumps(tiled(BUMPS[1], 1), config_of(2.0), (PERIOD_X, PERIOD_Y), BUMPS[1], 0.2)
    rng = np.random.default_rng(2)
    theta, phi = np.arccos(rng.uniform(0.2, 1.0, (2, 200))), rng.uniform(0, 2 * np.pi, (2, 200))
    wi, wr = geometry.direction(theta[0], phi[0]), geometry.direction(theta[1], phi[1])
    there = method.xyz(wi, wr) / wi[:, 2:]
    np.testing.assert_allclose(there, method.xyz(wr, wi) / wr[:, 2:], rtol=1e-10, atol=1e-15)
    assert np.count_nonzero(there) > 100


def test_periods_are_the_surfaces_own() -> None:
    """A lattice gives both; fingers without a firm period give their mean length; a grating's lines never end."""
    dx, dy = estimated_periods(tiled(RectangularBump(0.1), 8), 5.0)
    assert dx == pytest.approx(PERIOD_X, rel=1e-3)
    assert dy == pytest.approx(PERIOD_Y, rel=1e-3)
    elaphe = make(Elaphe(kind="elaphe", size_um=30.0))
    dx, dy = estimated_periods(elaphe, 5.0)
    assert dx == pytest.approx(1.144, rel=0.03)
    assert 1.5 < dy < 6.0
    grating = make(Blazed(kind="blazed", size_um=40.0))
    assert estimated_periods(grating, 5.0) == pytest.approx((2.5, grating.size_um[1]), rel=2e-3)


def test_defaults_are_those_of_figure_11() -> None:
    """Half the period wide and high, epsilon 0.01, rectangular."""
    method = StamBumps(tiled(RectangularBump(0.1), 8), config_of(2.0))
    assert isinstance(method, Monochromatic)
    assert method.epsilon == 0.01
    assert method.bump == RectangularBump(pytest.approx(0.5 * PERIOD_X, rel=1e-3), 0.5, 0.5)
    assert method.stored_bytes < 100


def test_what_cannot_be_is_refused() -> None:
    flat = HeightField(np.zeros((16, 16)), (0.1, 0.1))
    with pytest.raises(ConfigError, match="periods_um: a flat surface has no period"):
        StamBumps(flat, config_of(2.0))
    with pytest.raises(ConfigError, match=r"epsilon: expected 0 < epsilon <= 0\.5, got 0\.6"):
        StamBumps(flat, config_of(2.0), (1.0, 1.0), epsilon=0.6)
