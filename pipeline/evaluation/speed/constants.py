"""Gain of each compile-time constant of a polar table's kernels: their time with another value."""

from dataclasses import dataclass

from kernels.device import default_device
from pipeline.evaluation.speed import polar_bake
from pipeline.evaluation.speed.setting import Setting
from pipeline.progress import Progress, silent

# by the constant's name, the kernels that it is for
_KERNELS = {
    "K_PAIRS": ("along_x", "along_y"),
    "USUAL_TAPS": ("polar_power_spectrum",),
    "NODES": ("polar_power_spectrum",),
    "W_BLOCK": ("apply_operator",),
    "XYZ_VECTORS": ("apply_operator",),
}


@dataclass(frozen=True)
class Constant:
    """A constant's value, another value, and the seconds of its kernels with each."""

    name: str
    value: int
    seconds: float
    other_value: int
    other_s: float


def measure(setting: Setting, repeats: int, progress: Progress = silent) -> list[Constant]:
    """Time every constant with another value, both in turn, because a machine's pace changes.

    repeats: bakes for each value, of which the fastest launch of each kernel counts.
    """
    blocks, found = default_device().blocks, []
    for done, (name, kernels) in enumerate(_KERNELS.items(), 1):
        value, other = blocks.chosen(name)[name], blocks.others[name]
        with blocks.instead(**{name: other}):
            other_s = _seconds(setting, repeats, kernels)
        found.append(Constant(name, value, _seconds(setting, repeats, kernels), other, other_s))
        progress("constants", done / len(_KERNELS))
    return found


def _seconds(setting: Setting, repeats: int, kernels: tuple[str, ...]) -> float:
    """The fastest run of each kernel, added up."""
    best = polar_bake.bake(setting, repeats).kernel_s
    return sum(best[kernel] for kernel in kernels)
