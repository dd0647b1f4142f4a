"""OpenCL devices, programs and launches: the only place that imports pyopencl.

A device counts as working only when a kernel was built and run on it: drivers exist that list a device and
cannot compile for it. Contexts do not survive a fork, so they are made lazily, once per process.
"""

import os
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
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
REMEDY = (
    "install a working OpenCL driver: on Debian or Ubuntu `apt-get install pocl-opencl-icd` as root, with conda "
    "`conda install -c conda-forge pocl`; then `diffract-bake doctor` shows what was found"
)

# of each of three arrays: more than last caches hold
_TRIAD_BYTES = 2**27

_PROBE = "__kernel void probe(__global double *x) { x[get_global_id(0)] = 2.0 * get_global_id(0); }"


class NoDeviceError(RuntimeError):
    """No OpenCL device can build and run a double-precision kernel; the message says what was tried."""


@dataclass(frozen=True)
class Probe:
    """One listed device and whether it works; `fault` is empty where it does."""

    platform: str
    device: str
    driver: str
    compute_units: int
    memory_bytes: int
    fault: str
    handle: Any


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


@contextmanager
def _compiling() -> Iterator[None]:
    """Holds the kernel cache alone: PoCL's cache fails at random when processes fill it together."""
    with FileLock(cache_folder() / "lock"):
        yield


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
    cl = _opencl()
    try:
        platforms = cl.get_platforms()
    except cl.Error:  # the loader's word for "no driver installed"
        return []
    return [_probe(platform, device) for platform in platforms for device in platform.get_devices()]


def _probe(platform: Any, device: Any) -> Probe:
    cl = _opencl()
    fault = ""
    try:
        with _compiling():
            context = cl.Context([device])
            queue = cl.CommandQueue(context)
            out = np.zeros(4)
            buffer = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, out.nbytes)
            cl.Program(context, _PROBE).build().probe(queue, (4,), None, buffer)
            cl.enqueue_copy(queue, out, buffer)
        if not np.array_equal(out, [0.0, 2.0, 4.0, 6.0]):
            fault = f"a test kernel gave {out.tolist()} instead of [0, 2, 4, 6]"
    except cl.Error as error:
        fault = " ".join(str(error).split())[:200]
    driver = f"{device.driver_version}, {device.version.strip()}"
    name = device.name.strip()
    return Probe(platform.name, name, driver, device.max_compute_units, device.global_mem_size, fault, device)


@dataclass(frozen=True)
class Device:
    """The device in use, its context and its in-order queue. shares_memory: whether its memory is the process's."""

    name: str
    driver: str
    compute_units: int
    shares_memory: bool
    context: Any
    queue: Any


@cache
def default_device() -> Device:
    """The first working device, or the first whose name holds $DIFFRACT_BAKE_DEVICE.

    Raises NoDeviceError with what was tried and the remedy.
    """
    wanted = os.environ.get(DEVICE_VARIABLE, "")
    probes = probe_devices()
    for probe in probes:
        if not probe.fault and wanted.lower() in f"{probe.platform} {probe.device}".lower():
            context = _opencl().Context([probe.handle])
            queue = _opencl().CommandQueue(context)
            shares = bool(probe.handle.host_unified_memory)
            return Device(probe.device, probe.driver, probe.compute_units, shares, context, queue)
    tried = "; ".join(f"{p.device}: {p.fault or 'works, but not asked for'}" for p in probes) or "none is listed"
    asked = f" named like {wanted!r} (from {DEVICE_VARIABLE})" if wanted else ""
    raise NoDeviceError(f"no working OpenCL device{asked}: {tried}. To mend it, {REMEDY}")


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
        options = ["-cl-mad-enable", *(f"-D{key}={value}" for key, value in sorted(constants.items()))]
        with _compiling():
            self._program = cl.Program(self.device.context, text).build(options)
        self._kernels: dict[str, Any] = {}

    def launch(self, kernel: str, size: tuple[int, ...], *arguments: Any) -> None:
        """Runs one kernel over `size` work-items and waits, so that buffers may go afterwards."""
        if kernel not in self._kernels:
            self._kernels[kernel] = getattr(self._program, kernel)
            # PoCL finishes compiling at the first launch
            with _compiling():
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
    """A device buffer to read from: the array's own memory where that begins on a cache line, else a copy."""
    return shared(array) if array.ctypes.data % _LINE == 0 else upload(array)


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
