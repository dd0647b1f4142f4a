"""Functions that all readers share: units, limits of the shape, names of channels, and errors."""

import re
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from pipeline.errors import BakeError, InputError

MIN_SAMPLES = 8
MAX_SAMPLES = 8192

# the remedy for files that are sound, but cannot be read here
EXPORT = "open it in the instrument's program or in Gwyddion and export the height channel as .gwy, .npy or text"

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
# the micro sign, the Greek letter mu, and "~", which Nanoscope writes for them
_AS_MICRO = str.maketrans({"\u00b5": "u", "\u03bc": "u", "~": "u"})

_MISSING_BYTES = re.compile(
    r"truncat|not large enough|too (?:short|small)|end[- ]of[- ]file|unexpected end|eof\b|buffer|reshape|incomplete|"
    r"not enough|corrupt|not a valid zip|fewer (?:bytes|items)|broken|requires? .*bytes|expected \d+ bytes|"
    r"could only read",
    re.IGNORECASE,
)

_HEIGHT_NAME = re.compile(
    r"height|topo|z[ _-]?(sensor|axis|scan|controller)|\bposition z|^z\b|elevation|höhe|hauteur", re.IGNORECASE
)
_RETURN_NAME = re.compile(r"retrace|backward|bwd|\breverse", re.IGNORECASE)
_SECOND_NAME = re.compile(r"interleave|\bnap|lift", re.IGNORECASE)
# heights by a sensor are truer than those by the voltage on a piezo, which creeps and bends
_SENSOR_NAME = re.compile(r"sens|measured|\bposition z", re.IGNORECASE)
_NO_HEIGHT_NAME = re.compile(
    r"deflection|amplitude|phase|error|friction|lateral|adhesion|dissipation|deformation|indentation|stiffness|"
    r"modulus|current|intensity|texture|potential|bias|voltage|lock-?in|frequency|drive|damping|\bdfl|\bmag\b",
    re.IGNORECASE,
)


def micrometres(unit: str) -> float | None:
    """Converts a unit to micrometres; None for anything but a unit of length ("V", "deg", "")."""
    return _MICROMETRES.get(unit.strip().strip("[]()").translate(_AS_MICRO).replace("\u212b", "Å"))


def one_line(text: str, limit: int = 200) -> str:
    """Removes line breaks from a text and shortens it to `limit` characters."""
    flat = " ".join(text.split())
    return flat if len(flat) <= limit else f"{flat[: limit - 3]}..."


def fault(file: str, expected: str, found: str, way_out: str) -> InputError:
    """Returns a reader's error: the file, what was expected, what was found, and the remedy."""
    return InputError(f"{file}: expected {expected}, found {found}; {way_out}")


@contextmanager
def third_party(file: str, expected: str, library: str) -> Iterator[None]:
    """Runs a library's code without its warnings, and turns any of its exceptions into an InputError of one line.

    On a damaged file, libraries raise whatever the damage leads to (struct.error, KeyError, ...): all exceptions are
    therefore caught, but a lack of memory, which `limited` explains.

    file: its name. expected: the format in words. library: the package's name.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (BakeError, MemoryError):
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
        raise fault(file, expected, f"content that {library} cannot read ({cause})", _way_out(error)) from None


@contextmanager
def replaced(owner: Any, name: str, value: object) -> Iterator[None]:
    """Gives an attribute of a library's module or class another value for a while."""
    former = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, former)


def _way_out(error: Exception) -> str:
    """Returns the remedy; a file is called damaged only where the error is one of missing bytes."""
    named_so = type(error).__name__ in ("CorruptFile", "BadZipFile", "IncompleteRead")
    if named_so or isinstance(error, EOFError | struct.error | zlib.error) or _MISSING_BYTES.search(str(error)):
        return "the file may be damaged or cut short: copy or export it again"
    return EXPORT


def library_version(library: str) -> str:
    """Returns the name of a library with its version."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"{library} {version(library)}"
    except PackageNotFoundError:
        return library


def check_shape(file: str, shape: Sequence[int]) -> None:
    """Requires a shape (ny, nx) with MIN_SAMPLES..MAX_SAMPLES along both axes; else raises InputError.

    Readers call `room.make_room`, which calls it, before they decode: a wrong size in a header allocates no memory.
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
    """Makes names unique, in order: the second "Height" becomes "Height #2"."""
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name} #{seen[name]}")
    return unique


def pick_channel(file: str, names: Sequence[str], wanted: str | None, *, sole: bool = False) -> int:
    """Chooses the channel to read: the one wanted, else heights by name.

    Of several channels that are named like heights, one by a sensor comes first, then one of the main scan, then a
    trace, then the first in the file. A channel that is named like another quantity is never taken unasked.

    file: its name, for messages. names: of the channels. wanted: one of them, or None. sole: whether the format has
        one channel of heights, whatever its name.
    Returns an index into `names`.
    Raises InputError where no channel fits, or more than one.
    """
    listed = ", ".join(repr(name) for name in names)
    if not names:
        raise fault(file, "a channel of heights", "none in a unit of length", "export the height channel")
    if wanted is not None:
        return _named(file, names, wanted)
    other = [_NO_HEIGHT_NAME.search(name) is not None for name in names]
    likely = [i for i, name in enumerate(names) if _HEIGHT_NAME.search(name) and not other[i]]
    if likely:
        return min(likely, key=lambda i: _rank(names[i]))
    if sole:
        return 0
    unnamed = [i for i in range(len(names)) if not other[i]]
    if len(unnamed) == 1 and len(names) == 1:
        return 0
    found = f"channels {listed}" if len(names) > 1 else f"only {listed}"
    raise fault(file, "one channel of heights", found, "choose by surface.channel if it holds heights")


def _rank(name: str) -> tuple[bool, bool, bool]:
    """Orders channels of heights: sensors first, then the main scan of each line, then its trace."""
    return _SENSOR_NAME.search(name) is None, _SECOND_NAME.search(name) is not None, _is_return(name)


def _is_return(name: str) -> bool:
    return _RETURN_NAME.search(name) is not None


def _named(file: str, names: Sequence[str], wanted: str) -> int:
    for exact in (True, False):
        for i, name in enumerate(names):
            if name == wanted or (not exact and name.casefold() == wanted.casefold()):
                return i
    listed = ", ".join(repr(name) for name in names)
    raise fault(
        file, f"a channel {wanted!r} of heights", f"only {listed}", "set surface.channel to one, or remove it"
    )
