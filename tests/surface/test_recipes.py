"""Laws of the synthetic surfaces: exact periods, closed forms, whole runs, no seams."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from pipeline.errors import ConfigError
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import make
from pipeline.surface.recipes.disc import LONGEST_RUN, SHORTEST_RUN, draw_runs
from pipeline.surface.recipes.parameters import Recipe

ADAPTER: TypeAdapter[Any] = TypeAdapter(Recipe)
GRATINGS = ("sinusoid", "rectangular", "blazed")
SNAKES = ("elaphe", "xenopeltis")


def surface(kind: str, **keys: Any) -> HeightField:
    return make(ADAPTER.validate_python({"kind": kind, "pitch_um": 0.1, **keys}))


def order_amplitude(profile: np.ndarray, periods: int, phase: float, order: int) -> complex:
    """Mean over samples of exp(i phase h) exp(2 pi i order x / period)."""
    turns = (np.arange(profile.size) - profile.size // 2) * periods * order / profile.size
    return complex(np.mean(np.exp(1j * phase * profile) * np.exp(2j * np.pi * turns)))


@pytest.mark.parametrize("kind", GRATINGS)
@given(
    period=st.floats(0.5, 9.0),
    size=st.floats(0.3, 40.0),
    pitch=st.floats(0.03, 0.2),
    axis=st.sampled_from("xy"),
)
@settings(max_examples=25, deadline=None)
def test_gratings_hold_whole_periods_exactly(kind: str, period: float, size: float, pitch: float, axis: str) -> None:
    field = surface(kind, period_um=period, size_um=(size, size), pitch_um=pitch, axis=axis)
    length = field.size_um["xy".index(axis)]
    periods = max(1, round(size / period))
    assert length == pytest.approx(periods * period, rel=1e-14)
    profile = field.heights_um[0] if axis == "x" else field.heights_um[:, 0]
    assert profile.size == round(periods * period / pitch)
    # only harmonics of the period may occur: all other bins are rounding
    spectrum = np.abs(np.fft.fft(profile))
    others = np.arange(profile.size) % np.gcd(periods, profile.size) != 0
    assert np.all(spectrum[others] <= 1e-12 * profile.size)
    # the other axis is constant
    assert np.ptp(field.heights_um, axis=0 if axis == "x" else 1).max() == 0.0


def test_the_default_patch() -> None:
    field = surface("blazed")
    assert (field.shape, field.size_um, field.pitch_um) == ((650, 650), (65.0, 65.0), (0.1, 0.1))


def test_a_patch_shorter_than_a_period_holds_one() -> None:
    assert surface("sinusoid", size_um=(0.1, 1.0)).size_um == (2.5, 1.0)


def test_a_sinusoid_has_its_crest_at_the_centre_and_its_closed_form_rms() -> None:
    field = surface("sinusoid", amplitude_um=0.1, period_um=2.5)
    x, _ = field.coordinates_um()
    # the argument reaches 2 pi 13: its own rounding is 1e-14
    np.testing.assert_allclose(field.heights_um[7], 0.1 * np.cos(2 * np.pi * x / 2.5), atol=1e-14)
    assert field.heights_um.std() == pytest.approx(0.1 / np.sqrt(2), rel=1e-13)


@given(duty=st.floats(0.02, 0.98), period=st.floats(1.0, 4.0))
@settings(max_examples=50, deadline=None)
def test_the_rectangle_has_exactly_its_area(duty: float, period: float) -> None:
    heights = surface("rectangular", period_um=period, duty=duty, height_um=0.2, size_um=(20, 0.1)).heights_um
    assert heights.mean() == pytest.approx(0.2 * duty, rel=1e-11)
    assert heights.min() >= 0.0
    assert heights.max() <= 0.2


def test_a_rectangle_of_whole_samples_has_two_heights_and_the_closed_form_variance() -> None:
    heights = surface("rectangular", period_um=2.5, pitch_um=0.125, duty=0.3, height_um=0.15).heights_um
    # 6 of 20 samples; interval ends are rounded to 1e-16 of a patch of 520 samples
    assert np.all(np.minimum(np.abs(heights), np.abs(heights - 0.15)) < 1e-12)
    assert heights.var() == pytest.approx(0.15**2 * 0.3 * 0.7, rel=1e-10)
    assert heights[0, heights.shape[1] // 2] == pytest.approx(0.15)


def test_the_edge_samples_of_other_rectangles_stay_within_the_documented_error() -> None:
    profile = surface("rectangular", period_um=2.5, pitch_um=0.1, duty=0.5, height_um=0.15).heights_um[0]
    for phase in (1.0, 10.0, 20.0, 33.0):
        closed = 0.5 + 0.5 * np.exp(1j * phase * 0.15)
        assert abs(order_amplitude(profile, 26, phase, 0) - closed) <= 2 / 25


@given(period=st.floats(0.5, 4.0), pitch=st.floats(0.03, 0.15), size=st.floats(1.0, 30.0))
@settings(max_examples=60, deadline=None)
def test_the_sawtooth_has_no_bias_at_any_pitch(period: float, pitch: float, size: float) -> None:
    field = surface("blazed", period_um=period, height_um=0.25, size_um=(size, pitch), pitch_um=pitch)
    assert field.heights_um.mean() == pytest.approx(0.125, rel=1e-12)
    assert field.heights_um.min() > 0
    assert field.heights_um.max() < 0.25


@pytest.mark.parametrize("order", [-2, -1, 0, 1, 2])
@pytest.mark.parametrize("phase", [-15.0, -22.0, 25.13])
def test_the_sawtooth_diffracts_like_its_closed_form(order: int, phase: float) -> None:
    """integral over a period: (exp(i a) - 1) / (i a), a = phase height + 2 pi order; O(1/M^2) apart."""
    profile = surface("blazed", height_um=0.25).heights_um[0]
    a = phase * 0.25 + 2 * np.pi * order
    closed = np.exp(0.5j * a) * np.sinc(a / (2 * np.pi))
    # x = 0 is the middle sample, half a step (1/50 of a period) past the drop
    measured = order_amplitude(profile, 26, phase, order) * np.exp(2j * np.pi * order * 0.5 / 25)
    # midpoint rule of exp(i a t): relative error (a / M)^2 / 24 plus its next term
    assert abs(measured - closed) <= 1.1 * (a / 25) ** 2 / 24 * abs(closed) + 1e-12


def test_a_sawtooth_rises_along_its_axis() -> None:
    for axis in (0, 1):
        field = surface("blazed", axis="yx"[axis])
        steps = np.diff(field.heights_um, axis=axis)
        assert np.count_nonzero(steps > 0) > 20 * np.count_nonzero(steps < 0)


def test_the_tilted_mirror_is_a_plane_through_the_centre() -> None:
    field = surface("tilted_mirror", tilt_x_deg=2.0, tilt_y_deg=-1.0, size_um=(10, 7))
    ny, nx = field.shape
    assert field.heights_um[ny // 2, nx // 2] == 0.0
    rise_x, rise_y = field.heights_um[0, -1] - field.heights_um[0, 0], np.ptp(field.heights_um[:, 0])
    assert rise_x == pytest.approx(np.tan(np.radians(2)) * 9.9, rel=1e-12)
    assert rise_y == pytest.approx(np.tan(np.radians(1)) * 6.9, rel=1e-12)
    assert field.heights_um[-1, 0] < field.heights_um[0, 0]


def test_the_mirror_is_flat() -> None:
    assert not surface("mirror").heights_um.any()


# --- compact disc ------------------------------------------------------------------------------------


@given(bits=st.integers(6, 3000), seed=st.integers(0, 2**32))
@settings(max_examples=300, deadline=None)
def test_runs_close_the_row_with_legal_lengths(bits: int, seed: int) -> None:
    runs = draw_runs(np.random.default_rng(seed), bits)
    assert runs.sum() == bits
    assert runs.size % 2 == 0
    assert runs.min() >= SHORTEST_RUN
    assert runs.max() <= LONGEST_RUN


def test_all_runs_are_about_equally_common() -> None:
    runs = draw_runs(np.random.default_rng(0), 70_000)
    counts = np.bincount(runs)[SHORTEST_RUN:]
    # about 1111 of each length; closing the row moves a few percent of the runs by one bit
    np.testing.assert_allclose(counts, runs.size / 9, rtol=0.15)


def test_disc_tracks_are_closed_runs_of_3_to_11_bits() -> None:
    # four samples a bit, eight a track: edges fall between samples and nothing is averaged
    field = surface("cd", bit_um=0.4, track_um=1.6, pit_width_um=0.8, pitch_um=(0.1, 0.2), depth_um=0.12)
    ny, nx = field.shape
    seen = set()
    for track in range(ny // 8):
        rows = field.heights_um[8 * track : 8 * track + 8]
        pits = rows[4] < -0.06
        np.testing.assert_allclose(rows[2:6], np.broadcast_to(-0.12 * pits, (4, nx)), atol=1e-12)
        np.testing.assert_allclose(rows[[0, 1, 6, 7]], 0.0, atol=1e-12)
        changes = np.flatnonzero(pits != np.roll(pits, 1))
        lengths = np.diff(np.append(changes, changes[0] + nx))
        assert np.all(lengths % 4 == 0)
        seen |= set((lengths // 4).tolist())
    assert seen == set(range(3, 12))


def test_disc_averaging_keeps_the_pits_area() -> None:
    fine = surface("cd", pitch_um=0.02, size_um=(20, 5))
    coarse = surface("cd", pitch_um=0.13, size_um=(20, 5))
    assert coarse.size_um == fine.size_um
    assert coarse.heights_um.mean() == pytest.approx(fine.heights_um.mean(), rel=1e-12)
    assert coarse.heights_um.min() == pytest.approx(-0.12, rel=1e-12)
    # channel bits and tracks are whole
    assert coarse.size_um[0] / 0.2777 == pytest.approx(round(coarse.size_um[0] / 0.2777), abs=1e-12)
    assert coarse.size_um[1] == pytest.approx(3 * 1.6)


# --- random surfaces ---------------------------------------------------------------------------------


def test_a_gaussian_surface_has_exactly_its_rms() -> None:
    heights = surface("gaussian", sigma_h_um=0.043).heights_um
    assert heights.std() == pytest.approx(0.043, rel=1e-12)
    assert heights.mean() == pytest.approx(0.0, abs=1e-15)


def test_a_gaussian_surface_has_its_autocorrelation() -> None:
    lx, ly = 0.6, 1.5
    # 65^2 / (pi lx ly / 2) patches of independent height, four seeds, four sigma
    tolerance = 4 / np.sqrt(4 * 65**2 / (0.5 * np.pi * lx * ly))
    lags = {"x": (0.3, 0.6, 0.9), "y": (0.7, 1.5, 2.2)}
    found = {(a, lag): [] for a in "xy" for lag in lags[a]}
    for seed in range(4):
        field = surface("gaussian", sigma_h_um=1.0, correlation_um=(lx, ly), seed=seed)
        for (a, lag), values in found.items():
            shifted = np.roll(field.heights_um, round(lag / 0.1), axis="yx".index(a))
            values.append(np.mean(field.heights_um * shifted))
    for (a, lag), values in found.items():
        expected = np.exp(-((lag / {"x": lx, "y": ly}[a]) ** 2))
        assert np.mean(values) == pytest.approx(expected, abs=tolerance)


@pytest.mark.parametrize("kind", [*SNAKES, "gaussian", "cd"])
def test_seeds_decide_everything(kind: str) -> None:
    small = {"size_um": 10.0}
    first = surface(kind, seed=5, **small).heights_um
    np.testing.assert_array_equal(first, surface(kind, seed=5, **small).heights_um)
    assert np.any(first != surface(kind, seed=6, **small).heights_um)


@pytest.mark.parametrize("kind", [*SNAKES, "gaussian"])
def test_seams_are_no_rougher_than_the_inside(kind: str) -> None:
    """The seam's rms step over many seeds is the inside's: a step there would be of the height's own size."""
    for axis in (0, 1):
        seam, inside = [], []
        for seed in range(6):
            heights = surface(kind, seed=seed, size_um=20.0, pitch_um=0.05).heights_um
            steps = np.diff(heights, axis=axis, append=heights.take([0], axis=axis))
            seam.append(np.mean(steps.take(-1, axis=axis) ** 2))
            inside.append(np.mean(steps**2))
        # rows cross a seam a few times only: within a factor two of rms, where a true step gives 4 and more
        assert np.mean(seam) < 4 * np.mean(inside)


@pytest.mark.parametrize(("kind", "low", "high"), [("elaphe", 0.052, 0.068), ("xenopeltis", 0.042, 0.055)])
def test_snakes_have_the_height_asked_for_and_the_papers_rms(kind: str, low: float, high: float) -> None:
    for seed in (1, 2, 3):
        field = surface(kind, seed=seed)
        assert np.ptp(field.heights_um) == pytest.approx({"elaphe": 0.37, "xenopeltis": 0.3}[kind], rel=1e-12)
        assert low < field.heights_um.std() < high


def test_snakes_hold_whole_periods() -> None:
    assert surface("elaphe").size_um == pytest.approx((57 * 1.144, 65.0), rel=1e-14)
    assert surface("xenopeltis").size_um == pytest.approx((118 * 0.55, 42 * 1.55), rel=1e-14)


def test_xenopeltis_is_blazed_along_y() -> None:
    """Fingers rise slowly towards +y and drop at once: the third moment of the steps is negative there."""
    heights = surface("xenopeltis", pitch_um=0.05, size_um=30.0).heights_um
    skew = [float(np.mean(d**3) / np.mean(d**2) ** 1.5) for d in (np.diff(heights, axis=a) for a in (0, 1))]
    assert skew[0] < -1
    assert abs(skew[1]) < 0.2


def test_elaphe_fingers_point_to_positive_y() -> None:
    """Upwards a finger narrows slowly, and the next one's flared base begins at once: steps up are steep."""
    heights = surface("elaphe", pitch_um=0.05, size_um=30.0).heights_um
    step = np.diff(heights, axis=0)
    assert np.mean(step**3) / np.mean(step**2) ** 1.5 > 1


# --- refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "recipe"),
    [
        ("pitch_um", {"kind": "sinusoid", "period_um": 0.15}),
        ("pitch_um", {"kind": "mirror", "size_um": 65.0, "pitch_um": 1e-4}),
        ("pit_width_um", {"kind": "cd", "pit_width_um": 1.7}),
        ("size_um", {"kind": "cd", "size_um": 1.0}),
        ("correlation_um", {"kind": "gaussian", "correlation_um": 0.15}),
        ("correlation_um", {"kind": "gaussian", "correlation_um": (1.0, 70.0)}),
    ],
)
def test_structure_beyond_the_nyquist_limit_is_refused_by_key(key: str, recipe: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=rf"^recipe {recipe['kind']}: surface\.recipe\.{key}: expected "):
        make(ADAPTER.validate_python(recipe))
