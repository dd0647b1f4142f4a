"""The memory and time in which a scan is read: by the size of its file, and by the samples that its header states.

The bytes of a file bound what a reader may need only where nothing is compressed. Readers therefore state the samples
of a scan before they decode any: `make_room` refuses those for which the memory does not suffice, and lets the others
exceed what files of their size may take.
"""

import signal
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline import resources
from pipeline.surface.readers.common import check_shape

# processor time: the largest library is imported in 0.3 s, a small file is read in 0.1 s, a MB of text in 0.1 s
_SECONDS, _SECONDS_PER_BYTE = 3.0, 4e-7
# a sample is inflated in 20 ns
_SECONDS_PER_SAMPLE = 1e-7
# time on the clock beyond it, for a process that waits instead of computing, or shares its processor with many
_PATIENCE = 8.0
# memory: libraries take 0.1 GB; from a file of 16-bit codes a reader keeps up to three copies of a channel in double
# precision, and text takes ten times its size
_BYTES, _BYTES_PER_BYTE = 768 << 20, 16
# six copies of a channel in double precision: as many as the stage of the surface needs
_BYTES_PER_SAMPLE = 48


@dataclass(frozen=True)
class Limits:
    """What reading a file may take.

    processor_s, clock_s: seconds of a processor, and on the clock. memory_bytes: memory. most_bytes: memory where the
    header states many samples.
    """

    processor_s: float
    clock_s: float
    memory_bytes: int
    most_bytes: int


def limits(size: int) -> Limits:
    """Computes what reading a file of `size` bytes may take, of what this process may hold."""
    seconds = _SECONDS + _SECONDS_PER_BYTE * size
    most = max(_BYTES, resources.limit().bytes - resources.held_bytes())
    return Limits(seconds, _PATIENCE * seconds, min(_BYTES + _BYTES_PER_BYTE * size, most), most)


def set_limits(allowed: Limits) -> None:
    """Limits this process from now on; it ends by a signal where it takes longer."""
    import resource

    # the defaults of these signals end the process, whatever code is running
    signal.setitimer(signal.ITIMER_PROF, allowed.processor_s)
    signal.setitimer(signal.ITIMER_REAL, allowed.clock_s)
    resource.setrlimit(resource.RLIMIT_DATA, (allowed.memory_bytes, allowed.most_bytes))
    # nothing that is read needs a file of its own
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def memory_limit() -> int:
    """Returns the memory that this process may take now, bytes; negative for any."""
    import resource

    return resource.getrlimit(resource.RLIMIT_DATA)[0]


def make_room(file: str, shape: Sequence[int]) -> None:
    """Requires a shape (ny, nx) of a scan, and the memory to read it; lets this process take as much, and longer.

    file: its name.
    Raises InputError for a shape of no scan, ResourceError where the memory does not suffice.
    """
    check_shape(file, shape)
    ny, nx = shape
    needed = _BYTES_PER_SAMPLE * ny * nx
    resources.require(f"{file}: {nx} x {ny} samples", needed, "crop the scan, or export fewer samples")
    import resource

    usual, most = resource.getrlimit(resource.RLIMIT_DATA)
    left_s, _ = signal.getitimer(signal.ITIMER_PROF)
    # in a process without limits, none are set
    if usual == resource.RLIM_INFINITY or not left_s:
        return
    resource.setrlimit(resource.RLIMIT_DATA, (min(most, usual + needed), most))
    more_s = _SECONDS_PER_SAMPLE * ny * nx
    signal.setitimer(signal.ITIMER_PROF, left_s + more_s)
    signal.setitimer(signal.ITIMER_REAL, signal.getitimer(signal.ITIMER_REAL)[0] + _PATIENCE * more_s)
