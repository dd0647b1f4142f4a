"""The acceptance criteria of the bench as checks; texts/criteria.toml has their words and bounds."""

from pipeline.evaluation.check import Check
from pipeline.evaluation.speed.machine import Machine, share
from pipeline.evaluation.speed.paper import RESOLUTION, STEP_NM
from pipeline.evaluation.speed.processes import Compiling
from pipeline.evaluation.speed.suite import (
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
_WIDE, _WIDE_WORK, _NARROW_WORK = 16, 0.045 * 480e9, 0.11 * 117e9


def of_surface(found: SurfaceSpeed, machine: Machine) -> list[Check]:
    """Return the criteria of one surface: its errors, times beside other algorithms' for the same table, memory."""
    texts, made = Texts(__package__, "criteria", surface=found.name), []

    def check(key: str, value: float | None, remark: str, **bound: float) -> None:
        made.append(texts.check("{surface}.speed." + key, value, remark=remark, **bound))

    polar = min((p for p in found.points if p.method == POLAR and p.texels <= _TEXELS), key=lambda p: p.error.mean)
    grid = " x ".join(f"{polar.settings[axis]:g}" for axis in ("rings", "azimuths"))
    where = f"{grid} texels, map of {found.map_size}^2, maximum {polar.error.maximum:.2g}"
    check("mean_error", polar.error.mean, where)
    check("percentile_99", polar.error.percentile_99, where)
    paper = found.point(PAPER, resolution=RESOLUTION, step_nm=STEP_NM)
    remark = f"{paper.error.mean:.3g} / {paper.error.percentile_99:.3g}" if paper else ""
    check("paper_error", paper.error.mean / polar.error.mean if paper else None, remark)
    for count in (3, 2):
        stored = found.point(TEXTURES, **settings_of(MAIN), textures=count)
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
    fault = found.whole_run_fault or "4 times its kernels + 2 s"
    check("whole_run", found.whole_run_s, fault, bound=4.0 * total + 2.0)
    check("memory", _gib(found.memory_bytes), "")
    return made


def of_large_scan(peak_bytes: int | None) -> Check:
    """Return the criterion of a scan of 4096 x 4096 samples."""
    return Texts(__package__, "criteria").check("large_scan.speed.memory", _gib(peak_bytes))


def _gib(size_bytes: int | None) -> float | None:
    return None if size_bytes is None else size_bytes / 2.0**30


def of_compiling(costs: Compiling | None, fault: str = "") -> list[Check]:
    """Return the criteria of a new machine. fault: why there are no costs."""
    texts, remark = Texts(__package__, "criteria"), {"remark": fault} if fault else {}
    keys = ("first", "next", "first_bake", "second_bake")
    return [texts.check(f"new_machine.speed.{key}", getattr(costs, f"{key}_s", None), **remark) for key in keys]
