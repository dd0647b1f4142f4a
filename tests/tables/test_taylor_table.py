"""The paper's tables against the reference and plain numpy; their symmetries and errors."""

import numpy as np
import pytest

from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.reference import Reference
from pipeline.errors import AccuracyError
from pipeline.evaluation.plain_numpy import paper_nodes
from pipeline.optics.light import Light, Quadrature, trapezoid
from pipeline.scene.lights import Parallel
from pipeline.scene.model import Scene, Views
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Sinusoid
from pipeline.tables.taylor import grid
from pipeline.tables.taylor import table as taylor
from tests.support import snake

TOLERANCE = 1e-4


def taylor_stack(
    field: HeightField, sigma: float, tolerance: float = TOLERANCE
) -> tuple[dft_stack.Stack, Quadrature]:
    """The stack of a field for a tolerance, and the quadrature of the tables."""
    quadrature = trapezoid(Light(), 5.0)
    order = expansion.plan_taylor(field, quadrature, tolerance).order
    reachable = expansion.W_MAX / 0.38
    built = dft_stack.build(field, "taylor", order + 1, sigma, reachable, dft_stack.window_tolerance(tolerance))
    return built, quadrature


def small() -> HeightField:
    rng = np.random.default_rng(11)
    return HeightField(rng.uniform(-0.08, 0.08, (60, 80)), (0.1, 0.12))


FIELDS = {
    "elaphe": lambda: snake("elaphe"),
    "blazed": lambda: recipes.make(Blazed(kind="blazed", height_um=0.25)),
    "sinusoid": lambda: recipes.make(Sinusoid(kind="sinusoid", amplitude_um=0.1)),
}


@pytest.mark.parametrize("name", FIELDS)
def test_nodes_agree_with_the_reference_on_the_same_wavelengths(name: str) -> None:
    """float32 tables, summed with w^p, are within 1e-4 of the local value or 1e-7 of the mirror at random nodes."""
    field = FIELDS[name]()
    built, quadrature = taylor_stack(field, 16.25)
    rng = np.random.default_rng(2)
    u = grid.nodes(501, 5.0)
    uv = np.stack([u[rng.integers(250, 501, 600)], u[rng.integers(0, 501, 600)]], axis=-1)
    # half of the nodes are on the line that holds the orders of a grating
    uv[::2, 1] = 0.0
    uv = uv[np.hypot(uv[:, 0], uv[:, 1]) < 1.99]
    longest = np.sqrt(4.0 - np.sum(uv**2, axis=1))
    w = -longest * np.where(rng.random(len(uv)) < 0.5, 1.0, rng.random(len(uv)))
    i_p = taylor.node_values(built, quadrature, uv).astype(np.float32)
    found = taylor.sum_powers(i_p, w)
    power = Reference(field, 16.25, 380.0).power(np.column_stack([uv, w]), quadrature.lambda_nm)
    truth = np.nan_to_num(power) @ quadrature.weights
    assert np.max(np.abs(found - truth) / np.maximum(TOLERANCE * np.abs(truth), 1e-7)) <= 1.0
    assert np.max(truth) > 0.1


def test_kernel_agrees_with_the_paper_transcribed_into_numpy() -> None:
    """Eq. 8, 11 and 12 in two languages and two orders of summation."""
    built, quadrature = taylor_stack(small(), 2.0)
    rng = np.random.default_rng(5)
    uv = rng.uniform(-1.3, 1.3, (6, 2))
    uv[:, 0] = np.abs(uv[:, 0])
    kernel, printed = taylor.node_values(built, quadrature, uv), paper_nodes(built, quadrature, uv)
    np.testing.assert_allclose(kernel, printed, rtol=1e-9, atol=1e-12 * np.max(np.abs(printed)))


def test_opposite_nodes_have_alternating_signs() -> None:
    """Heights are real, so I_p(-u, -v) = (-1)^p I_p(u, v)."""
    built, quadrature = taylor_stack(small(), 2.0)
    table = taylor.build(built, quadrature, 21, 3.0)
    sign = (-1.0) ** np.arange(table.values.shape[3])
    # at the origin odd powers are zero to rounding, with any sign
    np.testing.assert_allclose(table.values[::-1, ::-1], table.values * sign, rtol=0, atol=1e-15)


def test_whole_table_agrees_with_the_reference_in_all_four_quadrants() -> None:
    field = small()
    built, quadrature = taylor_stack(field, 2.0)
    table = taylor.build(built, quadrature, 15, 2.0)
    u = grid.nodes(15, 2.0)
    v_index, u_index = np.nonzero(table.computed & (np.hypot(u[:, None], u) < 1.95))
    uv = np.stack([u[u_index], u[v_index]], axis=-1)
    w = -0.9 * np.sqrt(4.0 - np.sum(uv**2, axis=1))
    truth = np.nan_to_num(Reference(field, 2.0, 380.0).power(np.column_stack([uv, w]), quadrature.lambda_nm))
    found = table.look_up(np.column_stack([uv, w]))
    np.testing.assert_allclose(found, truth @ quadrature.weights, rtol=1e-4, atol=1e-7)
    assert {(np.sign(a), np.sign(b)) for a, b in uv} >= {(1, 1), (1, -1), (-1, 1), (-1, -1)}


def test_look_up_between_nodes_is_bilinear_in_the_grid_coordinate() -> None:
    built, quadrature = taylor_stack(small(), 2.0)
    table = taylor.build(built, quadrature, 15, 2.0)
    t = np.array([0.31, -0.77]) / 7.0 + np.array([2.0, 4.0]) / 7.0
    a, b = (t + 1.0) * 7.0
    i, j = int(a), int(b)
    corners = table.values[j : j + 2, i : i + 2].astype(float)
    wa, wb = np.array([1 - (a - i), a - i]), np.array([1 - (b - j), b - j])
    w = np.array([-1.1])
    expected = taylor.sum_powers(np.einsum("j,i,jicp->cp", wb, wa, corners)[None], w)
    uvw = np.array([[*grid.node_position(t, 2.0), w[0]]])
    np.testing.assert_allclose(table.look_up(uvw), expected, rtol=1e-9)


def test_a_scene_omits_nodes_and_does_not_change_the_others() -> None:
    """A fixed light reaches the disc of radius sin(theta_max) about -wi; look-ups outside it are NaN."""
    built, quadrature = taylor_stack(small(), 2.0)
    light = Parallel(theta_deg=30.0, phi_deg=90.0)
    scene = Scene(lights=[light], views=Views(theta_max_deg=40.0))
    whole, part = taylor.build(built, quadrature, 41, 2.0), taylor.build(built, quadrature, 41, 2.0, scene)
    assert np.count_nonzero(part.computed) < 0.4 * np.count_nonzero(whole.computed)
    np.testing.assert_array_equal(part.values[part.computed], whole.values[part.computed])
    # wr = 39 degrees towards -x is inside the scene, 60 degrees is not
    wi = np.array([0.0, np.sin(np.radians(30.0)), np.cos(np.radians(30.0))])
    for theta, reached in ((39.0, True), (60.0, False)):
        wr = np.array([-np.sin(np.radians(theta)), 0.0, np.cos(np.radians(theta))])
        assert np.all(np.isfinite(part.look_up((-wi - wr)[None]))) == reached


def test_the_share_beyond_the_nyquist_limit_is_reported() -> None:
    """A pitch of 0.2 um limits u to lambda / 0.4 um: 0.95 for 380 nm and 1.95 for 780 nm."""
    field = HeightField(np.random.default_rng(0).uniform(-0.05, 0.05, (64, 64)), (0.2, 0.2))
    built, quadrature = taylor_stack(field, 2.0)
    table = taylor.build(built, quadrature, 201, 1.0)
    u = grid.nodes(201, 1.0)
    at_centre_row = table.unknown[100]
    assert np.all(at_centre_row[np.abs(u) <= 0.949] == 0.0)
    assert np.all(at_centre_row[(np.abs(u) > 0.951)] > 0.0)
    assert np.all(at_centre_row[np.abs(u) > 1.96] == pytest.approx(1.0))
    assert 0.3 < table.unknown_share < 0.7


@pytest.mark.parametrize("half_range", [0.1, 0.2, 0.3])
def test_predicted_rounding_agrees_with_the_error_of_float32(half_range: float) -> None:
    """It is an expected error: the largest error of 200 nodes is between 1e-3 and three times of it."""
    rng = np.random.default_rng(4)
    field = HeightField(rng.uniform(-half_range, half_range, (64, 64)), (0.1, 0.1))
    quadrature = trapezoid(Light(), 5.0)
    plan = expansion.plan_taylor(field, quadrature, 1e3)
    built = dft_stack.build(field, "taylor", plan.order + 20, 2.0, expansion.W_MAX / 0.38, 1e-9)
    uv = rng.uniform(0.0, 0.6, (200, 2))
    w = -np.sqrt(4.0 - np.sum(uv**2, axis=1))
    i_p = taylor.node_values(built, quadrature, uv)
    exact, rounded = (taylor.sum_powers(values, w) for values in (i_p, i_p.astype(np.float32)))
    error = np.abs(rounded - exact) / np.maximum(exact, expansion.MIRROR_SHARE * quadrature.weights.sum(axis=0))
    assert np.max(error) <= 3 * plan.rounding
    assert np.max(error) >= 1e-3 * plan.rounding


def test_tall_surfaces_are_refused_with_the_error_and_the_remedy() -> None:
    field = HeightField(np.random.default_rng(1).uniform(-0.5, 0.5, (64, 64)), (0.1, 0.1))
    with pytest.raises(AccuracyError, match=r"would err by .*tolerance asks for 1.0e-04.*clip_percentile"):
        expansion.plan_taylor(field, trapezoid(Light(), 5.0), 1e-4)


def test_too_few_terms_are_refused() -> None:
    with pytest.raises(AccuracyError, match=r'truncation .*table.terms = "auto"'):
        expansion.plan_taylor(small(), trapezoid(Light(), 5.0), 1e-4, 5)
