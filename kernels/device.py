"""OpenCL devices, programs and launches: the only place that imports pyopencl.

A device counts as working only when a kernel was built and run on it: drivers exist that list a device and
cannot compile for it. Contexts do not survive a fork, so they are made lazily, once per process.
"""

import os
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from kernels import source
from kernels.blocks import Blocks
from kernels.cache import kernel_cache
from kernels.memory import LINE, MemoryPool

DEVICE_VARIABLE = "DIFFRACT_BAKE_DEVICE"
_POCL = "Portable Computing Language"  # PoCL's name of its platform
_INSTALL = (
    "install a working OpenCL driver: on Debian or Ubuntu `apt-get install pocl-opencl-icd` as root, with conda "
    "`conda install -c conda-forge pocl`; then `diffract-bake doctor` shows what was found"
)

# PoCL compiles a kernel a second time for grids of as many work-items along an axis
_WIDE_GRID = 2**16 - 1

# -w: without AVX-512, PoCL's compiler warns of every vector argument that its ABI differs; errors still come through
_OPTIONS = ["-cl-mad-enable", "-w"]

# doubles, and the floats of a vector register that the compiler builds for: PoCL states the processor's own even
# where it builds for another one (POCL_LLVM_CPU_NAME)
_PROBE = """
#if defined(__AVX512F__)
#define WIDTH 16
#elif defined(__AVX__)
#define WIDTH 8
#elif defined(__SSE2__) || defined(__ARM_NEON)
#define WIDTH 4
#else
#define WIDTH 0
#endif
__kernel void probe(__global double *x) { x[get_global_id(0)] = 2.0 * get_global_id(0) + WIDTH; }
"""


class NoDeviceError(RuntimeError):
    """No OpenCL device can build and run a double-precision kernel; the message says what was tried."""


@dataclass(frozen=True)
class Probe:
    """One listed device and whether it works.

    vector_width: floats of a vector register that its compiler builds for. fault: empty where it works.
    context: the one that it was tried in, None where none could be made; PoCL loads its library of built-in functions
        anew for every context.
    """

    platform: str
    device: str
    driver: str
    compute_units: int
    memory_bytes: int
    vector_width: int
    fault: str
    context: Any


@cache
def _opencl() -> Any:
    """pyopencl, imported once its compilers' caches have a place."""
    # PoCL has a cache on disk, whose files are checked there alone; pyopencl's second one only adds files
    os.environ["POCL_CACHE_DIR"] = str(kernel_cache().folder)
    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")
    import pyopencl

    return pyopencl


def probe_devices() -> list[Probe]:
    """Every listed OpenCL device, each tried by building and running a kernel on it."""
    return [_probe(platform, device) for platform, device in _listed()]


def _listed() -> list[tuple[Any, Any]]:
    """Every OpenCL device with its platform, untried."""
    cl = _opencl()
    try:
        platforms = cl.get_platforms()
    except cl.Error:  # the loader's word for "no driver installed"
        return []
    return [(platform, device) for platform in platforms for device in platform.get_devices()]


def _built(context: Any, text: str, options: list[str]) -> Any:
    """The program of a source; the compiler's errors are raised, and its remarks are of no use to anybody."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _opencl().Program(context, text).build(options)


def _probe(platform: Any, device: Any) -> Probe:
    cl = _opencl()
    name, driver = device.name.strip(), f"{device.driver_version}, {device.version.strip()}"
    fault, out, context = "", np.zeros(4), None
    try:
        context = cl.Context([device])
        with kernel_cache().compiling(f"{driver} {name} {_PROBE}"):
            queue = cl.CommandQueue(context)
            buffer = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, out.nbytes)
            _built(context, _PROBE, _OPTIONS).probe(queue, (4,), None, buffer)
            cl.enqueue_copy(queue, out, buffer)
        if not np.array_equal(out - out[0], [0.0, 2.0, 4.0, 6.0]):
            fault = f"a test kernel gave {out.tolist()} instead of steps of 2"
    except cl.Error as error:
        fault = " ".join(str(error).split())[:200]
    width = int(out[0]) or device.native_vector_width_float
    units, memory = device.max_compute_units, device.global_mem_size
    return Probe(platform.name, name, driver, units, memory, width, fault, context)


@dataclass(frozen=True)
class Launch:
    """One kernel that ran, and how long it took from its launch to its end."""

    kernel: str
    seconds: float


@dataclass(frozen=True)
class Device:
    """The device in use, its context and its in-order queue, with what belongs to it.

    vector_width: floats of a vector register that its compiler builds for.
    largest_bytes: of one buffer. shares_memory: whether its memory is the process's.
    memory: of arrays that its kernels read and write. blocks: constants that its kernels are compiled with.
    """

    name: str
    driver: str
    compute_units: int
    vector_width: int
    largest_bytes: int
    shares_memory: bool
    context: Any
    queue: Any
    blocks: Blocks
    memory: MemoryPool = field(default_factory=MemoryPool)
    _timings: list[list[Launch]] = field(default_factory=list)

    @contextmanager
    def timing(self) -> Iterator[list[Launch]]:
        """Fill a list with every launch on this device while this lasts."""
        launches: list[Launch] = []
        self._timings.append(launches)
        try:
            yield launches
        finally:
            self._timings.pop()

    def run(self, kernel: Any, size: tuple[int, ...], arguments: tuple[Any, ...]) -> None:
        """Run one kernel over `size` work-items and wait for it."""
        started = time.perf_counter()
        kernel(self.queue, size, (1,) * len(size), *arguments)
        self.queue.finish()
        for launches in self._timings:
            launches.append(Launch(kernel.function_name, time.perf_counter() - started))


@cache
def default_device() -> Device:
    """The first working CPU device of PoCL, or the first of any kind whose name holds $DIFFRACT_BAKE_DEVICE.

    Raises NoDeviceError with what was tried and the remedy.
    """
    wanted, listed = os.environ.get(DEVICE_VARIABLE, ""), _listed()
    probes = [_probe(*pair) for pair in listed if _is_asked_for(*pair, wanted)]
    for probe in probes:
        if not probe.fault:
            queue = _opencl().CommandQueue(probe.context)
            shares = bool(queue.device.host_unified_memory)
            sizes = probe.compute_units, probe.vector_width, queue.device.max_mem_alloc_size
            blocks = Blocks(probe.vector_width)
            return Device(probe.device, probe.driver, *sizes, shares, probe.context, queue, blocks)
    tried = "; ".join(f"{probe.device}: {probe.fault}" for probe in probes)
    raise NoDeviceError(_why_none(wanted, [device.name.strip() for _, device in listed], tried))


def _is_asked_for(platform: Any, device: Any, wanted: str) -> bool:
    """Whether the variable's value names a device; without a value, whether it is a CPU under PoCL."""
    if wanted:
        return wanted.lower() in f"{platform.name} {device.name}".lower()
    return bool(platform.name == _POCL and device.type & _opencl().device_type.CPU)


def _why_none(wanted: str, names: list[str], tried: str) -> str:
    """The message of NoDeviceError: what was found, and what to do."""
    if not names:
        return f"no working OpenCL device: none is listed. To mend it, {_INSTALL}"
    listed = ", ".join(repr(name) for name in names)
    if wanted:
        found = f"the one named like {wanted!r} does not work: {tried}" if tried else f"none is named like {wanted!r}"
        return (
            f"no working OpenCL device: {DEVICE_VARIABLE} asks for {wanted!r}, and {found}. Set it to a part of one "
            f"of these names: {listed}; or unset it, and PoCL's CPU device is taken"
        )
    found = tried or f"PoCL lists no CPU; {listed} is taken only when {DEVICE_VARIABLE} names it"
    return f"no working OpenCL device: {found}. To mend it, {_INSTALL}"


def bound(count: int, least: int) -> int:
    """The least of `least`, 4 `least`, 16 `least` ... that is not below `count`.

    What a kernel keeps in arrays of its own must be bounded when it is compiled; few bounds mean few programs.
    """
    while least < count:
        least *= 4
    return least


def program(sources: tuple[str, ...], constants: Mapping[str, int | str]) -> "Program":
    """The built program of these sources and constants, one for the whole process."""
    return _programs(sources, tuple(sorted(constants.items())))


@cache
def _programs(sources: tuple[str, ...], constants: tuple[tuple[str, int | str], ...]) -> "Program":
    return Program(sources, dict(constants))


class Program:
    """OpenCL sources built with constants, their kernels ready to launch on the default device."""

    def __init__(self, sources: Sequence[str], constants: Mapping[str, int | str]) -> None:
        self.device = default_device()
        text = source.text(*sources)
        options = [*_OPTIONS, *(f"-D{key}={value}" for key, value in sorted(constants.items()))]
        self._identity = f"{self.device.driver} {self.device.name} {self.device.vector_width} {options} {text}"
        with kernel_cache().compiling(self._identity):
            self._program = _built(self.device.context, text, options)
        self._kernels: dict[tuple[str, bool], Any] = {}

    def launch(self, kernel: str, size: tuple[int, ...], *arguments: Any) -> None:
        """Run one kernel over `size` work-items and wait, so that buffers may go afterwards."""
        variant = kernel, max(size) < _WIDE_GRID
        if variant in self._kernels:
            self.device.run(self._kernels[variant], size, arguments)
            return
        self._kernels[variant] = _opencl().Kernel(self._program, kernel)
        # PoCL finishes compiling at the first launch
        with kernel_cache().compiling(f"{variant} {self._identity}"):
            self.device.run(self._kernels[variant], size, arguments)


def upload(array: np.ndarray) -> Any:
    """A read-only device buffer with the array's bytes; hold it until the kernel has run."""
    cl = _opencl()
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    return _buffer(flags, hostbuf=np.ascontiguousarray(array))


def result_buffer(nbytes: int) -> Any:
    """A device buffer for what kernels write; of whole large pages where the device shares this memory."""
    cl, used = _opencl(), default_device()
    if used.shares_memory:
        return shared(empty((nbytes,), np.uint8))
    return _buffer(cl.mem_flags.READ_WRITE, size=nbytes)


def download(buffer: Any, out: np.ndarray) -> np.ndarray:
    """Fills `out` from a device buffer and returns it."""
    _opencl().enqueue_copy(default_device().queue, out, buffer)
    return out


def empty(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """An array on the device's memory pool, which begins on a cache line."""
    return default_device().memory.empty(shape, dtype)


def shared(array: np.ndarray) -> Any:
    """A device buffer in the array's own memory where the device shares it; `settle` it before reading the array."""
    cl = _opencl()
    return _buffer(cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR, hostbuf=array)


def _buffer(flags: Any, **keys: Any) -> Any:
    """A device buffer. Raises MemoryError where the device has none to give, or not as much in one buffer."""
    cl, used = _opencl(), default_device()
    try:
        return cl.Buffer(used.context, flags, **keys)
    except cl.Error as error:
        nbytes = keys["hostbuf"].nbytes if "hostbuf" in keys else keys["size"]
        if isinstance(error, cl.MemoryError) or nbytes > used.largest_bytes:
            raise MemoryError(f"{used.name} cannot hold a buffer of {nbytes / 2**20:.0f} MiB") from None
        raise


def lent(array: np.ndarray) -> Any:
    """A device buffer to read from: the array's own memory if it is one block from a cache line on, else a copy."""
    return shared(array) if array.flags.c_contiguous and array.ctypes.data % LINE == 0 else upload(array)


def settle(buffer: Any, array: np.ndarray) -> np.ndarray:
    """Makes what kernels wrote into a shared buffer visible in its array, which it returns."""
    cl = _opencl()
    mapped, _ = cl.enqueue_map_buffer(
        default_device().queue, buffer, cl.map_flags.READ, 0, (array.nbytes,), np.uint8, is_blocking=True
    )
    mapped.base.release()
    return array
