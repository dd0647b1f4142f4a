"""What all readers share: units, limits of the grid, names of channels, and how a fault is told."""

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version

from pipeline.errors import InputError

MIN_SAMPLES = 8
MAX_SAMPLES = 8192

_MICROMETRES = {
    "m": 1e6,
    "cm": 1e4,
    "mm": 1e3,
    "um": 1.0,
    "nm": 1e-3,
    "Å": 1e-4,
    "pm": 1e-6,
    "fm": 1e-9,
}
# the micro sign, the Greek letter, and what Nanoscope writes for either
_AS_MICRO = str.maketrans({"\u00b5": "u", "\u03bc": "u", "~": "u"})

_HEIGHT_NAME = re.compile(r"height|topo|z[ _-]?(sensor|axis|scan)|^z\b", re.IGNORECASE)
_RETURN_NAME = re.compile(r"retrace|backward|bwd", re.IGNORECASE)


def micrometres(unit: str) -> float | None:
    """Micrometres per `unit`; None where it is no unit of length ("V", "deg", "")."""
    return _MICROMETRES.get(unit.strip().strip("[]()").translate(_AS_MICRO).replace("\u212b", "Å"))


def one_line(text: str, limit: int = 200) -> str:
    """The text without line breaks, cut to `limit` characters."""
    flat = " ".join(text.split())
    return flat if len(flat) <= limit else f"{flat[: limit - 3]}..."


def fault(file: str, expected: str, found: str, way_out: str) -> InputError:
    """The one shape of a reader's error: file, what was expected, what was found, the way out."""
    return InputError(f"{file}: expected {expected}, found {found}; {way_out}")


@contextmanager
def third_party(file: str, expected: str, library: str) -> Iterator[None]:
    """Runs foreign code: no warning leaves it, and any exception becomes a InputError of one line.

    `expected` is the format in words. Readers of instrument formats raise whatever a damaged byte leads
    to (struct.error, KeyError, MemoryError, ...), hence the bare Exception.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except ImportError as error:
        missing = error.name or library
        raise fault(
            file,
            f"the Python package {library}, which reads {expected}",
            f"that {missing!r} is not installed",
            "install it with: pip install 'diffract-bake[readers]'",
        ) from None
    except Exception as error:
        cause = one_line(str(error)) or type(error).__name__
        raise fault(
            file,
            expected,
            f"what {library} cannot read ({cause})",
            "the file may be damaged or cut short: copy or export it again",
        ) from None


def library_version(library: str) -> str:
    """`library` with its version, for the record of a scan."""
    try:
        return f"{library} {version(library)}"
    except PackageNotFoundError:
        return library


def check_shape(file: str, shape: Sequence[int]) -> None:
    """Raises InputError unless `shape` is (ny, nx) with MIN_SAMPLES..MAX_SAMPLES along both axes.

    Readers call it before they decode, so that a header's claim costs no memory.
    """
    in_words = " x ".join(str(n) for n in shape) or "one number"
    if len(shape) != 2:
        raise fault(file, "a 2-D height map", f"{len(shape)}-D data ({in_words})", "save one 2-D channel")
    if min(shape) < MIN_SAMPLES:
        raise fault(
            file,
            f"at least {MIN_SAMPLES} samples along each axis",
            f"{in_words} (rows x columns)",
            "take a larger scan",
        )
    if max(shape) > MAX_SAMPLES:
        raise fault(
            file,
            f"at most {MAX_SAMPLES} samples along each axis",
            f"{in_words} (rows x columns)",
            "crop or resample it",
        )


def unique_names(names: Sequence[str]) -> list[str]:
    """The names in order, the second "Height" as "Height #2", so that each can be asked for."""
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name} #{seen[name]}")
    return unique


def pick_channel(file: str, names: Sequence[str], wanted: str | None) -> int:
    """Index of the channel to read: the one wanted, else the first that a height is usually called.

    Traces (forward) come before retraces. Raises InputError where nothing or no single channel fits.
    """
    listed = ", ".join(repr(name) for name in names)
    if not names:
        raise fault(file, "a channel of heights", "none in a unit of length", "export the height channel")
    if wanted is not None:
        return _named(file, names, wanted)
    likely = [i for i, name in enumerate(names) if _HEIGHT_NAME.search(name)]
    forward = [i for i in likely if not _RETURN_NAME.search(names[i])]
    if forward or likely:
        return (forward or likely)[0]
    if len(names) > 1:
        raise fault(file, "one channel of heights", f"channels {listed}", "choose by surface.channel")
    return 0


def _named(file: str, names: Sequence[str], wanted: str) -> int:
    for exact in (True, False):
        for i, name in enumerate(names):
            if name == wanted or (not exact and name.casefold() == wanted.casefold()):
                return i
    listed = ", ".join(repr(name) for name in names)
    raise fault(
        file, f"a channel {wanted!r} of heights", f"only {listed}", "set surface.channel to one, or remove it"
    )
