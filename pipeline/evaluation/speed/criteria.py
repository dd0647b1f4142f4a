"""What was promised, held against what was measured."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from pipeline.evaluation.speed.compiling import Compiling
from pipeline.evaluation.speed.machine import Machine, share
from pipeline.evaluation.speed.paper import RESOLUTION, STEP_NM
from pipeline.evaluation.speed.suite import (
    MAIN,
    NUFFT,
    NUMPY_POLAR,
    PAPER,
    POLAR,
    TEXTURES,
    SurfaceBench,
    settings_of,
)
from pipeline.evaluation.stability import judging

_GIB = 2.0**30
# mean error by number of textures
_TEXTURE_LIMITS = {3: 0.2, 2: 0.9}
# beside the paper's 501 x 501
_TEXELS = 252_000


@dataclass(frozen=True)
class Criterion:
    """One promise. measured: None where this run did not look; limit: None where the number is told alone.

    remark: what the number is made of.
    """

    surface: str
    number: str
    what: str
    measured: float | None
    sense: Literal["<=", ">=", "<"]
    limit: float | None
    unit: str
    remark: str = ""

    @property
    def verdict(self) -> str:
        if self.measured is None:
            return "not measured"
        if self.limit is None:
            return "told"
        held = {
            "<=": self.measured <= self.limit,
            ">=": self.measured >= self.limit,
            "<": self.measured < self.limit,
        }[self.sense]
        return "pass" if held else "MISS"


def of_surface(bench: SurfaceBench, machine: Machine, whole_run_s: float | None) -> list[Criterion]:
    """What holds a surface by surface; `whole_run_s` is a warm process from its start to the table."""
    return [*_errors(bench), *_times(bench), *_shares(bench, machine), _memory(bench), _whole_run(bench, whole_run_s)]


def of_large_scan(peak_bytes: int | None) -> Criterion:
    measured = None if peak_bytes is None else peak_bytes / _GIB
    return Criterion("4096^2", "4", "peak memory at 64 terms", measured, "<", 3.0, "GiB")


def of_compiling(costs: Compiling | None) -> list[Criterion]:
    """What a new machine waits for."""
    asked = (
        ("compiling for the first config", "first_s", 3.0, "s CPU", "run --until table, kernels cold less warm"),
        ("compiling for the next config", "next_s", 1.0, "s CPU", "other terms, nodes, terms in |w| and reach"),
        ("first bake, kernels cold", "first_bake_s", 20.0, "s", "configs/elaphe.toml, two lights, with its bundle"),
        ("second bake", "second_bake_s", 8.0, "s", "configs/xenopeltis.toml, two lights, with its bundle"),
    )
    return [
        Criterion("new machine", "7", what, getattr(costs, key, None), "<=", limit, unit, remark)
        for what, key, limit, unit, remark in asked
    ]


def of_series(found: judging.Criterion) -> list[Criterion]:
    """What the stress sweep says of the two series, of white noise 10 um and 2 um high."""
    limit, surface = judging.CHEBYSHEV_TOLERANCE, "tall noise"
    chebyshev, taylor = found.chebyshev_float32_at_10_um, found.taylor_float64_at_2_um
    return [
        Criterion(surface, "5", "Chebyshev float32 at 10 um", chebyshev, "<=", limit, "", "worst error"),
        Criterion(surface, "5", "Taylor float64 at 2 um", taylor, ">=", limit, "", "worst error: it has failed"),
    ]


def _errors(bench: SurfaceBench) -> Iterable[Criterion]:
    """The polar table's error, alone and beside that of the paper's layout at as many texels."""
    polar = min((p for p in bench.points if p.method == POLAR and p.texels <= _TEXELS), key=lambda p: p.error.mean)
    error = polar.error
    grid = " x ".join(f"{polar.settings[axis]:g}" for axis in ("rings", "azimuths"))
    where = f"{grid} texels, map of {bench.map_size}^2, maximum {error.maximum:.2g}"
    yield Criterion(bench.name, "1", "mean dE at 7500 RU", error.mean, "<=", 0.08, "", where)
    yield Criterion(bench.name, "1", "99th percentile", error.percentile_99, "<=", 0.5, "", where)
    paper = bench.point(PAPER, resolution=RESOLUTION, step_nm=STEP_NM)
    ratio = None if paper is None else paper.error.mean / error.mean
    remark = "" if paper is None else f"{paper.error.mean:.3g} / {paper.error.percentile_99:.3g}"
    yield Criterion(bench.name, "1", "below the paper's layout", ratio, ">=", 25.0, "x", remark)
    for count, limit in _TEXTURE_LIMITS.items():
        stored = bench.point(TEXTURES, **settings_of(MAIN), textures=count)
        mean = None if stored is None else stored.error.mean
        remark = "" if stored is None else f"99th percentile {stored.error.percentile_99:.3g}"
        yield Criterion(bench.name, "1", f"mean dE in {count} RGBA16F", mean, "<=", limit, "", remark)


def _times(bench: SurfaceBench) -> Iterable[Criterion]:
    """Stack, spectrum and table beside other ways to the same table, and a second light beside the first."""
    stages = bench.stages
    for what, method, least in (("faster than FINUFFT", NUFFT, 50.0), ("faster than numpy", NUMPY_POLAR, 500.0)):
        other = bench.point(method, **settings_of(MAIN))
        speed_up = None if other is None else other.seconds / stages.total
        remark = "" if other is None else f"{other.seconds:.3g} s / {stages.total:.3g} s"
        yield Criterion(bench.name, "2", what, speed_up, ">=", least, "x", remark)
    second = bench.second_light_s
    share = None if second is None else second / stages.total
    remark = "" if second is None else f"{second:.3g} s / {stages.total:.3g} s"
    yield Criterion(bench.name, "3", "a second illuminant's share", share, "<", 1 / 3, "", remark)


def _shares(bench: SurfaceBench, machine: Machine) -> Iterable[Criterion]:
    """What the two kernels reach of whichever limit of the device binds them."""
    for reached in (share(timed, machine) for timed in bench.timed):
        if reached.stage in ("power spectrum", "apply_operator"):
            remark = f"of {reached.bound}, {1e3 * reached.seconds:.3g} ms"
            what = f"{reached.stage}'s share of its bound"
            yield Criterion(bench.name, "2", what, reached.bound_share, ">=", 0.4, "", remark)


def _memory(bench: SurfaceBench) -> Criterion:
    measured = None if bench.memory_bytes is None else bench.memory_bytes / _GIB
    return Criterion(bench.name, "4", "peak memory", measured, "<", 1.0, "GiB")


def _whole_run(bench: SurfaceBench, seconds: float | None) -> Criterion:
    limit = 4.0 * bench.stages.total + 2.0
    return Criterion(
        bench.name, "6", "run --until table, warm", seconds, "<=", limit, "s", "4 times its kernels + 2 s"
    )
