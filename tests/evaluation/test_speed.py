"""Other algorithms for the same numbers, counts of work, and criteria."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from kernels import device, peak
from pipeline.accuracy.checks import relative_error
from pipeline.config.models import Config
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.evaluation import plain_numpy
from pipeline.evaluation.speed import checks, growth, machine, memory, nufft, polar_bake, setting, transforms, work
from pipeline.evaluation.speed.growth import GrowthCurve, Reading, ScanCost
from pipeline.evaluation.speed.machine import Machine, Timed, Work
from pipeline.evaluation.speed.polar_bake import Stages
from pipeline.evaluation.speed.processes import Compiling, RunFailedError, warm_run
from pipeline.evaluation.speed.setting import Setting
from pipeline.evaluation.speed.stage_costs import BakeCost, StageCost
from pipeline.evaluation.speed.timing import best_of
from pipeline.evaluation.speed.truth import MapTruth
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Mirror
from pipeline.surface.source import SurfaceSource
from pipeline.tables.polar.layout import PolarLayout

pytestmark = pytest.mark.slow

SIGMA_UM = 2.0


def config(**sections: object) -> Config:
    base = {"coherence": Coherence(sigma_um=SIGMA_UM), "spectrum": Light(range_nm=(520.0, 560.0))}
    return Config(name="small", surface=SurfaceSource(recipe=Mirror(kind="mirror")), **{**base, **sections})


def rough(pitch_um: tuple[float, float] = (0.1, 0.11), rows: int = 64) -> HeightField:
    rng = np.random.default_rng(4)
    return HeightField(rng.uniform(-0.08, 0.08, (rows, 80)), pitch_um)


CASES = {
    "plain": (rough(), config()),
    # |f| beyond 1 / (2 pitch) is unknown and dark
    "coarse scan": (rough((0.2, 0.19)), config()),
    "patch wider than the window": (rough(rows=32), config(coherence=Coherence(sigma_um=0.8))),
    "gold": (rough(), config(material=Material(fresnel="conductor"))),
}


def power_spectrum(of: Setting, built: Stack) -> PolarPowerSpectrum:
    return of.bake.power_spectrum(built, of.plan.azimuths)


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Setting:
    field, chosen = CASES[request.param]
    return setting.make(field, chosen, PolarLayout(rings=24, azimuths=96))


def test_plain_numpy_gives_the_samples(case: Setting) -> None:
    """One texel after the other, from the same stack: what is left is E's interpolation."""
    built = case.bake.stack(case.field)
    samples = case.samples(power_spectrum(case, built))
    coefficients = plain_numpy.complex_coefficients(built)
    rho, phi = case.plan.rings.rho(), case.plan.azimuths.phi()
    for ring, azimuth in ((0, 5), (7, 40), (15, 90), (23, 61)):
        uv = rho[ring] * np.array([np.cos(phi[azimuth]), np.sin(phi[azimuth])])
        found = plain_numpy.polar_texel(built, coefficients, case.rule_of_ring(ring), uv, case.series(ring))
        error = relative_error(samples[ring, :, :, azimuth], found, 1e-4 * samples.max())
        assert error.median < 1e-3
        assert error.maximum < 0.05


def test_nufft_gives_the_samples(case: Setting) -> None:
    pytest.importorskip("finufft")
    samples = case.samples(power_spectrum(case, case.bake.stack(case.field)))
    routed = nufft.run(case, 48, 1)
    # all of half a turn; the other half follows, for heights are real
    error = relative_error(routed.samples.astype(float), samples, 1e-4 * samples.max())
    assert error.median < 1e-3
    # E steps to 0 where the band ends, and its interpolation rounds the step off
    assert error.percentile_99 < 0.05
    assert nufft.points_of(case) == routed.points
    assert routed.seconds(case) > routed.fixed_s > 0.0


def test_the_stacks_transforms_agree(case: Setting) -> None:
    """Kernel, FFTW and scipy on the same terms and frequencies, in both precisions."""
    single, double = transforms.measure(case, 1)
    assert (single.precision, double.precision) == ("single", "double")
    assert single.terms == double.terms == case.plan.terms
    assert 0.0 < max(single.fftw_difference, single.scipy_difference) < 1e-6
    assert 0.0 < max(double.fftw_difference, double.scipy_difference) < 1e-14
    assert min(single.kernel_s, single.fftw_s, single.scipy_s) > 0.0


def test_of_two_bakes_the_better_times_count() -> None:
    of = CASES["plain"]
    baked = polar_bake.bake(setting.make(*of, PolarLayout(rings=24, azimuths=96)), 1)
    slow = replace(baked, stages=Stages(1.0, 1.0, 1.0), lights_s=(4.0, 13.0), kernel_s={"a": 1.0, "b": 4.0})
    fast = replace(baked, stages=Stages(0.1, 2.0, 0.1), lights_s=None, kernel_s={"a": 3.0, "b": 2.0})
    for found in (polar_bake.best(slow, fast), polar_bake.best(fast, slow)):
        assert found.stages.total == pytest.approx(2.2)
        assert found.second_light_s == 9.0
        assert found.kernel_s == {"a": 1.0, "b": 2.0}


def test_a_bake_is_timed_kernel_by_kernel() -> None:
    field, chosen = CASES["plain"]
    made = setting.make(field, chosen, PolarLayout(rings=24, azimuths=96))
    baked = polar_bake.bake(made, 2)
    assert baked.stages.total > baked.stages.table > baked.kernel_s["apply_operator"] > 0.0
    assert baked.second_light_s is not None
    assert [timed.work.stage for timed in polar_bake.stages(made, baked)] == [
        "stack",
        "power spectrum",
        "build_operator",
        "apply_operator",
        "splines",
    ]


def test_the_power_spectrum_needs_what_its_loops_do() -> None:
    """Per radius and azimuth of half a turn: every tap of every term, complex, and every term at every node in s."""
    field, chosen = CASES["plain"]
    made = setting.make(field, chosen, PolarLayout(rings=24, azimuths=96))
    built = made.bake.stack(made.field)
    taps = (2 * built.reach[0] + 1) * (2 * built.reach[1] + 1)
    per_pair = 2 * (taps * 2 * built.terms + 2 * built.terms * made.plan.s_nodes)
    found = work.power_spectrum(made, built, power_spectrum(made, built))
    assert found.flops == per_pair * len(made.bake.radius_per_um) * 48
    assert built.terms <= built.coefficients.shape[3]


def test_a_share_is_of_what_binds() -> None:
    limits = Machine("device", 2, 16, {}, single_flops=100.0, double_flops=50.0, bandwidth=10.0)
    reached = machine.share(Timed(Work("x", "single", flops=100.0, bytes=5.0), 2.0), limits)
    assert (reached.peak_share, reached.bandwidth_share) == (0.5, 0.25)
    assert (reached.bound, reached.bound_share) == ("arithmetic", 0.5)
    reached = machine.share(Timed(Work("x", "double", flops=10.0, bytes=15.0), 2.0), limits)
    assert (reached.bound, reached.bound_share) == ("bandwidth", 0.75)


@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_a_peak_is_the_kernels_operations_over_its_shortest_launch(
    precision: Literal["single", "double"], real: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The values that it writes show how many chains it continued."""
    launched = []
    launch = device.Program.launch

    def note(self: device.Program, kernel: str, size: tuple[int, ...], steps: np.int32, buffer: object) -> None:
        launched.append((size[0], int(steps), buffer))
        launch(self, kernel, size, steps, buffer)

    monkeypatch.setattr(device.Program, "launch", note)
    with device.default_device().timing() as launches:
        flops = peak.measure_peak(precision, 0.1)
    items, steps, buffer = launched[-1]
    # x = 0.999 x + 0.001 n comes to n, in every lane of every chain, and not before some thousand steps
    found = device.download(buffer, np.empty(items, real))
    lanes = device.default_device().vector_width * 4 // np.dtype(real).itemsize
    chains = round(float(found[-1]) / (lanes * (items - 1)))
    np.testing.assert_allclose(found, chains * lanes * np.arange(items), rtol=1e-3, atol=1e-3)
    # two units with a latency of four, and two factors beside the chains in sixteen registers
    assert 8 <= chains <= 14
    # the first compiles; a listener's own stopwatch stops a little later
    shortest = min(each.seconds for each in launches[1:])
    assert flops == pytest.approx(2 * chains * lanes * steps * items / shortest, rel=0.05)


def test_bandwidth_is_three_arrays_over_the_shortest_launch() -> None:
    """Beside numpy's own copy, which reads one array and writes one: neither is far from what memory allows."""
    with device.default_device().timing() as launches:
        bandwidth = peak.measure_bandwidth(0.3)
    shortest = min(each.seconds for each in launches[1:])
    ones = np.ones(round(bandwidth * shortest / 3.0), np.uint8)
    out = np.empty_like(ones)
    _, copied_s = best_of(5, lambda: np.copyto(out, ones))
    assert 0.2 < bandwidth / (2.0 * ones.nbytes / copied_s) < 5.0


def test_launches_are_heard_only_while_one_listens() -> None:
    with device.default_device().timing() as outer:
        with device.default_device().timing() as inner:
            peak.measure_peak("single", 0.001)
        heard = len(inner)
        peak.measure_peak("single", 0.001)
    assert {launch.kernel for launch in outer} == {"peak"}
    assert 0 < heard == len(inner) < len(outer)


def test_the_map_tells_a_good_table_from_a_bad_one() -> None:
    field, chosen = CASES["plain"]
    truth = MapTruth(field, chosen, 41)
    errors = []
    for rings, azimuths in ((16, 64), (80, 512)):
        made = setting.make(field, chosen, PolarLayout(rings=rings, azimuths=azimuths))
        errors.append(truth.error(made.table(power_spectrum(made, made.bake.stack(made.field)))).mean)
    assert errors[1] < 0.3
    assert errors[0] > 5.0 * errors[1]


def test_memory_is_that_of_a_process_of_its_own() -> None:
    """More than an interpreter with numpy, and not what this process holds."""
    held = np.ones(2**27)
    peak = memory.peak_bytes(*CASES["plain"], PolarLayout(rings=24, azimuths=96))
    assert 2**25 < peak < 2**30 <= held.nbytes


@pytest.mark.parametrize(
    ("peak_bytes", "verdict"), [(None, "not measured"), (3 * 2**30, "misses"), (3 * 2**30 - 1, "holds")]
)
def test_a_large_scan_has_a_bound(peak_bytes: int | None, verdict: str) -> None:
    check = checks.of_large_scan(peak_bytes)
    assert (check.id, check.verdict) == ("large_scan.speed.memory", verdict)


def test_a_run_that_fails_says_why(tmp_path: Path) -> None:
    failing = (sys.executable, "-c", "import sys; sys.exit('out of luck')")
    with pytest.raises(RunFailedError, match="out of luck"):
        warm_run(failing, tmp_path / "no.toml")


def test_a_new_machine_has_bounds() -> None:
    found = {check.id: check.verdict for check in checks.of_compiling(Compiling(3.0, 1.01, 20.0, 8.1))}
    assert found == {
        "new_machine.speed.first": "holds",
        "new_machine.speed.next": "misses",
        "new_machine.speed.first_bake": "holds",
        "new_machine.speed.second_bake": "misses",
    }
    failed = checks.of_compiling(None, "no compiler")
    assert {(check.verdict, check.remark) for check in failed} == {("not measured", "no compiler")}


def bake_cost(seconds: float, mib: int) -> BakeCost:
    """A process that starts for a second and spends as long in every stage."""
    costs = (StageCost(stage, seconds / 3.0, 2**30, mib * 2**20, 0) for stage in growth.STAGES)
    return BakeCost(1.0 + seconds, tuple(costs))


def sized(side: int, seconds: float, mib: int = 1) -> ScanCost:
    return ScanCost(side, side * growth.PITCH_UM, 16.25, 9, bake_cost(seconds, mib), None)


LIMITS = Machine("device", 2, 8, {}, single_flops=117e9, double_flops=58e9, bandwidth=1e10)


def verdicts(curve: GrowthCurve, limits: Machine = LIMITS) -> dict[str, str]:
    return {check.id.removeprefix("curve.speed."): check.verdict for check in checks.of_curve(curve, limits)}


def test_work_that_grows_as_samples_has_the_exponent_one() -> None:
    assert growth.growth(bake_cost(1.0, 1), 512, bake_cost(4.0, 1), 1024) == pytest.approx(1.0)
    assert growth.growth(bake_cost(1.0, 1), 512, bake_cost(16.0, 1), 1024) == pytest.approx(2.0)


def test_large_scans_have_bounds() -> None:
    good = [sized(2048, 2.5), sized(4096, 10.9, 1536), sized(8192, 38.9, 3072)]
    assert set(verdicts(GrowthCurve(good, [])).values()) == {"holds"}
    bad = [sized(2048, 2.0), sized(4096, 11.1, 1537), sized(8192, 39.1, 3073)]
    assert set(verdicts(GrowthCurve(bad, [])).values()) == {"misses"}
    missing = GrowthCurve(good[:1], [], "out of luck")
    assert set(verdicts(missing).values()) == {"not measured"}
    assert "out of luck" in {check.remark for check in checks.of_curve(missing, LIMITS)}


def test_a_slower_device_has_more_time_for_a_large_scan_and_a_faster_one_no_less() -> None:
    curve = GrowthCurve([sized(4096, 12.0)], [])
    for flops, verdict in ((100e9, "holds"), (117e9, "misses"), (480e9, "misses")):
        assert verdicts(curve, replace(LIMITS, single_flops=flops))["seconds_4096"] == verdict
    assert (
        verdicts(GrowthCurve([sized(4096, 10.0)], []), replace(LIMITS, single_flops=480e9))["seconds_4096"] == "holds"
    )


def test_reading_a_large_file_counts_instead_of_making_its_heights() -> None:
    large = sized(8192, 30.0, 2048)
    held = [verdicts(GrowthCurve([large], [reading(seconds)])) for seconds in (1.0, 18.9, 19.1)]
    assert [each["seconds_8192"] for each in held] == ["holds", "holds", "misses"]
    assert verdicts(GrowthCurve([large], [reading(1.0, child_mib=2049)]))["memory_8192"] == "misses"


def reading(seconds: float, child_mib: int = 0) -> Reading:
    cost = StageCost("surface", seconds, 2**30, 2**30, child_mib * 2**20)
    return Reading("npy", 8192, BakeCost(seconds + 1.0, (cost,)))


@pytest.mark.parametrize("kind", growth.FORMATS)
def test_a_file_is_read_in_a_process_of_its_own(kind: str) -> None:
    found = growth.read(kind, 128)
    assert [cost.stage for cost in found.cost.stages] == ["surface"]
    assert 0.0 < found.seconds < found.cost.seconds
    # an array is read without another process
    assert (found.cost.stages[0].children_bytes > 0) == (kind == "tif")
    assert 2**25 < found.peak_bytes < 2**30


def test_a_curve_ends_where_a_bake_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sizes below it are kept, with their growth; the faster of two bakes counts."""
    costs = [bake_cost(2.0, 1), bake_cost(1.0, 1), bake_cost(4.0, 1), bake_cost(5.0, 1)]

    def measured(_config: Config, until: str) -> BakeCost:
        assert until == "table"
        if not costs:
            raise RunFailedError("out of memory")
        return costs.pop(0)

    monkeypatch.setattr(growth.stage_costs, "measure", measured)
    found = growth.measure((512, 1024, 4096), 2, growth.FORMATS)
    assert [(size.side, size.cost.stages_s) for size in found.sizes] == [(512, 1.0), (1024, 4.0)]
    assert [size.growth for size in found.sizes] == [None, pytest.approx(1.0)]
    assert [size.windows for size in found.sizes] == [1, 1]
    assert found.fault == "out of memory"
