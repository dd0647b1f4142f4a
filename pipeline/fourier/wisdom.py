"""FFTW's wisdom (the results of measured planning), stored in the user's cache folder.

A file belongs to one processor and to one version of pyFFTW and FFTW. Wisdom is in force only within `planning`, so
that plans which are not measured stay the same from run to run.
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

from pipeline.store import digest

# in double, single and long double precision
Wisdom = tuple[bytes, bytes, bytes]

# FFTW's wisdom is global in a process; _learned keeps it where no file can be written
_lock = threading.Lock()
_learned: list[Wisdom] = []


@contextmanager
def planning() -> Iterator[None]:
    """Puts stored wisdom into force for the plans that are made within, and stores what they add to it."""
    import pyfftw

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
    """Returns the file for this processor and these versions."""
    import pyfftw

    folder = Path(platformdirs.user_cache_dir("diffract-bake"))
    return folder / f"pyFFTW-{pyfftw.__version__}-{pyfftw.fftw_version}" / f"{digest.of_json(_processor())}.json"


@cache
def _processor() -> dict[str, str]:
    """Describes the model of the processor."""
    wanted = {"vendor_id", "cpu family", "model", "model name", "stepping", "cache size", "flags"}
    found = {"machine": platform.machine(), "processor": platform.processor()}
    try:
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n")[0]
    except OSError:
        return found
    lines = (line.partition(":") for line in first.splitlines())
    return found | {name.strip(): value.strip() for name, _, value in lines if name.strip() in wanted}


def _read() -> Wisdom | None:
    """Reads the stored wisdom; None where there is none, or where the file is damaged."""
    try:
        kept = json.loads(file().read_text(encoding="ascii"))
        double, single, longer = kept["wisdom"]
        if kept["sha256"] != digest.of_json([double, single, longer]):
            return None
        return double.encode("ascii"), single.encode("ascii"), longer.encode("ascii")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _write(found: Wisdom) -> None:
    """Stores the wisdom. Of two processes that do so at once the later wins, and some plans are measured again."""
    texts = [text.decode("ascii") for text in found]
    target = file()
    temporary = target.with_name(f"{target.stem}-{os.getpid()}.writing.json")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(json.dumps({"sha256": digest.of_json(texts), "wisdom": texts}), encoding="ascii")
        temporary.replace(target)
    except OSError:
        pass  # without a cache, the next process only has to measure again
