"""SHA256SUMS, which `sha256sum -c` reads, and the digest of a bundle.

The digest is the SHA-256 of SHA256SUMS itself, so `sha256sum SHA256SUMS` prints the end of the folder's name first.
"""

import hashlib
import re
from pathlib import Path, PurePosixPath

from pipeline.errors import DamagedError
from pipeline.store import digest, files

SUMS = "SHA256SUMS"
_MOST_BYTES = 2**20
_SHOWN = 12
_LINE = re.compile(r"([0-9a-f]{64})  (.+)")


def write(folder: Path) -> str:
    """Writes SHA256SUMS of all files of a folder, sorted by name, and returns its digest, 12 hex digits."""
    found = digest.of_folder(folder)
    lines = [f"{found[name]['sha256']}  {name}\n" for name in sorted(found)]
    (folder / SUMS).write_text("".join(lines), encoding="utf-8", newline="\n")
    return of_sums(folder)


def of_sums(folder: Path) -> str:
    """Computes the digest of a bundle, the first 12 hex digits of the SHA-256 of SHA256SUMS."""
    return hashlib.sha256((folder / SUMS).read_bytes()).hexdigest()[:_SHOWN]


def read(folder: Path) -> str:
    """Reads the text of SHA256SUMS. Raises DamagedError, which names no folder, where it is not a bundle's."""
    try:
        return files.read_text(folder / SUMS, _MOST_BYTES)
    except FileNotFoundError:
        raise DamagedError(f"{SUMS} is missing: nothing can be checked") from None
    except UnicodeDecodeError:
        raise DamagedError(f"{SUMS} is not UTF-8 text") from None
    except OSError as error:
        raise DamagedError(f"{SUMS} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise DamagedError(f"{SUMS} cannot be read: {error}") from None


def parse(text: str) -> tuple[dict[str, str], list[str]]:
    """Parses SHA256SUMS.

    Returns the SHA-256 of each file by name, and a message for every line that is malformed or names a file outside.
    """
    sums: dict[str, str] = {}
    faults = []
    for number, line in enumerate(text.splitlines(), start=1):
        match = _LINE.fullmatch(line)
        if match is None:
            faults.append(f"{SUMS}: line {number} is not '<sha256>  <file>'")
        elif not _stays_inside(match[2]):
            faults.append(f"{SUMS}: line {number} names a file outside the bundle: {match[2]}")
        elif match[2] in sums:
            faults.append(f"{SUMS}: line {number} names {match[2]} again")
        else:
            sums[match[2]] = match[1]
    return sums, faults


def _stays_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts and "\\" not in name and str(path) == name
