"""Peaks of the first order, the lines behind them, and the periods of table 1."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference, power_direct
from pipeline.errors import AccuracyError
from pipeline.evaluation.figures import peaks, viewing_angles
from pipeline.evaluation.figures.first_order import ROWS, THETA_I, ByPosition, Cut, FirstOrder, Periods, Row, cut_of
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.figures.peaks import Plane, band_of, phase_rate
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import sigma_f
from pipeline.progress import silent
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Sinusoid
from pipeline.surface.source import SurfaceSource

pytestmark = pytest.mark.physics

SIGMA_UM = 16.25
LAMBDA_NM = np.array([400.0, 550.0, 700.0])
FROM_MINUS_X = Plane(THETA_I, np.pi)


@pytest.fixture(scope="module")
def blazed() -> HeightField:
    """25 samples a period: nothing folds back next to the first order."""
    return recipes.make(Blazed(kind="blazed", size_um=(65.0, 65.0), pitch_um=(0.1, 1.0)))


def test_a_line_is_the_gratings_own_whatever_the_window(blazed: HeightField) -> None:
    for sigma in (6.0, SIGMA_UM):
        power = Reference(blazed, sigma, 380.0).power
        width = sigma_f(sigma)
        found = peaks.lines(power, FROM_MINUS_X, np.full(3, 0.4) + 0.3 * width, LAMBDA_NM, width)
        np.testing.assert_allclose(1e3 / found, 2500.0, atol=1e-4)


def test_a_reflectances_peak_is_off_by_half_sigma_f_squared_times_the_logarithmic_slope(blazed: HeightField) -> None:
    """The slope is that of C(f) times the order's efficiency |c_1(s)|^2, which the sum over one period gives."""
    power = Reference(blazed, SIGMA_UM, 380.0).power
    width = sigma_f(SIGMA_UM)
    found = peaks.peaks(power, FROM_MINUS_X, np.full(3, 0.4), LAMBDA_NM, width)
    heights = blazed.heights_um[0, :25]
    at = np.arange(25) / 25

    def log_factor(f: float, nm: float) -> float:
        s = phase_rate(FROM_MINUS_X, f, nm)
        order = np.mean(np.exp(1j * s * heights + 2j * np.pi * at))
        wi, wr = FROM_MINUS_X.directions(np.array(f), np.array(1e-3 * nm))
        w = wi[2] + wr[2]
        factor = brdf.direction_factor(peaks.BRDF, None, wi, wr)  # type: ignore[arg-type]
        assert w > 0
        return float(np.log(factor * np.abs(order) ** 2))

    for f, nm in zip(found, LAMBDA_NM, strict=True):
        slope = (log_factor(0.401, nm) - log_factor(0.399, nm)) / 0.002
        assert f - 0.4 == pytest.approx(0.5 * width**2 * slope, rel=2e-3)
        assert abs(1e3 / f - 2500.0) > 0.1


def test_peaks_under_twice_the_window_move_a_quarter_as_far(blazed: HeightField) -> None:
    moved = []
    for factor in (1.0, 2.0):
        power = Reference(blazed, factor * SIGMA_UM, 380.0).power
        moved.append(peaks.peaks(power, FROM_MINUS_X, np.full(3, 0.4), LAMBDA_NM, sigma_f(factor * SIGMA_UM)) - 0.4)
    np.testing.assert_allclose(moved[1], 0.25 * moved[0], rtol=2e-3)


def test_a_parabola_finds_a_gaussians_top_between_samples() -> None:
    f = np.linspace(0.3, 0.5, 81)
    tops = np.array([0.3871, 0.41234])
    values = np.exp(-(((f - tops[:, None]) / 0.01) ** 2))
    np.testing.assert_allclose(peaks.brightest(values, f), tops, atol=1e-12)


def test_persistent_lines_are_found_by_brightness_and_apart() -> None:
    f = np.linspace(1.0, 2.0, 401)
    lobes = [(1.3, 1.0), (1.32, 0.8), (1.7, 0.6), (1.9, 0.3)]
    values = sum(height * np.exp(-(((f - top) / 0.006) ** 2)) for top, height in lobes)
    found = peaks.persistent(np.stack([values, 7.0 * values]), f, 2, apart=0.05)
    np.testing.assert_allclose(found, [1.3, 1.7], atol=0.0026)
    with pytest.raises(AccuracyError, match="expected 9 peaks"):
        peaks.persistent(values[None], f, 9, apart=0.05)


def test_two_periods_across_each_other_are_two_lines() -> None:
    """Two sinusoids in one plane of incidence: table 1's toggling peak, with both periods known."""
    size, periods = 60.0, (0.6, 60.0 / 112.0)
    x = np.arange(600) * 0.1
    heights = sum(0.02 * np.cos(2 * np.pi * x / period) for period in periods)
    field = HeightField(np.broadcast_to(heights, (60, 600)).copy(), (size / 600, 1.0))
    row = Row("two", "two", "xenopeltis", "x", (0.42, 0.75), ((600.0, 0.0), (535.7, 0.0)))
    power = Reference(field, SIGMA_UM, 380.0).power
    cut = cut_of(power, Plane(THETA_I, 0.0), row, band_of(row.search_um, SIGMA_UM), LAMBDA_NM)
    means = [line.mean for _, line in cut.lines]
    np.testing.assert_allclose(means, [1e3 * period for period in periods], atol=0.01)
    # both are nearly equally bright, and each wavelength's peak is one of them
    assert all(min(abs(nm - 600.0), abs(nm - 535.71)) < 1.0 for nm in cut.brightest.nm)


def test_moving_the_window_is_the_sum_over_samples_with_the_window_elsewhere() -> None:
    field = HeightField(np.random.default_rng(2).uniform(-0.1, 0.1, (40, 48)), (0.1, 0.12))
    sigma, nm, f = 0.8, 550.0, np.array([0.5, 0.9, 1.4])
    plane = Plane(THETA_I, 0.0)
    s = phase_rate(plane, 0.9, nm)
    moved = peaks.by_position(field, sigma, s, f, 4)
    w = s * 1e-3 * nm / (2.0 * np.pi)
    for row, column in ((2, 2), (0, 0), (3, 1)):
        rolled = np.roll(field.heights_um, (20 - 10 * row, 24 - 12 * column), axis=(0, 1))
        for side, sign in enumerate((-1.0, 1.0)):
            uvw = np.stack([sign * f * 1e-3 * nm, np.zeros(3), np.full(3, w)], axis=-1)
            direct = power_direct(HeightField(rolled, field.pitch_um), sigma, uvw, nm)
            np.testing.assert_allclose(moved[row, column, side], direct, rtol=1e-9)


def test_frequencies_of_a_plane_are_those_of_its_directions() -> None:
    """f along the plane is (sin theta_i - sin phi) / lambda, met at -f along the light."""
    plane = Plane(np.radians(40.0), np.radians(25.0))
    f = np.array([-0.3, 0.0, 0.8])
    wi, wr = plane.directions(f, np.array(0.6))
    along = geometry.uvw(wi, wr)[:, :2] @ [np.cos(plane.azimuth), np.sin(plane.azimuth)]
    np.testing.assert_allclose(along, -f * 0.6, atol=1e-14)
    assert np.isnan(plane.phi(np.array(3.0), np.array(0.6)))


def test_the_published_bias_of_the_blazed_grating_is_the_reflectances_slope() -> None:
    """2500.34 nm in [D14]: its brightest angle under eq. 4, and not the grating's period."""
    config = _config("blazed", {"kind": "blazed"})
    assert config.surface.recipe is not None
    field = recipes.make(config.surface.recipe)
    power = Reference(field, SIGMA_UM, 380.0).power
    lambda_nm = np.arange(380.0, 781.0, 20.0)
    cut = cut_of(power, FROM_MINUS_X, ROWS[0], band_of(ROWS[0].search_um, SIGMA_UM), lambda_nm)
    assert cut.brightest.mean == pytest.approx(2500.34, abs=0.01)
    assert cut.lines[0][1].mean == pytest.approx(2500.0, abs=0.02)


@pytest.mark.slow
def test_the_page_is_whole() -> None:
    small = {"size_um": 25.0, "pitch_um": 0.1}
    bench = Bench(
        blazed=_surface("blazed", {"kind": "blazed", **small}),
        elaphe=_surface("skin", {"kind": "elaphe", **small}),
        xenopeltis=_surface("rows", {"kind": "xenopeltis", **small}),
        quick=True,
    )
    page = viewing_angles.make(bench, silent)
    assert {check.id: check.verdict for check in page.checks} == {
        **dict.fromkeys(("blazed.line", "blazed.extrapolated", "blazed.peak"), "holds"),
        **dict.fromkeys(("elaphe.line1", "along.line1", "across.line1", "across.line2"), "reported"),
    }
    assert len(page.pictures) == 5
    assert all(picture.png.startswith(b"\x89PNG") for picture in page.pictures)
    assert all(len(row) == len(table.columns) for table in page.tables for row in table.rows)
    elaphe = next(row for row in page.document()["tables"]["methods"] if row.pop("surface") == "Elaphe")
    assert set(elaphe) == {"exact", "FLSS", "NMM", "PQ"}
    # the recipe's firm period, by every method
    for name, (mean, _variance) in elaphe.items():
        assert mean == pytest.approx(1144.0, abs=12.0), name


def test_of_a_scan_the_page_reports_which_windows_show_the_published_period() -> None:
    """The share of windows with a shorter period; of a recipe there is no such statement."""
    row = ROWS[1]
    periods = np.full((4, 4, 2), 1100.0)
    periods[0] = 1200.0
    lines = ((Periods(np.array([1144.0])), Periods(np.array([1144.1]))),)
    cut = Cut(Plane(THETA_I, 0.0), np.ones((1, 3)), lines[0][0], lines)
    for scan, ids in ((True, ["elaphe.line1", "elaphe.windows1"]), (False, ["elaphe.line1"])):
        surface = replace(_surface("skin", {"kind": "elaphe", "size_um": 10.0, "pitch_um": 0.1}), scan=scan)
        found = FirstOrder(row, surface, cut, cut)
        checks = list(viewing_angles.snake_checks([found], [ByPosition(row, periods, np.array([1100.0, 1200.0]))]))
        assert [check.id for check in checks] == ids
        assert checks[-1].value == pytest.approx(75.0 if scan else 1144.1)


def _config(name: str, recipe: dict[str, object]) -> Config:
    return Config(name=name, surface=SurfaceSource.model_validate({"recipe": recipe}))


def _surface(name: str, recipe: dict[str, object]) -> BenchSurface:
    config = _config(name, recipe)
    assert config.surface.recipe is not None
    return BenchSurface(config, recipes.make(config.surface.recipe), scan=False)


def test_a_sinusoid_seen_from_either_side_has_one_period() -> None:
    """A mirror-symmetric profile: both sides find the same line."""
    field = recipes.make(Sinusoid(kind="sinusoid", period_um=1.0, size_um=(50.0, 20.0), pitch_um=(0.1, 0.5)))
    power = Reference(field, SIGMA_UM, 380.0).power
    width = sigma_f(SIGMA_UM)
    for azimuth in (0.0, np.pi):
        found = peaks.lines(power, Plane(THETA_I, azimuth), np.full(3, 1.002), LAMBDA_NM, width)
        np.testing.assert_allclose(1e3 / found, 1000.0, atol=1e-4)
