"""The coupled-wave solver against published and analytic cases, the page and the domain it holds."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.accuracy import scalar_domain as domain
from pipeline.config.models import Config
from pipeline.evaluation.figures import coupled_wave, scalar_errors, validity
from pipeline.evaluation.figures.coupled_wave import Resolution, RigorousGrating
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.figures.scalar_errors import GratingCase
from pipeline.optics import fresnel
from pipeline.progress import silent
from pipeline.surface import recipes
from pipeline.surface.periods import Period

pytestmark = pytest.mark.physics

needs_solver = pytest.mark.skipif(not coupled_wave.available(), reason="meent, of the extra bench, is not installed")

DEPTHS = (0.1, 0.3, 0.5)
KNOWN = {key: value for key, value in validity.INTEGRAL.items() if key[3] < 4.0 and key != validity.RESONANCE}
LONG = [GratingCase(shape, scalar_errors.DIELECTRIC, 30.0, 7.4) for shape in scalar_errors.SHAPES]


def small_bench() -> Bench:
    """A blaze in the place of every surface."""
    recipe = {"kind": "blazed", "size_um": 20.0, "pitch_um": 0.125}
    config = Config.model_validate({"name": "blazed", "surface": {"recipe": recipe}, "coherence": {"sigma_um": 5.0}})
    surface = BenchSurface(config, recipes.make(config.surface.recipe), scan=False)
    return Bench(surface, surface, surface, quick=True)


def test_a_staircase_is_solid_under_its_columns() -> None:
    """Three heights of a blaze: two layers, the upper one under one column."""
    stairs = coupled_wave.staircase(scalar_errors.sawtooth, 3)
    np.testing.assert_array_equal(stairs.solid, [[False, False, True], [False, True, True]])
    np.testing.assert_allclose(stairs.thickness, 1.0 / 3.0)
    # both flanks of a sinusoid are in one layer
    assert len(coupled_wave.staircase(scalar_errors.cosine, 24).thickness) == 11


@needs_solver
@pytest.mark.parametrize("polarisation", coupled_wave.POLARISATIONS)
@pytest.mark.parametrize("index", [1.37 + 7.62j, 1.5 + 1e-6j])
def test_a_flat_surface_reflects_as_fresnel_says(polarisation: coupled_wave.Polarisation, index: complex) -> None:
    theta = 0.6
    flat = RigorousGrating(lambda x: np.zeros_like(x), 2.3, theta, index)
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
        found = coupled_wave.solve(validity.LAMELLAR, np.ones(1), polarisation, Resolution(orders, 2))
        assert found[0, orders + order] == pytest.approx(value, abs=1e-5)


@needs_solver
@pytest.mark.parametrize("polarisation", coupled_wave.POLARISATIONS)
def test_a_metal_without_losses_keeps_all_light(polarisation: coupled_wave.Polarisation) -> None:
    """eps = -100: orders share exactly what comes in, at any resolution."""
    grating = RigorousGrating(scalar_errors.sawtooth, 3.3, 0.3, 1e-7 + 10.0j)
    found = coupled_wave.solve(grating, np.array([0.1, 0.4]), polarisation, Resolution(8, 8))
    np.testing.assert_allclose(np.sum(found, axis=1), 1.0, atol=1e-5)


@needs_solver
def test_light_and_view_may_be_exchanged() -> None:
    """Reciprocity of an order's efficiency: from theta to its direction, and back."""
    period, theta, index = 2.3, 0.25, scalar_errors.INDICES[scalar_errors.DIELECTRIC]
    there = RigorousGrating(scalar_errors.sawtooth, period, theta, index)
    # travels towards +x at sin t, leaves towards sin t - 1 / period; back it travels towards 1 / period - sin t
    back = replace(there, theta=float(np.arcsin(1.0 / period - np.sin(theta))))
    for polarisation in coupled_wave.POLARISATIONS:
        one, other = (
            coupled_wave.solve(each, np.array([0.3]), polarisation, Resolution(10, 8))[0, 11]
            for each in (there, back)
        )
        assert one == pytest.approx(other, rel=1e-3)


@pytest.fixture(scope="module")
def solved() -> dict[GratingCase, scalar_errors.Efficiencies]:
    """Some cases side by side, as the page solves them."""
    return scalar_errors.sweep([*(GratingCase(*key[:4]) for key in KNOWN), *LONG], np.array(DEPTHS), silent)


@pytest.mark.slow
@needs_solver
@pytest.mark.parametrize("key", KNOWN, ids=str)
def test_extrapolated_waves_meet_a_boundary_integral(
    solved: dict[GratingCase, scalar_errors.Efficiencies], key: tuple[str, str, float, float, float]
) -> None:
    """Two rigorous methods, one number, in unpolarised light."""
    found = solved[GratingCase(*key[:4])].rigorous[DEPTHS.index(key[4])]
    assert found == pytest.approx(KNOWN[key], abs=validity.RELIABLE[key[1]])


@pytest.mark.slow
@needs_solver
@pytest.mark.parametrize("case", LONG, ids=str)
def test_long_shallow_gratings_are_scalar(
    solved: dict[GratingCase, scalar_errors.Efficiencies], case: GratingCase
) -> None:
    """Signs and factors of both sides: they differ by little of the order itself."""
    found, shallow = solved[case], DEPTHS.index(0.1)
    assert abs(found.error[shallow]) < 0.02 * found.rigorous[shallow]


@needs_solver
def test_a_blaze_sends_light_to_its_side() -> None:
    grating = RigorousGrating(scalar_errors.sawtooth, 7.4, 0.0, scalar_errors.INDICES[scalar_errors.DIELECTRIC])
    orders = coupled_wave.solve(grating, np.array([0.3]), "TE", Resolution(12, 12))[0]
    assert orders[13] > 3.0 * orders[11]


def test_the_scalar_side_is_the_reflectance_of_a_mirror_where_all_light_goes_one_way() -> None:
    """A blaze of half a wavelength in a period without end: R |c_1|^2 G / w^2 = R(ti)."""
    case = GratingCase("blaze", scalar_errors.METAL, 0.0, 1e4)
    ours, bare = scalar_errors.scalar(case, np.array([0.5]))
    assert ours[0] == pytest.approx(1.0, abs=1e-6)
    assert bare[0] == pytest.approx(1.0, abs=1e-6)
    assert fresnel.reflectance(1.0, scalar_errors.INDICES[scalar_errors.METAL]) == pytest.approx(0.914, abs=1e-3)


def test_the_quoted_table_falls_with_period_and_rises_with_depth() -> None:
    for errors in (domain.SMOOTH, domain.EDGED):
        table = np.array(errors)
        assert table.shape == (len(domain.PERIODS), len(domain.DEPTHS))
        assert np.all(np.diff(table, axis=0) <= 0.0)
        assert np.all(np.diff(table, axis=1) >= 0.0)
    assert np.all(np.array(domain.SMOOTH) <= np.array(domain.EDGED))


def test_a_surface_in_the_domain() -> None:
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


def test_without_the_solver_the_page_quotes_its_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coupled_wave, "available", lambda: False)
    page = validity.make(small_bench(), silent)
    assert {check.id: check.verdict for check in page.checks} == {"solver": "not measured"}
    assert "bench" in page.checks[0].remark
    assert page.tables[0].rows[0][-1] == domain.SMOOTH[0][-1]
    assert page.pictures == []


@pytest.mark.slow
@needs_solver
def test_the_checks_find_a_table_that_does_not_hold(
    monkeypatch: pytest.MonkeyPatch, solved: dict[GratingCase, scalar_errors.Efficiencies]
) -> None:
    """The checks themselves, over a few cases: a table too low fails, and one far too high where all was measured."""
    case = GratingCase("sinusoid", scalar_errors.METAL, 0.0, 3.05)
    found = scalar_errors.Sweep((3.05,), DEPTHS, (0.0,), {case: solved[case]})
    monkeypatch.delitem(scalar_errors.INDICES, scalar_errors.DIELECTRIC)
    monkeypatch.delitem(scalar_errors.SHAPES, "blaze")
    shape = scalar_errors.SHAPES["sinusoid"]

    def held(quoted: float, whole: bool) -> bool:
        table = tuple((quoted,) * len(domain.DEPTHS) for _ in domain.PERIODS)
        monkeypatch.setitem(scalar_errors.SHAPES, "sinusoid", replace(shape, quoted=table))
        first = [check for check in validity.domain_checks(found, whole) if check.id.startswith("sinusoid.1.5")]
        return all(check.verdict == "holds" for check in first)

    assert held(0.01, False)
    assert held(0.015, True)
    assert not held(1e-4, False)
    assert not held(0.3, True)
