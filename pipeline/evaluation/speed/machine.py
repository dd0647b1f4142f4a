"""What the device can do at most, measured, and what share of it a stage reaches."""

from dataclasses import dataclass, replace
from typing import Literal

from kernels import device

Precision = Literal["single", "double"]


@dataclass(frozen=True)
class Machine:
    """The device, its FMA peaks in operations a second and its memory bandwidth in bytes a second."""

    device: str
    compute_units: int
    single_flops: float
    double_flops: float
    bandwidth: float

    def peak(self, precision: Precision) -> float:
        return self.single_flops if precision == "single" else self.double_flops


def measure() -> Machine:
    """Peaks and bandwidth of the default device, as they are now."""
    used = device.default_device()
    return Machine(
        used.name,
        used.compute_units,
        device.measure_peak("single"),
        device.measure_peak("double"),
        device.measure_bandwidth(),
    )


def best(first: Machine, second: Machine) -> Machine:
    """The better of two measurements: what else the machine did only takes."""
    return replace(
        first,
        single_flops=max(first.single_flops, second.single_flops),
        double_flops=max(first.double_flops, second.double_flops),
        bandwidth=max(first.bandwidth, second.bandwidth),
    )


@dataclass(frozen=True)
class Work:
    """What a stage needs: operations without padding, and bytes that must move at least once."""

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
class Share:
    """A stage's time, its shares of the device's peak and bandwidth, and of whichever of them bounds it."""

    stage: str
    precision: Precision
    seconds: float
    flops: float
    bytes: float
    peak_share: float
    bandwidth_share: float

    @property
    def bound(self) -> Literal["arithmetic", "bandwidth"]:
        return "arithmetic" if self.peak_share >= self.bandwidth_share else "bandwidth"

    @property
    def bound_share(self) -> float:
        """The least time that the device's limits allow, over the time taken."""
        return max(self.peak_share, self.bandwidth_share)


def share(timed: Timed, machine: Machine) -> Share:
    """How near a stage comes to what the machine allows."""
    work, seconds = timed.work, timed.seconds
    return Share(
        work.stage,
        work.precision,
        seconds,
        work.flops,
        work.bytes,
        work.flops / seconds / machine.peak(work.precision),
        work.bytes / seconds / machine.bandwidth,
    )
