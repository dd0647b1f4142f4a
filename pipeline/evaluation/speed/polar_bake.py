"""The polar table, stage by stage, warm; and the same table under a second light."""

from dataclasses import dataclass, replace

from kernels import device
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.evaluation.speed import work
from pipeline.evaluation.speed.machine import Timed
from pipeline.evaluation.speed.setting import Setting
from pipeline.evaluation.speed.timing import timed
from pipeline.tables.polar.table import PolarTable

_SECOND_ILLUMINANT = "A"


@dataclass(frozen=True)
class Stages:
    """Seconds of the stages of one bake."""

    stack: float
    power_spectrum: float
    table: float

    @property
    def total(self) -> float:
        return self.stack + self.power_spectrum + self.table


@dataclass(frozen=True)
class TimedBake:
    """A polar table with its stack and power spectrum, the times of the fastest bake, and every kernel's best.

    lights_s: wavelengths and tables of the same power spectrum under one illuminant, and under two in one pass; None
    for a laser line.
    kernel_s: by the kernel's name, its fastest run.
    """

    built: Stack
    made: PolarPowerSpectrum
    table: PolarTable
    stages: Stages
    lights_s: tuple[float, float] | None
    kernel_s: dict[str, float]

    @property
    def second_light_s(self) -> float | None:
        """Seconds that a second illuminant adds; None for a laser line."""
        return None if self.lights_s is None else self.lights_s[1] - self.lights_s[0]


def bake(setting: Setting, repeats: int) -> TimedBake:
    """Bake a table `repeats` times after one more that warms up."""
    _once(setting)
    with device.default_device().timing() as launches:
        runs = [_once(setting) for _ in range(repeats)]
    built, made, table, _ = runs[-1]
    best = min((stages for *_, stages in runs), key=lambda stages: stages.total)
    # launches ascend to the fastest, which replaces the others
    fastest = {launch.kernel: launch.seconds for launch in sorted(launches, key=lambda each: -each.seconds)}
    return TimedBake(built, made, table, best, _lights(setting, made, repeats), fastest)


def best(first: TimedBake, again: TimedBake) -> TimedBake:
    """Return the shorter times of two bakes of one setting: other processes come in bursts of seconds."""
    lights = [bake.lights_s for bake in (first, again) if bake.lights_s is not None]
    return replace(
        first,
        stages=min(first.stages, again.stages, key=lambda stages: stages.total),
        lights_s=(min(one for one, _ in lights), min(two for _, two in lights)) if lights else None,
        kernel_s={kernel: min(seconds, again.kernel_s[kernel]) for kernel, seconds in first.kernel_s.items()},
    )


def _once(setting: Setting) -> tuple[Stack, PolarPowerSpectrum, PolarTable, Stages]:
    built, stack_s = timed(lambda: setting.bake.stack(setting.field))
    made, power_spectrum_s = timed(lambda: setting.bake.power_spectrum(built, setting.plan.azimuths))
    table, table_s = timed(lambda: setting.table(made))
    return built, made, table, Stages(stack_s, power_spectrum_s, table_s)


def _lights(setting: Setting, made: PolarPowerSpectrum, repeats: int) -> tuple[float, float] | None:
    """The shortest times of one light's table and of two lights', in turn, because a machine's pace changes."""
    light = setting.bake.radiometry.light
    if light.is_line:
        return None
    one, two = [light], [light, light.model_copy(update={"illuminant": _SECOND_ILLUMINANT})]
    times = [
        (timed(lambda: setting.tables(made, one))[1], timed(lambda: setting.tables(made, two))[1])
        for _ in range(repeats)
    ]
    return min(first for first, _ in times), min(both for _, both in times)


def stages(setting: Setting, baked: TimedBake) -> list[Timed]:
    """Return the work of each stage and its seconds; of kernels, their best run."""
    seconds = baked.kernel_s
    spline_s = seconds["filter_azimuths"] + seconds["filter_rings"]
    return [
        Timed(work.stack(setting.field, baked.built), baked.stages.stack),
        Timed(work.power_spectrum(setting, baked.built, baked.made), seconds["polar_power_spectrum"]),
        Timed(work.build_operator(setting), seconds["build_operator"]),
        Timed(work.apply_operator(setting, baked.made, baked.table), seconds["apply_operator"]),
        Timed(work.splines(baked.table), spline_s),
    ]
