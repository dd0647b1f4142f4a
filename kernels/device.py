"""OpenCL devices, programs and launches: the only place that imports pyopencl.

A device counts as working only when a kernel was built and run on it: drivers exist that list a device and
cannot compile for it. Contexts do not survive a fork, so they are made lazily, once per process.
"""

import hashlib
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np
import platformdirs
from filelock import FileLock

DEVICE_VARIABLE = "DIFFRACT_BAKE_DEVICE"
_LINE = 64  # bytes of a cache line, and of a vector
_MOST_SPARE_BYTES = 2**28
_POCL = "Portable Computing Language"  # PoCL's name of its platform
_INSTALL = (
    "install a working OpenCL driver: on Debian or Ubuntu `apt-get install pocl-opencl-icd` as root, with conda "
    "`conda install -c conda-forge pocl`; then `diffract-bake doctor` shows what was found"
)

# -w: without AVX-512, PoCL's compiler warns of every vector argument that its ABI differs; errors still come through
_OPTIONS = ["-cl-mad-enable", "-w"]

# of each of three arrays: more than last caches hold
_TRIAD_BYTES = 2**27

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
def cache_folder() -> Path:
    """Where compiled kernels are kept between processes; for this process alone where that cannot be written."""
    folder = Path(platformdirs.user_cache_dir("diffract-bake")) / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / "lock"):
            pass
    except OSError:
        return Path(tempfile.mkdtemp(prefix="diffract-bake-kernels-"))
    return folder


_listeners: list[Callable[[], None]] = []


@contextmanager
def announcing_compilation(announce: Callable[[], None]) -> Iterator[None]:
    """Calls `announce` before each program or kernel that this machine has not compiled yet, while it lasts."""
    _listeners.append(announce)
    try:
        yield
    finally:
        _listeners.remove(announce)


@contextmanager
def _compiling(identity: str) -> Iterator[None]:
    """Holds the kernel cache alone: PoCL's cache fails at random when processes fill it together.

    identity: of the program or kernel. A mark beside the cache remembers that it was compiled.
    """
    mark = cache_folder() / "compiled" / hashlib.sha256(identity.encode()).hexdigest()
    with FileLock(cache_folder() / "lock"):
        if mark.exists():
            yield
            return
        for announce in _listeners:
            announce()
        yield
        with suppress(OSError):  # without its mark, the next process announces it once more
            mark.parent.mkdir(exist_ok=True)
            mark.touch()


@cache
def _opencl() -> Any:
    """pyopencl, imported once its compilers' caches have a place."""
    os.environ.setdefault("POCL_CACHE_DIR", str(cache_folder()))
    # PoCL has its own cache on disk; pyopencl's second one only adds files
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


def _probe(platform: Any, device: Any) -> Probe:
    cl = _opencl()
    name, driver = device.name.strip(), f"{device.driver_version}, {device.version.strip()}"
    fault, out, context = "", np.zeros(4), None
    try:
        context = cl.Context([device])
        with _compiling(f"{driver} {name} {_PROBE}"):
            queue = cl.CommandQueue(context)
            buffer = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, out.nbytes)
            cl.Program(context, _PROBE).build(_OPTIONS).probe(queue, (4,), None, buffer)
            cl.enqueue_copy(queue, out, buffer)
        if not np.array_equal(out - out[0], [0.0, 2.0, 4.0, 6.0]):
            fault = f"a test kernel gave {out.tolist()} instead of steps of 2"
    except cl.Error as error:
        fault = " ".join(str(error).split())[:200]
    width = int(out[0]) or device.native_vector_width_float
    units, memory = device.max_compute_units, device.global_mem_size
    return Probe(platform.name, name, driver, units, memory, width, fault, context)


@dataclass(frozen=True)
class Device:
    """The device in use, its context and its in-order queue.

    vector_width: floats of a vector register that its compiler builds for.
    shares_memory: whether its memory is the process's.
    """

    name: str
    driver: str
    compute_units: int
    vector_width: int
    shares_memory: bool
    context: Any
    queue: Any


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
            width = probe.vector_width
            return Device(probe.device, probe.driver, probe.compute_units, width, shares, probe.context, queue)
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


@dataclass(frozen=True)
class Launch:
    """One kernel that ran, and how long it took from its launch to its end."""

    kernel: str
    seconds: float


_listening: list[list[Launch]] = []


@contextmanager
def timing() -> Iterator[list[Launch]]:
    """Fills a list with every launch of this process while it lasts."""
    launches: list[Launch] = []
    _listening.append(launches)
    try:
        yield launches
    finally:
        _listening.pop()


class Program:
    """OpenCL sources built with constants, their kernels ready to launch on the default device."""

    def __init__(self, sources: Sequence[str], constants: Mapping[str, int | str]) -> None:
        cl = _opencl()
        self.device = default_device()
        text = "\n".join(source(name) for name in sources)
        options = [*_OPTIONS, *(f"-D{key}={value}" for key, value in sorted(constants.items()))]
        self._identity = f"{self.device.driver} {self.device.name} {self.device.vector_width} {options} {text}"
        with _compiling(self._identity):
            self._program = cl.Program(self.device.context, text).build(options)
        self._kernels: dict[str, Any] = {}

    def launch(self, kernel: str, size: tuple[int, ...], *arguments: Any) -> None:
        """Runs one kernel over `size` work-items and waits, so that buffers may go afterwards."""
        if kernel not in self._kernels:
            self._kernels[kernel] = getattr(self._program, kernel)
            # PoCL finishes compiling at the first launch
            with _compiling(f"{kernel} {self._identity}"):
                self._enqueue(kernel, size, arguments)
            return
        self._enqueue(kernel, size, arguments)

    def _enqueue(self, kernel: str, size: tuple[int, ...], arguments: tuple[Any, ...]) -> None:
        started = time.perf_counter()
        self._kernels[kernel](self.device.queue, size, (1,) * len(size), *arguments)
        self.device.queue.finish()
        for launches in _listening:
            launches.append(Launch(kernel, time.perf_counter() - started))


def source(name: str) -> str:
    """The text of one kernel file."""
    return files("kernels").joinpath("opencl", name).read_text(encoding="utf-8")


def upload(array: np.ndarray) -> Any:
    """A read-only device buffer with the array's bytes; hold it until the kernel has run."""
    cl = _opencl()
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    return cl.Buffer(default_device().context, flags, hostbuf=np.ascontiguousarray(array))


def result_buffer(nbytes: int) -> Any:
    """A device buffer for what kernels write; of whole large pages where the device shares this memory."""
    cl, used = _opencl(), default_device()
    if used.shares_memory:
        return shared(empty((nbytes,), np.uint8))
    return cl.Buffer(used.context, cl.mem_flags.READ_WRITE, nbytes)


def download(buffer: Any, out: np.ndarray) -> np.ndarray:
    """Fills `out` from a device buffer and returns it."""
    _opencl().enqueue_copy(default_device().queue, out, buffer)
    return out


def empty(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """An array that begins on a cache line: elsewhere every vector that a kernel loads would touch two.

    Its memory may have served before: pages that were never touched cost a kernel as much as its work.
    """
    bytes_ = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
    raw = np.asarray(_Pages(bytes_ + _LINE))
    first = -raw.ctypes.data % _LINE
    array: np.ndarray = raw[first : first + bytes_].view(dtype).reshape(shape)
    return array


_spare: list[np.ndarray] = []
# collecting garbage may free pages while pages are being taken
_spare_lock = threading.RLock()


class _Pages:
    """Memory behind arrays, which outlives them: the next array takes it over."""

    def __init__(self, bytes_: int) -> None:
        with _spare_lock:
            fitting = (i for i, spare in enumerate(_spare) if bytes_ <= spare.nbytes <= 2 * bytes_)
            i = next(fitting, None)
            self._memory = np.empty(bytes_, np.uint8) if i is None else _spare.pop(i)
        self.__array_interface__ = {**self._memory.__array_interface__, "shape": (bytes_,)}

    def __del__(self) -> None:
        with _spare_lock:
            _spare.append(self._memory)
            while sum(spare.nbytes for spare in _spare) > _MOST_SPARE_BYTES:
                _spare.pop(0)


def shared(array: np.ndarray) -> Any:
    """A device buffer in the array's own memory where the device shares it; `settle` it before reading the array."""
    cl = _opencl()
    return cl.Buffer(default_device().context, cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR, hostbuf=array)


def lent(array: np.ndarray) -> Any:
    """A device buffer to read from: the array's own memory if it is one block from a cache line on, else a copy."""
    return shared(array) if array.flags.c_contiguous and array.ctypes.data % _LINE == 0 else upload(array)


def settle(buffer: Any, array: np.ndarray) -> np.ndarray:
    """Makes what kernels wrote into a shared buffer visible in its array, which it returns."""
    cl = _opencl()
    mapped, _ = cl.enqueue_map_buffer(
        default_device().queue, buffer, cl.map_flags.READ, 0, (array.nbytes,), np.uint8, is_blocking=True
    )
    mapped.base.release()
    return array


def measure_peak(precision: Literal["single", "double"], seconds: float = 0.5) -> float:
    """Operations a second of this device, by chains of fused multiply-adds on whole vectors of 64 bytes."""
    lanes, size = {"single": (16, 4), "double": (8, 8)}[precision]
    peak = program(("peak.cl",), {"LANES": lanes})
    items, steps = 64 * default_device().compute_units, 20_000
    buffer = result_buffer(size * items)
    return items * steps * 16.0 * lanes / _shortest(peak, "peak", (items,), (np.int32(steps), buffer), seconds)


def measure_bandwidth(seconds: float = 0.5) -> float:
    """Bytes a second between this device and its memory, by McCalpin's triad: two arrays read, one written."""
    vectors, nbytes = 256, _TRIAD_BYTES
    ones = np.ones(nbytes // 4, np.float32)
    a, b, out = upload(ones), upload(ones), result_buffer(nbytes)
    triad = program(("bandwidth.cl",), {"VECTORS": vectors})
    items = nbytes // (64 * vectors)
    return 3.0 * nbytes / _shortest(triad, "triad", (items,), (a, b, np.float32(3.0), out), seconds)


def _shortest(
    built: Program, kernel: str, size: tuple[int, ...], arguments: tuple[Any, ...], seconds: float
) -> float:
    """The shortest of all launches that fit into `seconds`, s."""
    # the first compiles, and touches every page
    built.launch(kernel, size, *arguments)
    best, until = float("inf"), time.perf_counter() + seconds
    while time.perf_counter() < until:
        with timing() as launches:
            built.launch(kernel, size, *arguments)
        best = min(best, launches[0].seconds)
    return best
