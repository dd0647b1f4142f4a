"""The stress sweep: what it measures is right, what is broken it finds, and a part of it holds here."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from pipeline.diffraction import dft_stack, expansion
from pipeline.diffraction.reference import power_direct
from pipeline.errors import AccuracyError
from pipeline.evaluation.stability import algorithms, sweep, verdict
from pipeline.evaluation.stability.algorithms import NO_DIGITS, Measurement, directions, one_wavelength
from pipeline.evaluation.stability.sweep import Kind, Precision, StressCase
from pipeline.evaluation.stability.verdict import Outcome

NOISE = StressCase("height", "series", "chebyshev", "float32", "noise", 0.5, (48, 48), (0.1, 0.1), 1.2)
DEVICE = replace(NOISE, algorithm="device")


@pytest.mark.parametrize("kind", ["flat", "spike", "steps", "hills", "noise"])
@pytest.mark.parametrize("height_um", [1e-3, 10.0])
def test_surfaces_span_what_they_say(kind: Kind, height_um: float) -> None:
    field = replace(NOISE, kind=kind, height_um=height_um, shape=(24, 40), pitch_um=(0.05, 0.1)).field()
    assert (field.shape, field.pitch_um) == ((24, 40), (0.05, 0.1))
    assert 2.0 * field.half_range_um == pytest.approx(0.0 if kind == "flat" else height_um, rel=1e-12)


def test_the_mean_level_is_the_mean_of_the_power_over_the_band() -> None:
    """Parseval: |P|^2 on the whole grid of the patch's frequencies, window folded, whatever the heights."""
    case = replace(NOISE, shape=(12, 16), height_um=2.0)
    field, nm = case.field(), 500.0
    (ny, nx), (width, height) = field.shape, field.size_um
    # half open, so that no frequency counts twice; just inside the band
    fx, fy = np.meshgrid(np.arange(-nx // 2, nx // 2) / width, np.arange(-ny // 2, ny // 2) / height)
    uvw = np.stack([1e-3 * nm * fx.ravel(), 1e-3 * nm * fy.ravel(), np.full(fx.size, -1.3)], axis=-1)
    uvw[:, :2] *= 1.0 - 1e-12
    mean = np.mean(power_direct(field, 0.3, uvw, nm))
    assert verdict.mean_level(field, 0.3) == pytest.approx(mean, rel=1e-6)


def test_a_measurement_takes_the_floor_where_the_truth_is_dark() -> None:
    measured = Measurement(np.array([1.1, 2e-6]), np.array([1.0, 1e-6]))
    assert measured.worst(1e-9) == pytest.approx(1.0)
    assert measured.worst(1e-2) == pytest.approx(0.1)


@pytest.mark.parametrize("found", [[np.nan, 0.0], [np.inf, 0.0], [1.0, 1e-9]])
def test_nothing_finite_and_nothing_beyond_the_band_goes_through(found: list[float]) -> None:
    """NaN or infinity where the truth is known, or a number where nothing can be: no digit is left."""
    assert Measurement(np.array(found), np.array([1.0, np.nan])).worst(1.0) == NO_DIGITS
    assert Measurement(np.array([1.0, np.nan]), np.array([1.0, np.nan])).worst(1.0) == 0.0


def test_directions_reach_every_extreme() -> None:
    uvw = directions(NOISE, 380.0)
    rho, w = np.hypot(uvw[:, 0], uvw[:, 1]), np.abs(uvw[:, 2])
    assert (rho.min(), w.min(), w.max()) == (0.0, pytest.approx(0.0, abs=1e-11), 2.0)
    assert 2.0 - 1e-11 < rho.max() <= 2.0


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("height_um", [1e-3, 10.0])
def test_chebyshev_holds(height_um: float, precision: Precision) -> None:
    outcome = verdict.judge(replace(NOISE, precision=precision, height_um=height_um))
    assert outcome.verdict == "holds", outcome
    assert outcome.speckle_error is not None
    # float64 keeps more than single precision could
    assert outcome.speckle_error < {"float32": 1e-4, "float64": 1e-8}[precision]


def test_too_few_terms_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The order is taken for a phase two thirds as large: what is left out is what the sweep sees."""
    order = expansion.chebyshev_order
    monkeypatch.setattr(expansion, "chebyshev_order", lambda z, _tolerance: order(0.66 * z, 0.1))
    assert verdict.judge(NOISE).verdict == "misses"
    assert verdict.judge(replace(DEVICE, precision="float64")).verdict == "misses"


def test_a_wrong_sign_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """i^n taken for (-i)^n mirrors the heights, which only |P|^2 off the axis can tell."""
    assert verdict.judge(NOISE).verdict == "holds"
    monkeypatch.setattr(algorithms, "jv", lambda n, z: jv(n, -z))
    outcome = verdict.judge(NOISE)
    assert outcome.verdict == "misses"
    assert outcome.check.value is not None
    assert outcome.check.value > 0.1


def test_a_crash_is_no_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(*_: object, **__: object) -> None:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr(dft_stack, "build", crash)
    outcome = verdict.judge(NOISE)
    assert (outcome.verdict, outcome.check.remark) == ("misses", "ZeroDivisionError: float division by zero")


def test_a_refusal_is_one() -> None:
    """Windows finer than the samples, and Taylor tables of heights beyond their digits."""
    fine = verdict.judge(replace(DEVICE, sigma_um=0.1))
    assert (fine.verdict, fine.check.value) == ("refused", None)
    assert "at least 1.2 pitches" in fine.check.remark
    tall = verdict.judge(replace(DEVICE, basis="taylor", height_um=2.0))
    assert tall.verdict == "refused"
    assert tall.check.remark.startswith("Taylor tables of order N = ")


def test_a_taylor_plan_that_refuses_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the paper's table is refused its digits are gone: without the refusal they would be silently wrong."""
    plan = expansion.plan_taylor
    monkeypatch.setattr(expansion, "float32_rounding", lambda *_: 0.0)
    assert plan(replace(DEVICE, height_um=0.6).field(), one_wavelength(380.0), 1e-4).order > 30
    assert verdict.judge(replace(DEVICE, basis="taylor", height_um=0.6)).verdict == "misses"


@pytest.fixture(scope="module")
def heights() -> list[Outcome]:
    """The device's algorithms and the series at the two heights of the criterion."""
    return verdict.sweep(list(_criterion_cases()))


def _criterion_cases() -> Iterator[StressCase]:
    yield replace(NOISE, height_um=10.0)
    yield replace(DEVICE, height_um=10.0)
    yield replace(NOISE, basis="taylor", precision="float64", height_um=2.0)


def test_chebyshev_float32_holds_at_10_um_where_taylor_float64_has_failed_at_2_um(heights: list[Outcome]) -> None:
    chebyshev, taylor = verdict.criterion(heights)
    assert (chebyshev.id, chebyshev.verdict) == ("stability.chebyshev_float32_at_10_um", "holds")
    assert (taylor.id, taylor.verdict) == ("stability.taylor_float64_at_2_um", "holds")
    assert chebyshev.value is not None
    assert chebyshev.value < 2e-5
    assert taylor.value is not None
    assert taylor.value > 1e-3
    assert [outcome.verdict for outcome in heights] == ["holds", "holds", "refused"]


@pytest.mark.parametrize(("error", "verdicts"), [(2e-4, ["misses", "holds"]), (1e-6, ["holds", "misses"])])
def test_a_criterion_that_is_not_met_misses(heights: list[Outcome], error: float, verdicts: list[str]) -> None:
    found = verdict.criterion([replace(outcome, speckle_error=error) for outcome in heights])
    assert [check.verdict for check in found] == verdicts


@pytest.mark.parametrize(
    "case",
    [
        replace(DEVICE, kind="flat", height_um=10.0),
        replace(DEVICE, kind="spike", height_um=10.0),
        replace(DEVICE, kind="steps", height_um=10.0),
        replace(DEVICE, pitch_um=(0.005, 0.005), sigma_um=0.06),
        replace(DEVICE, pitch_um=(0.2, 0.2), sigma_um=2.4),
        replace(DEVICE, shape=(33, 65), pitch_um=(0.2, 0.1), sigma_um=1.5),
        replace(DEVICE, sigma_um=4.8),
        replace(DEVICE, sigma_um=9.6),
        replace(DEVICE, precision="float64", height_um=10.0),
        replace(DEVICE, precision="float64", kind="steps", height_um=1e-3),
        replace(DEVICE, basis="taylor", height_um=0.1),
    ],
    ids=lambda case: f"{case.kind} {case.height_um:g} um, {case.shape}, {case.pitch_um[0]} um, {case.sigma_um} um",
)
def test_extremes_on_the_device(case: StressCase) -> None:
    outcome = verdict.judge(case)
    assert outcome.verdict == "holds", outcome


def test_the_sweep_covers_what_it_was_asked_for() -> None:
    cases = sweep.cases()
    heights = {case.height_um for case in cases}
    assert (min(heights), max(heights)) == (1e-3, 10.0)
    assert (min(c.pitch_um[0] for c in cases), max(c.pitch_um[0] for c in cases)) == (0.005, 0.2)
    assert {(64, 64), (4096, 4096)} <= {case.shape for case in cases}
    assert any(case.shape[0] != case.shape[1] for case in cases)
    assert any(case.pitch_um[0] != case.pitch_um[1] for case in cases)
    windows = [case for case in cases if case.family == "window"]
    assert {c.sigma_um / c.pitch_um[0] for c in windows} >= {2.0, 128.0}
    assert {case.kind for case in cases} == {"flat", "spike", "steps", "hills", "noise"}
    assert {(c.basis, c.precision) for c in cases if c.algorithm == "series"} == {
        (basis, precision) for basis in ("taylor", "chebyshev") for precision in ("float32", "float64")
    }
    assert len(sweep.cases(quick=True)) < len(cases) / 2
    assert len({case.id for case in cases}) == len(cases)


def test_progress_is_told_cell_by_cell() -> None:
    told: list[tuple[str, float]] = []
    verdict.sweep([NOISE, NOISE], lambda step, done: told.append((step, done)))
    assert told == [("stress", 0.5), ("stress", 1.0)]


@pytest.mark.slow
def test_a_table_is_held_against_fresh_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Baked and certified it is within its budget; a look-up gone dark or gone NaN afterwards is found."""
    case = replace(NOISE, algorithm="table", height_um=0.3, shape=(32, 32), sigma_um=0.8)
    assert verdict.judge(case).verdict == "holds"
    for value in (0.0, np.nan):
        monkeypatch.setattr(
            algorithms, "table_evaluator", lambda *_, v=value: lambda wi, _wr: np.full((len(wi), 3), v)
        )
        assert verdict.judge(case).verdict == "misses"


def test_an_accuracy_error_is_a_refusal_whatever_raises_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AccuracyError("too tall")

    monkeypatch.setattr(verdict, "table_error", refuse)
    outcome = verdict.judge(replace(NOISE, algorithm="table"))
    assert (outcome.verdict, outcome.check.remark) == ("refused", "too tall")
