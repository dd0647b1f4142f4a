"""The limits of the device, measured, and the share of them that a stage reaches."""

from dataclasses import dataclass, replace
from typing import Literal

from kernels import device, peak

Precision = Literal["single", "double"]


@dataclass(frozen=True)
class Machine:
    """The device, its FMA peaks in operations a second and its memory bandwidth in bytes a second.

    vector_width: floats of a register. blocks: the kernels' constants chosen for it.
    """

    device: str
    compute_units: int
    vector_width: int
    blocks: dict[str, int]
    single_flops: float
    double_flops: float
    bandwidth: float


def measure() -> Machine:
    """Measure peaks and bandwidth of the default device."""
    used = device.default_device()
    peaks = peak.measure_peak("single"), peak.measure_peak("double")
    chosen = used.blocks.chosen()
    return Machine(used.name, used.compute_units, used.vector_width, chosen, *peaks, peak.measure_bandwidth())


def best(first: Machine, second: Machine) -> Machine:
    """Return the larger limits of two measurements: other processes only lower them."""
    limits = ("single_flops", "double_flops", "bandwidth")
    return replace(first, **{name: max(getattr(first, name), getattr(second, name)) for name in limits})


@dataclass(frozen=True)
class Work:
    """Operations of a stage without padding, and bytes that must move at least once."""

    stage: str
    precision: Precision
    flops: float
    bytes: float


@dataclass(frozen=True)
class Timed:
    """A stage's work and the seconds it took."""

    work: Work
    seconds: float


@dataclass(frozen=True)
class Share(Work):
    """A stage's work, its seconds, and its shares of the device's peak and bandwidth.

    bound: which of the two limits it more. bound_share: the least time that this limit allows, over the time taken.
    """

    seconds: float
    peak_share: float
    bandwidth_share: float
    bound: Literal["arithmetic", "bandwidth"]
    bound_share: float


def share(timed: Timed, machine: Machine) -> Share:
    """Return the shares of the machine's limits that a stage reaches."""
    work, seconds = timed.work, timed.seconds
    limit = machine.single_flops if work.precision == "single" else machine.double_flops
    peak, bandwidth = work.flops / seconds / limit, work.bytes / seconds / machine.bandwidth
    bound: Literal["arithmetic", "bandwidth"] = "arithmetic" if peak >= bandwidth else "bandwidth"
    return Share(
        **vars(work),
        seconds=seconds,
        peak_share=peak,
        bandwidth_share=bandwidth,
        bound=bound,
        bound_share=max(peak, bandwidth),
    )
