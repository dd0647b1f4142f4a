"""Reads a scan under limits of time and memory: in a process of its own, unless its structure bounds both.

No foreign parser is trusted to end or to be small. All formats are read in a child process, except .npy, .npz and
.gsf, whose headers say what follows and are checked before anything is allocated. The child is a new interpreter: a
copy of this process would inherit locks that its other threads hold. It answers by a line of JSON and the samples, so
that nothing is unpickled, and what libraries print ends in /dev/null.
"""

import json
import os
import signal
import stat
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipeline import resources
from pipeline.errors import InputError, ResourceError
from pipeline.surface.readers.common import check_shape, fault, one_line
from pipeline.surface.readers.room import Limits, limits, memory_limit, set_limits
from pipeline.surface.scan import Scan

# a scan of 8192 x 8192 samples with seven other channels of doubles; as text of x y z triples it has 3 GB
_MOST_BYTES = 5 << 30
# a file of this size or more, of which less than this share was written, is empty space
_SPARSE_BYTES, _SPARSE_SHARE = 64 << 20, 1 / 64
# exit code of a child that lacks the memory even for an answer
_NO_MEMORY = 9
# JSON with all that is known of a scan except its samples
_MOST_ANSWER = 4 << 20
# the first bytes of .npy, .gsf and zip, which may be an .npz
_ARRAYS = (b"\x93NUMPY", b"Gwyddion Simple Field 1.0\n", b"PK\x03\x04")
_ARRAY_KEYS = ("npy", "npz", "gsf")
_DAMAGED = "the file may be damaged: copy or export it again"
_CODE = "import sys; sys.path.append({root!r}); from pipeline.surface.readers.limited import main; main()"


def read_scan(path: Path, channel: str | None) -> Scan:
    """Reads one channel of a scan file, whose format is recognised by content.

    path: the file. channel: name of the channel; None takes the height channel.
    Returns the channel as stored.
    Raises InputError where the file cannot be opened, has an unknown format, is damaged, or lacks the channel, and
    where reading it takes more time or memory than a file of its size and the samples that it states may;
    ResourceError where its samples need more memory than there is.
    """
    size = require_file(path)
    if _is_array(path):
        from pipeline.surface.readers.reading import read

        # numbers beyond the range of floats are values like others, and are checked as such
        try:
            with np.errstate(all="ignore"):
                return read(path, channel)
        except MemoryError:
            allowed = limits(size)
            raise _too_large(path.name, allowed.memory_bytes, allowed) from None
    return _by_child(path, channel, limits(size))


def require_file(path: Path) -> int:
    """Requires a regular file of a sensible size; nothing else, such as a pipe, is opened.

    Returns its size in bytes.
    Raises InputError for anything else: a folder, a pipe, a device, a file that is empty, unreadable or too large.
    """
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            kinds = {stat.S_IFDIR: "a directory", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
            kind = kinds.get(stat.S_IFMT(found.st_mode), "a device")
            raise fault(path.name, "a scan file", kind, "check surface.path")
        with path.open("rb") as file:
            is_sparse = found.st_size >= _SPARSE_BYTES and _written(file, found.st_size) < _SPARSE_SHARE
    except OSError as error:
        reason = error.strerror or "an unreadable file"
        raise fault(path.name, "a readable scan file", reason, "check surface.path") from None
    if found.st_size == 0:
        raise fault(path.name, "a scan", "an empty file", "copy or export it again")
    if found.st_size > _MOST_BYTES:
        expected = f"a file of at most {_MOST_BYTES >> 30} GiB"
        raise fault(path.name, expected, f"{found.st_size / 2**30:.1f} GiB", "export the height channel alone")
    if is_sparse:
        raise fault(path.name, "a scan", "empty space (a sparse file)", "copy or export it again")
    return found.st_size


def _written(file: BinaryIO, size: int) -> float:
    """Returns the share of a file that was written, up to _SPARSE_SHARE; 1 where the system does not tell."""
    if not hasattr(os, "SEEK_DATA"):
        return 1.0
    written, place = 0, 0
    # there is an error where no data follow
    with suppress(OSError):
        while place < size and written < _SPARSE_SHARE * size:
            place = os.lseek(file.fileno(), place, os.SEEK_DATA)
            end = os.lseek(file.fileno(), place, os.SEEK_HOLE)
            written += end - place
            place = end
    return written / size


def _is_array(path: Path) -> bool:
    """Says whether a file's format is read in this process; of others only the first bytes are looked at."""
    with path.open("rb") as file:
        head = file.read(max(map(len, _ARRAYS)))
    if not head.startswith(_ARRAYS):
        return False
    from pipeline.surface.readers.sniff import sniff

    return sniff(path) in _ARRAY_KEYS


# --- in this process ---------------------------------------------------------------------------------


def _by_child(path: Path, channel: str | None, allowed: Limits) -> Scan:
    """Reads a scan in a child process. The child never outlives this call, whatever ends it."""
    request = json.dumps([os.fspath(path), channel, asdict(allowed), resources.allowed()])
    code = _CODE.format(root=str(Path(__file__).parents[3]))
    # -P: no module is imported from the current folder. A group of its own: a terminal's Ctrl-C reaches this process
    # alone, which then kills the child. One thread: others would take memory of their own
    child = subprocess.Popen(
        [sys.executable, "-P", "-c", code, request],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        process_group=0,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"},
    )
    assert child.stdout is not None
    try:
        scan = received(path.name, child.stdout, allowed)
        if scan is None:
            raise ended(path.name, child.wait(), allowed)
        return scan
    finally:
        child.kill()
        child.stdout.close()
        child.wait()


def received(file: str, answer: IO[bytes], allowed: Limits) -> Scan | None:
    """Takes a child's answer; None where it ended without one.

    file: name of the scan file, for messages. answer: what `answer` below writes. allowed: the limits of the child.
    Raises InputError or ResourceError where the child says that the file cannot be read.
    """
    line = answer.readline(_MOST_ANSWER)
    if len(line) == _MOST_ANSWER:
        raise fault(file, "a scan with a header of less than 4 MB", "a longer one", "export the height channel alone")
    if not line.endswith(b"\n"):
        return None
    found = json.loads(line)
    if "refused" in found:
        raise InputError(found["refused"])
    if "unfit" in found:
        raise ResourceError(found["unfit"])
    if "memory" in found:
        raise _too_large(file, found["memory"], allowed)
    if "failed" in found:
        raise fault(file, "a scan that can be read", one_line(f"one that ends in {found['failed']}"), _DAMAGED)
    ny, nx = shape = found.pop("shape")
    check_shape(file, shape)
    masked = found.pop("masked")
    heights = np.empty((ny, nx))
    mask = np.empty((ny, nx), dtype=np.bool_) if masked else None
    if not _filled(answer, heights) or (mask is not None and not _filled(answer, mask.view(np.uint8))):
        return None
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in found.items()}
    return Scan(heights=heights, mask=mask, **values)


def _filled(answer: IO[bytes], samples: NDArray[Any]) -> bool:
    """Reads an array's bytes from the answer; false where there are too few."""
    wanted, place = samples.data.cast("B"), 0
    while place < len(wanted):
        count = answer.readinto(wanted[place:])  # type: ignore[attr-defined]
        if not count:
            return False
        place += count
    return True


def ended(file: str, code: int, allowed: Limits) -> Exception:
    """Returns the error for a child that ended, by a signal or by itself, before it answered.

    file: name of the scan file. code: the exit code, negative for a signal. allowed: the limits of the child.
    """
    if code in (-signal.SIGPROF, -signal.SIGALRM):
        seconds = allowed.processor_s if code == -signal.SIGPROF else allowed.clock_s
        return fault(file, f"a scan that is read within {seconds:.3g} s", "one that takes longer", _DAMAGED)
    if code == _NO_MEMORY:
        return _too_large(file, allowed.memory_bytes, allowed)
    if code < 0:
        name = signal.Signals(-code).name if -code in signal.valid_signals() else f"signal {-code}"
        return fault(file, "a scan that can be read", f"one on which the reader crashed ({name})", _DAMAGED)
    return RuntimeError(f"the process that reads {file} ended with {code} and no answer")


def _too_large(file: str, memory_bytes: int, allowed: Limits) -> InputError | ResourceError:
    """Returns the error for a reader that asked for more than `memory_bytes`."""
    if memory_bytes >= allowed.most_bytes:
        most, source = resources.in_words(memory_bytes), resources.limit().source
        return ResourceError(f"{file}: needs more than {most} to be read, of {source}; crop the scan")
    expected = f"a scan that is read in {memory_bytes / 1e9:.2g} GB of memory, enough for what its header states"
    return fault(file, expected, "one that asks for more", _DAMAGED)


# --- in the child ------------------------------------------------------------------------------------


def main() -> None:
    """Reads the scan that the first argument names, and writes the answer to stdout: all that the child does."""
    path, channel, allowed, allowed_bytes = json.loads(sys.argv[1])
    with os.fdopen(os.dup(1), "wb") as stream:
        # lines that libraries print do not belong to the answer
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        _end_with_parent()
        from pipeline.surface.readers import spm

        spm.import_readers_alone()
        try:
            with resources.allowing(allowed_bytes):
                answer(stream, Path(path), channel, Limits(**allowed))
        except MemoryError:
            os._exit(_NO_MEMORY)
    os._exit(0)


def answer(stream: BinaryIO, path: Path, channel: str | None, allowed: Limits) -> None:
    """Reads a scan within limits that hold for this process from now on, and writes it, or why it is refused."""
    set_limits(allowed)
    try:
        from pipeline.surface.readers.reading import read

        with np.errstate(all="ignore"):
            scan = read(path, channel)
        check_shape(path.name, scan.heights.shape)
    except InputError as error:
        _write_line(stream, {"refused": str(error)})
    except ResourceError as error:
        _write_line(stream, {"unfit": str(error)})
    except MemoryError:
        _write_line(stream, {"memory": memory_limit()})
    # libraries raise what they like, SystemExit included
    except BaseException as error:
        _write_line(stream, {"failed": f"{type(error).__name__}: {error}"[:1000]})
    else:
        known = {field.name: getattr(scan, field.name) for field in fields(scan)}
        heights, mask = known.pop("heights"), known.pop("mask")
        _write_line(stream, {**known, "shape": heights.shape, "masked": mask is not None})
        stream.write(np.ascontiguousarray(heights, dtype=np.float64).data)
        if mask is not None:
            stream.write(np.ascontiguousarray(mask, dtype=np.bool_).view(np.uint8).data)
    stream.flush()


def _write_line(stream: BinaryIO, found: dict[str, Any]) -> None:
    stream.write(json.dumps(found, default=float).encode() + b"\n")


def _end_with_parent() -> None:
    """Asks Linux to end this process when its parent ends, even by SIGKILL; elsewhere the limits end it."""
    if sys.platform != "linux":
        return
    import ctypes

    set_death_signal = 1
    ctypes.CDLL(None).prctl(set_death_signal, signal.SIGKILL)
