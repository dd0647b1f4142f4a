"""The acceptance criteria of the bench as checks; texts/criteria.toml has their words and bounds."""

from collections.abc import Iterator

from pipeline.evaluation.check import Check
from pipeline.evaluation.speed.growth import GrowthCurve
from pipeline.evaluation.speed.machine import Machine, share
from pipeline.evaluation.speed.paper import RESOLUTION, STEP_NM
from pipeline.evaluation.speed.processes import Compiling
from pipeline.evaluation.speed.suite import (
    EQUAL,
    MAIN,
    NUFFT,
    NUMPY_POLAR,
    PAPER,
    POLAR,
    TEXTURES,
    SurfaceSpeed,
    settings_of,
)
from pipeline.evaluation.texts import Texts

# as many as the paper's 501 x 501
_TEXELS = 252_000
# seconds of stack, power spectrum and table for an operation a second of the peak, by the floats of a register:
# 0.045 s at 480 GFLOP/s with AVX-512, 0.11 s at 117 with AVX2
_NARROW_FLOPS = 117e9
_WIDE, _WIDE_WORK, _NARROW_WORK = 16, 0.045 * 480e9, 0.11 * _NARROW_FLOPS
# seconds from scan to table by the side of the scan, on a device of this peak. A slower one has more time in
# proportion; a faster one has no less, because not all of it is arithmetic of the device
_CURVE_S = {4096: 12.0, 8192: 40.0}
# the growth of these sides is judged: before them, the start of a process and the certificate take most of the time
_GROWS_FROM, _GROWS_TO = 2048, 8192


def of_surface(found: SurfaceSpeed, machine: Machine) -> list[Check]:
    """Return the criteria of one surface: its errors, times beside other algorithms' for the same table, memory."""
    texts, made = Texts(__package__, "criteria", surface=found.name), []

    def check(key: str, value: float | None, remark: str, **bound: float) -> None:
        made.append(texts.check("{surface}.speed." + key, value, remark=remark, **bound))

    polar = min((p for p in found.points if p.method == POLAR and p.texels <= _TEXELS), key=lambda p: p.error.mean)
    grid = " x ".join(f"{polar.settings[axis]:g}" for axis in ("rings", "azimuths"))
    where = f"{grid} grid, {polar.texels} texels, map of {found.map_size}^2, maximum {polar.error.maximum:.2g}"
    check("mean_error", polar.error.mean, where)
    check("percentile_99", polar.error.percentile_99, where)
    paper = found.point(PAPER, resolution=RESOLUTION, step_nm=STEP_NM)
    remark = f"{paper.error.mean:.3g} / {paper.error.percentile_99:.3g}" if paper else ""
    check("paper_error", paper.error.mean / polar.error.mean if paper else None, remark)
    for count in (3, 2):
        stored = found.point(TEXTURES, **settings_of(EQUAL), textures=count)
        remark = f"99th percentile {stored.error.percentile_99:.3g}" if stored else ""
        check(f"textures_{count}", stored.error.mean if stored else None, remark)
        check(f"mirror_{count}", stored.mirror_error if stored else None, "")
    planned, flank = found.planned, found.planned.flank
    remark = f"{planned.texels} texels, mean {planned.map_error.mean:.2g}"
    check("largest_of_map", planned.map_error.maximum, remark)
    if flank is not None:
        at = flank.largest
        place = f"light at {at.light_deg:.0f} degrees, {at.lobe_widths:.1f} lobe widths away"
        remark = f"{flank.directions} directions; {place}"
        check("largest_of_flank", flank.colour.maximum, remark)

    total, second = found.stages.total, found.second_light_s
    work = _WIDE_WORK if machine.vector_width >= _WIDE else _NARROW_WORK
    stages = found.stages.stack, found.stages.power_spectrum, found.stages.table
    remark = " + ".join(f"{1e3 * seconds:.3g}" for seconds in stages) + " ms"
    check("stages", total, remark, bound=work / machine.single_flops)
    for key, method in (("finufft", NUFFT), ("plain_numpy", NUMPY_POLAR)):
        other = found.point(method, **settings_of(MAIN))
        remark = f"{other.seconds:.3g} s / {total:.3g} s" if other else ""
        check(key, other.seconds / total if other else None, remark)
    for reached in (share(timed, machine) for timed in found.timed):
        if reached.stage in ("power spectrum", "apply_operator"):
            remark = f"of {reached.bound}, {1e3 * reached.seconds:.3g} ms"
            check(reached.stage.replace(" ", "_"), reached.bound_share, remark)
    remark = "" if second is None else f"{second:.3g} s / {total:.3g} s"
    check("second_light", None if second is None else second / total, remark)
    whole = found.whole_run
    remark = found.whole_run_fault if whole is None else f"bound: 4 times its kernels + 2 s; {whole}"
    check("whole_run", None if whole is None else whole.seconds, remark, bound=4.0 * total + 2.0)
    check("memory", _gib(found.memory_bytes), "")
    return made


def of_large_scan(peak_bytes: int | None) -> Check:
    """Return the criterion of a scan of 4096 x 4096 samples."""
    return Texts(__package__, "criteria").check("large_scan.speed.memory", _gib(peak_bytes))


def of_curve(curve: GrowthCurve, machine: Machine) -> list[Check]:
    """Return the criteria of large scans: seconds and memory from scan to certified table, and their growth."""
    slower = max(1.0, _NARROW_FLOPS / machine.single_flops)
    made = [check for side, bound in _CURVE_S.items() for check in _of_side(curve, side, bound * slower)]
    small, large = curve.size(_GROWS_FROM), curve.size(_GROWS_TO)
    ratio = None
    if small is not None and large is not None:
        ratio = large.cost.stages_s / small.cost.stages_s * (_GROWS_FROM / _GROWS_TO) ** 2
    return [*made, Texts(__package__, "criteria").check("curve.speed.growth", ratio)]


def _of_side(curve: GrowthCurve, side: int, bound_s: float) -> Iterator[Check]:
    """The criteria of one size. Where files of it were read, the slowest to read counts instead of the recipe."""
    texts, size, seconds, peak, remark = Texts(__package__, "criteria"), curve.size(side), None, None, curve.fault
    if size is not None:
        cost, readings = size.cost, [reading for reading in curve.readings if reading.side == side]
        of_recipe = cost.stage("surface").seconds
        seconds = cost.seconds - of_recipe + max([of_recipe, *(reading.seconds for reading in readings)])
        peak = max([cost.peak_bytes, *(reading.peak_bytes for reading in readings)])
        remark = f"{size.windows} windows; " + " + ".join(f"{stage.seconds:.3g}" for stage in cost.stages) + " s"
        remark += "".join(f"; surface from .{reading.format} {reading.seconds:.3g} s" for reading in readings)
    yield texts.check(f"curve.speed.seconds_{side}", seconds, bound=bound_s, remark=remark)
    yield texts.check(f"curve.speed.memory_{side}", _gib(peak), remark=curve.fault if size is None else "")


def _gib(size_bytes: int | None) -> float | None:
    return None if size_bytes is None else size_bytes / 2.0**30


def of_compiling(costs: Compiling | None, fault: str = "") -> list[Check]:
    """Return the criteria of a new machine. fault: why there are no costs."""
    texts, remark = Texts(__package__, "criteria"), {"remark": fault} if fault else {}
    keys = ("first", "next", "first_bake", "second_bake")
    return [texts.check(f"new_machine.speed.{key}", getattr(costs, f"{key}_s", None), **remark) for key in keys]
