"""Memory and time: what work needs at its peak, what this machine has left, and the refusal of what exceeds it.

Each module that allocates states the arrays of its peak in a function next to its code. A stage adds them up to a
`Need`, which is compared with the limit before the stage begins.
"""

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import ResourceError

# bytes by the name of an array
Arrays = dict[str, int]

MIB = 2**20
# measured with Python 3.11 and PoCL 3.1 on two cores: what threads, heaps and libraries reserve of the address space
# without using it, which grows with the number of cores
_RESERVED_BYTES, _RESERVED_BYTES_A_CORE = 900 * MIB, 150 * MIB
# multiply-adds per second and core in single precision: a third of what the kernels reach with AVX2. Estimates are
# right within a factor of three for most stages, and of seven for the bundle
MULTIPLY_ADDS_PER_S = 8e9
# a bake of a snake takes seconds and one of a scan of 4096 x 4096 samples a minute: what takes longer than this has a
# unit wrong
LONGEST_S = 3600.0

_UNITS = {"": 1, "b": 1, "k": 2**10, "m": 2**20, "g": 2**30, "t": 2**40, "kb": 10**3, "mb": 10**6, "gb": 10**9}
_UNITS |= {"tb": 10**12, "kib": 2**10, "mib": 2**20, "gib": 2**30, "tib": 2**40}
# what a caller allows; None for all that the machine has left
_allowed: ContextVar[int | None] = ContextVar("allowed", default=None)


@dataclass(frozen=True)
class Need:
    """The resources of a step.

    arrays: bytes at its peak, by name. seconds: estimate of its time on this machine, s.
    buffer: bytes of the largest array that a device holds in one piece.
    """

    arrays: Mapping[str, int]
    seconds: float = 0.0
    buffer: int = 0

    @property
    def bytes(self) -> int:
        """Sum of all arrays."""
        return sum(self.arrays.values())


@dataclass(frozen=True)
class Limit:
    """The memory that this process may hold, bytes, and where this limit comes from, in words."""

    bytes: int
    source: str


def largest(*phases: Mapping[str, int]) -> Arrays:
    """Returns the arrays of the phase that needs most; arrays of different phases do not exist at the same time."""
    biggest: Mapping[str, int] = max(phases, key=lambda arrays: sum(arrays.values()))
    return dict(biggest)


def seconds(multiply_adds: float) -> float:
    """Estimates the time of work on all cores, s."""
    return multiply_adds / (MULTIPLY_ADDS_PER_S * (os.cpu_count() or 1))


def in_words(bytes_: float) -> str:
    """Writes a size as "3.2 GiB" or "480 MiB"."""
    return f"{bytes_ / 2**30:.1f} GiB" if bytes_ >= 1000 * MIB else f"{bytes_ / MIB:.0f} MiB"


def bytes_of(text: str) -> int:
    """Reads a size such as "4GiB", "500 MB" or "6g"; k, m, g and t alone are powers of 1024.

    Raises ValueError for other texts, and for 0.
    """
    found = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*([A-Za-z]*)\s*", text, re.ASCII)
    unit = None if found is None else _UNITS.get(found[2].lower())
    if found is None or unit is None or float(found[1]) * unit < 1:
        raise ValueError(f"expected a size like 4GiB or 800MiB, got {text!r}")
    return int(float(found[1]) * unit)


@contextmanager
def allowing(bytes_: int | None) -> Iterator[None]:
    """Limits the memory that this process is predicted to hold, while this lasts; None: all that the machine has."""
    token = _allowed.set(bytes_)
    try:
        yield
    finally:
        _allowed.reset(token)


def allowed() -> int | None:
    """Returns the memory that a caller of `allowing` allows, bytes; None for all that the machine has."""
    return _allowed.get()


def limit() -> Limit:
    """Returns the memory that this process may hold in all: what a caller allows, or what the machine has left."""
    stated = allowed()
    return available() if stated is None else Limit(stated, "--memory")


def available() -> Limit:
    """Finds the least of the machine's available memory, the control group's limit and the limit of `ulimit -v`.

    What this process holds already counts as available to it. Without these files (another system than Linux) there
    is no limit.
    """
    held, found = held_bytes(), [Limit(2**62, "this machine")]
    free = _field("/proc/meminfo", "MemAvailable")
    if free is not None:
        found.append(Limit(held + free, "the memory that this machine has left"))
    found += [Limit(held + free, "the memory that the control group has left") for free in left_in_groups()]
    found += _address_space()
    return min(found, key=lambda limit: limit.bytes)


def held_bytes() -> int:
    """Returns the memory that this process holds; 0 where the system does not say."""
    return _field("/proc/self/status", "VmRSS") or 0


def peak_bytes() -> int:
    """Returns the most memory that this process held since its start, or since `forget_peak`; 0 where unknown."""
    # the peak of getrusage starts with the parent's memory at exec
    return _field("/proc/self/status", "VmHWM") or 0


def forget_peak() -> None:
    """Starts the peak of `peak_bytes` anew, at what this process holds. Raises OSError where the system cannot."""
    # 5 resets the high-water mark (proc(5))
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def require(what: str, more_bytes: int, remedy: str) -> None:
    """Raises ResourceError where arrays of `more_bytes` in addition to what this process holds exceed the limit.

    what: the arrays, for the message. remedy: a sentence without its full stop.
    """
    most, need = limit(), held_bytes() + more_bytes
    if need > most.bytes:
        raise ResourceError(
            f"{what} need {in_words(more_bytes)}, {in_words(need)} with all that is held, more than the "
            f"{in_words(most.bytes)} of {most.source}; {remedy}"
        )


def _field(file: str, name: str) -> int | None:
    """Reads a line like `MemAvailable:  1234 kB`, in bytes; None where there is none."""
    try:
        text = Path(file).read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    found = re.search(rf"^{name}:\s+(\d+) kB$", text, re.MULTILINE)
    return None if found is None else 1024 * int(found[1])


def left_in_groups(root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")) -> list[int]:
    """Lists the bytes left in the process's control group and in all above it, of version 2 and of version 1.

    root: where control groups are mounted. own: the file that names those of the process.
    """
    try:
        entries = [line.split(":", 2) for line in own.read_text(encoding="utf-8").splitlines()]
    except OSError:
        return []
    left = []
    for _, controllers, path in (entry for entry in entries if len(entry) == 3):
        if controllers == "":
            top, names = root, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            top, names = root / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        group = top / path.lstrip("/")
        # within a container, the path may name groups that are not visible there
        for folder in (group, *group.parents):
            if folder.is_relative_to(top):
                left += _left_in(folder, *names)
    return left


def _left_in(group: Path, limit_name: str, usage_name: str, cache_name: str) -> list[int]:
    """Returns the bytes left in one control group, none where it has no limit; cached files can be dropped."""
    try:
        most, used = (int((group / name).read_text(encoding="ascii")) for name in (limit_name, usage_name))
        stat = (group / "memory.stat").read_text(encoding="ascii")
    except (OSError, ValueError):  # "max", or no such group
        return []
    cached = re.search(rf"^{cache_name} (\d+)$", stat, re.MULTILINE)
    return [max(0, most - used + (0 if cached is None else int(cached[1])))]


def _address_space() -> list[Limit]:
    """Returns the limit that `ulimit -v` leaves for memory in use."""
    try:
        import resource
    except ImportError:
        return []
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most == resource.RLIM_INFINITY:
        return []
    reserved = _RESERVED_BYTES + _RESERVED_BYTES_A_CORE * (os.cpu_count() or 1)
    return [Limit(max(0, most - reserved), "the address space (ulimit -v), less what libraries reserve")]
