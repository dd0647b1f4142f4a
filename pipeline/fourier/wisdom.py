"""FFTW's wisdom, which is what it learned by measuring plans, kept in the user's cache folder.

A file belongs to one processor and to one version of pyFFTW and of FFTW. Wisdom is in force only while plans are made
within `planning`; elsewhere there is none, so that plans which are not measured stay the same from run to run.
"""

import json
import os
import platform
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import platformdirs
import pyfftw

from pipeline.store import digest

# in double, single and long double precision
Wisdom = tuple[bytes, bytes, bytes]

# the planner's wisdom is the process's, and so is what was learned where no file could be written
_lock = threading.Lock()
_learned: list[Wisdom] = []


@contextmanager
def planning() -> Iterator[None]:
    """Plans made within use what any process has learned here before; what is new is kept."""
    with _lock:
        kept = _read()
        pyfftw.forget_wisdom()
        for known in (*_learned, *([kept] if kept else [])):
            # FFTW itself refuses the wisdom of another build
            pyfftw.import_wisdom(known)
        before = pyfftw.export_wisdom()
        try:
            yield
        finally:
            after = pyfftw.export_wisdom()
            pyfftw.forget_wisdom()
        if after != before:
            _learned[:] = [after]
            _write(after)


def file() -> Path:
    """Where the wisdom of this processor and of these versions is kept."""
    folder = Path(platformdirs.user_cache_dir("diffract-bake"))
    return folder / f"pyFFTW-{pyfftw.__version__}-{pyfftw.fftw_version}" / f"{digest.of_json(_processor())}.json"


@cache
def _processor() -> dict[str, str]:
    """What tells one kind of processor from another."""
    wanted = {"vendor_id", "cpu family", "model", "model name", "stepping", "cache size", "flags"}
    found = {"machine": platform.machine(), "processor": platform.processor()}
    try:
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n")[0]
    except OSError:
        return found
    lines = (line.partition(":") for line in first.splitlines())
    return found | {name.strip(): value.strip() for name, _, value in lines if name.strip() in wanted}


def _read() -> Wisdom | None:
    """The wisdom kept; None where there is none, or where it is not what was written."""
    try:
        kept = json.loads(file().read_text(encoding="ascii"))
        double, single, longer = kept["wisdom"]
        if kept["sha256"] != digest.of_json([double, single, longer]):
            return None
        return double.encode("ascii"), single.encode("ascii"), longer.encode("ascii")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _write(found: Wisdom) -> None:
    """Keeps the wisdom. Of two processes that learn at once the later one's file stays: a plan is measured again."""
    texts = [text.decode("ascii") for text in found]
    place = file()
    beside = place.with_name(f"{place.stem}-{os.getpid()}.writing.json")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(json.dumps({"sha256": digest.of_json(texts), "wisdom": texts}), encoding="ascii")
        beside.replace(place)
    except OSError:
        pass  # a cache that cannot be written only costs the next process its measurements
