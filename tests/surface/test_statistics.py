"""Laws of the statistics: closed forms, periods known beforehand, and the periods of two real skins."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from pipeline.surface.conditioning import condition
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import make
from pipeline.surface.recipes.parameters import (
    Blazed,
    CompactDisc,
    Elaphe,
    GaussianRandom,
    Sinusoid,
    TiltedMirror,
    Xenopeltis,
)
from pipeline.surface.statistics import SurfaceStatistics, covered_share, measure
from tests.support import shared_file

SCANS = Path(__file__).parents[2].parent / "shared" / "data" / "snakes"


def statistics(field: HeightField) -> SurfaceStatistics:
    return measure(field, sigma_um=16.25, lambda_min_nm=380.0)


def waves(*terms: tuple[float, float, float], size: float = 65.0, pitch: float = 0.13) -> HeightField:
    """Sum of amplitude cos(2 pi (fx x + fy y) + 1)."""
    n = round(size / pitch)
    field = HeightField(np.zeros((n, n)), (pitch, pitch))
    x, y = field.coordinates_um()
    h = sum(a * np.cos(2 * np.pi * (fx * x + fy * y[:, None]) + 1.0) for a, fx, fy in terms)
    return HeightField(np.asarray(h), (pitch, pitch))


def scan(name: str, height_range_um: float) -> HeightField:
    path = SCANS / name
    if not path.is_file():
        pytest.skip(f"no scan {name} beside this checkout (shared/data/snakes)")
    codes = np.asarray(Image.open(path))
    codes = codes[..., 0] if codes.ndim == 3 else codes
    pitch = 65 / 1332
    raw = HeightField(codes[::-1].astype(np.float64) * height_range_um / 255, (pitch, pitch))
    return condition(raw, "plane", (0.05, 99.9))[0]


def test_the_plain_numbers_of_a_sinusoid() -> None:
    field = make(Sinusoid(kind="sinusoid", amplitude_um=0.1, size_um=(65.0, 32.5), pitch_um=0.1))
    s = statistics(field)
    assert (s.shape, s.size_um, s.pitch_um) == ((325, 650), (65.0, 32.5), (0.1, 0.1))
    assert s.sigma_h_um == pytest.approx(0.1 / np.sqrt(2), rel=1e-12)
    assert s.g == pytest.approx((2 * np.pi * 0.1 / 0.5) ** 2 / 2, rel=1e-12)
    assert s.range_um == np.ptp(field.heights_um)
    assert s.band_limit_per_um == (5.0, 5.0)
    assert s.reach_per_um == pytest.approx(2 / 0.38)
    assert s.windows == (4.0, 2.0)


def test_statistics_are_json() -> None:
    text = json.dumps(asdict(statistics(make(Blazed(kind="blazed", size_um=20.0)))))
    assert len(json.loads(text)["periods"]) >= 2


# --- the reachable disc ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("box", "share"),
    [
        ((9.0, 9.0), 1.0),
        # the inscribed square
        ((np.sqrt(2), np.sqrt(2)), 2 / np.pi),
        # the strip |fx| <= 1 of a disc of radius 2
        ((1.0, 2.0), (2 * np.sqrt(3) + 4 * np.pi / 3) / (4 * np.pi)),
        ((2.0, 1.0), (2 * np.sqrt(3) + 4 * np.pi / 3) / (4 * np.pi)),
        ((0.5, 0.25), 4 * 0.5 * 0.25 / (4 * np.pi)),
    ],
)
def test_the_covered_share_has_its_closed_form(box: tuple[float, float], share: float) -> None:
    assert covered_share(*box, 2.0) == pytest.approx(share, rel=1e-12)


@given(st.floats(0.1, 3.0), st.floats(0.1, 3.0))
@settings(max_examples=30, deadline=None)
def test_the_covered_share_is_the_area(a: float, b: float) -> None:
    x = (np.arange(4000) + 0.5) / 4000 * 2
    strip = np.where(x <= a, np.minimum(b, np.sqrt(4 - x**2)), 0.0)
    # one cell of the sum may be cut by the box's edge
    assert covered_share(a, b, 2.0) == pytest.approx(4 * strip.mean() * 2 / (4 * np.pi), abs=1e-3)


# --- periods -----------------------------------------------------------------------------------------


def test_a_grating_reports_its_period() -> None:
    for axis, direction in (("x", 0.0), ("y", 90.0)):
        field = make(Sinusoid(kind="sinusoid", period_um=2.5, axis=axis))
        (period,) = statistics(field).periods
        assert period.period_um == pytest.approx(2.5, abs=1e-6)
        assert abs(period.direction_deg) == pytest.approx(direction, abs=1e-3)
        assert period.share == pytest.approx(1.0, abs=1e-3)


@given(st.floats(0.8, 6.0), st.floats(-89.0, 90.0))
@settings(max_examples=30, deadline=None)
def test_periods_between_bins_are_found_too(period: float, direction: float) -> None:
    f = np.exp(1j * np.radians(direction)) / period
    (found,) = statistics(waves((0.1, f.real, f.imag))).periods
    # the Gaussian window's tails at the patch's edge, 3e-4 of its peak, are all that is inexact
    assert found.period_um == pytest.approx(period, rel=4e-4)
    gap = (found.direction_deg - direction + 90) % 180 - 90
    assert abs(gap) < 0.02


def test_shares_are_those_of_the_variance() -> None:
    first, second = statistics(waves((0.2, 0.4, 0.0), (0.1, 0.0, 1.3))).periods
    assert (first.share, second.share) == pytest.approx((0.8, 0.2), abs=2e-3)
    assert second.period_um == pytest.approx(1 / 1.3, rel=1e-4)


def test_a_weaker_neighbour_does_not_pull_a_line_away() -> None:
    (found,) = statistics(waves((0.2, 1.0, 0.0), (0.1, 1.12, 0.0))).periods
    assert found.period_um == pytest.approx(1.0, rel=1e-4)
    assert found.share == pytest.approx(1.0, abs=2e-3)


def test_a_blaze_reports_its_harmonics() -> None:
    first, second, *_ = statistics(make(Blazed(kind="blazed", pitch_um=0.1))).periods
    assert (first.period_um, second.period_um) == pytest.approx((2.5, 1.25), rel=1e-4)
    # of M samples a period: |c_m|^2 = 1 / (2 M sin(pi m / M))^2, of the variance (1 - 1 / M^2) / 12
    shares = [2 / (50 * np.sin(np.pi * m / 25)) ** 2 * 12 / (1 - 1 / 625) for m in (1, 2)]
    assert (first.share, second.share) == pytest.approx(shares, rel=1e-3)


@pytest.mark.parametrize("size", [10.0, 13.0])
def test_the_tracks_of_a_small_scan_are_reported(size: float) -> None:
    strongest = statistics(make(CompactDisc(kind="cd", size_um=size, pitch_um=0.08))).periods[0]
    assert strongest.period_um == pytest.approx(1.6, rel=0.01)
    assert strongest.share > 0.3


def test_a_line_with_pits_of_its_own_frequency() -> None:
    stored = np.load(shared_file("field/cd_like.npz"))
    heights = stored[stored.files[0]].astype(np.float64)
    raw = HeightField(1e-3 * heights, (0.078125, 0.078125))
    strongest = statistics(condition(raw, "plane", None)[0]).periods[0]
    assert strongest.period_um == pytest.approx(1.6, rel=0.01)
    assert 0.3 < strongest.share < 0.5


# where the noise holds as much at the same |f|, a line is one of its waves: weak lines have more repeats here
@pytest.mark.parametrize(
    ("share", "repeats", "correlation"),
    [
        *((share, repeats, 0.5) for share in (0.1, 0.2, 0.4) for repeats in (9.0, 25.0)),
        *((share, repeats, 1.0) for share in (0.2, 0.4) for repeats in (9.0, 25.0)),
        *((0.4, 6.5, correlation) for correlation in (0.5, 1.0)),
        (0.1, 25.0, 1.0),
    ],
)
def test_a_line_that_holds_a_tenth_of_the_variance_is_reported(
    share: float, repeats: float, correlation: float
) -> None:
    size = 24.0
    noise = make(GaussianRandom(kind="gaussian", size_um=size, correlation_um=correlation, seed=5)).heights_um
    ny, nx = noise.shape
    wave = np.sin(2 * np.pi * repeats * (0.8 * np.arange(nx) / nx + 0.6 * np.arange(ny)[:, None] / ny))
    line = wave * np.sqrt(share / (1 - share)) * noise.std() / wave.std()
    found = statistics(HeightField(noise + line, (size / nx, size / ny))).periods
    assert any(period.period_um == pytest.approx(size / repeats, rel=0.05) for period in found)


def test_a_disc_reports_its_tracks() -> None:
    strongest = statistics(make(CompactDisc(kind="cd"))).periods[0]
    assert strongest.period_um == pytest.approx(1.6, rel=2e-3)
    assert abs(strongest.direction_deg) == pytest.approx(90.0, abs=0.5)


def test_waves_longer_than_a_quarter_of_the_patch_are_left_out() -> None:
    (found,) = statistics(waves((1.0, 2.5 / 65, 0.0), (0.2, 0.0, 1.0))).periods
    assert found.period_um == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_a_surface_without_direction_has_no_period(seed: int) -> None:
    for correlation in (0.5, 1.0, 3.0):
        field = make(GaussianRandom(kind="gaussian", correlation_um=correlation, seed=seed))
        assert sum(period.share for period in statistics(field).periods) < 0.1


def test_mirrors_and_single_samples_have_no_period() -> None:
    flat = HeightField(np.full((64, 64), 0.3), (0.1, 0.1))
    for field in (flat, make(TiltedMirror(kind="tilted_mirror")), HeightField(np.ones((1, 1)), (1.0, 1.0))):
        assert statistics(field).periods == ()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_synthetic_skins_have_the_periods_asked_for(seed: int) -> None:
    fingers = statistics(make(Elaphe(kind="elaphe", seed=seed))).periods[0]
    assert fingers.period_um == pytest.approx(1.144, rel=0.05)
    assert abs(fingers.direction_deg) < 3
    assert fingers.share > 0.3
    both = statistics(make(Xenopeltis(kind="xenopeltis", seed=seed))).periods[:2]
    across, along = sorted(both, key=lambda period: period.period_um)
    assert across.period_um == pytest.approx(0.55, rel=0.05)
    assert along.period_um == pytest.approx(1.55, rel=0.05)
    assert abs(across.direction_deg) < 10
    assert abs(along.direction_deg) > 80


def test_elaphe_along_y_is_no_grating() -> None:
    for period in statistics(make(Elaphe(kind="elaphe"))).periods:
        assert abs(period.direction_deg) < 45 or period.share < 0.05


def test_the_real_elaphe() -> None:
    s = statistics(scan("elaphe_65um.png", 0.518))
    # shared/data/README.md: 0.060 um and 0.37 um after this conditioning, 1.0 to 1.15 um across
    assert s.sigma_h_um == pytest.approx(0.060, abs=5e-4)
    assert s.range_um == pytest.approx(0.37, abs=2e-3)
    assert 1.0 <= s.periods[0].period_um <= 1.15
    assert abs(s.periods[0].direction_deg) < 3
    assert s.reach_covered == 1.0


def test_the_real_xenopeltis() -> None:
    s = statistics(scan("xenopeltis_65um.png", 0.81869))
    assert s.sigma_h_um == pytest.approx(0.050, abs=5e-4)
    across, along = sorted(s.periods[:2], key=lambda period: period.period_um)
    assert across.period_um == pytest.approx(0.565, rel=0.03)
    assert abs(across.direction_deg) < 15
    assert along.period_um == pytest.approx(1.51, rel=0.03)
    assert abs(along.direction_deg) > 80


# --- seams -------------------------------------------------------------------------------------------


def test_a_plane_steps_at_its_seams_by_its_whole_rise() -> None:
    field = make(
        TiltedMirror(kind="tilted_mirror", tilt_x_deg=2.0, tilt_y_deg=1.0, size_um=(10.0, 6.0), pitch_um=0.1)
    )
    s = statistics(field)
    slopes = np.tan(np.radians([2.0, 1.0]))
    assert s.inner_step_um == pytest.approx(tuple(0.1 * slopes), rel=1e-9)
    assert s.seam_step_um == pytest.approx((9.9 * slopes[0], 5.9 * slopes[1]), rel=1e-9)


def test_seam_energy_is_none_for_a_periodic_surface_and_all_for_a_tilt() -> None:
    y, x = np.mgrid[0:64, 0:96] * 0.1
    periodic = np.cos(2.0 * np.pi * x / 3.2) * np.sin(2.0 * np.pi * y / 1.6)
    assert measure(HeightField(periodic, (0.1, 0.1)), 1.5, 380.0).seam_energy < 0.02
    assert measure(HeightField(0.1 * x, (0.1, 0.1)), 1.5, 380.0).seam_energy > 0.9
    assert measure(HeightField(0.0 * x, (0.1, 0.1)), 1.5, 380.0).seam_energy == 0.0
