"""manifest.json as a document that anyone may have written: its size, depth and numbers are bounded."""

import json
import math
from pathlib import Path
from typing import Any

from pipeline.errors import DamagedError
from pipeline.store import files

MANIFEST = "manifest.json"
_MOST_BYTES = 4 * 2**20
_MOST_DEPTH = 64


def read(folder: Path) -> dict[str, Any]:
    """Reads the manifest of a bundle's folder as JSON, without its schema.

    Raises DamagedError, which names the manifest and no folder, where it is no plain file, or no JSON object of
    finite numbers and whole characters within 4 MiB and 64 levels.
    """
    return _read(folder)[1]


def read_text(folder: Path) -> str:
    """Reads the text of the manifest of a bundle's folder. Raises DamagedError as `read` does."""
    return _read(folder)[0]


def _read(folder: Path) -> tuple[str, dict[str, Any]]:
    try:
        text = files.read_text(folder / MANIFEST, _MOST_BYTES)
        found = json.loads(text, parse_constant=_refuse, parse_float=_finite)
        _check_depth(found)
        # half of a surrogate pair cannot be printed
        json.dumps(found, ensure_ascii=False).encode()
    except UnicodeDecodeError:
        raise DamagedError(f"{MANIFEST} is not UTF-8 text") from None
    except OSError as error:
        raise DamagedError(f"{MANIFEST} cannot be read: {error.strerror}") from None
    except RecursionError:
        raise DamagedError(f"{MANIFEST} cannot be read: more than {_MOST_DEPTH} levels") from None
    except ValueError as error:
        raise DamagedError(f"{MANIFEST} cannot be read: {error}") from None
    if not isinstance(found, dict):
        raise DamagedError(f"{MANIFEST} is not a JSON object")
    return text, found


def _refuse(word: str) -> None:
    raise ValueError(f"expected numbers, got {word}")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"expected numbers that fit 64 bits, got {text[:40]}")
    return value


def _check_depth(value: Any) -> None:
    queue = [(value, 1)]
    while queue:
        part, depth = queue.pop()
        if depth > _MOST_DEPTH:
            raise ValueError(f"more than {_MOST_DEPTH} levels")
        if isinstance(part, dict | list):
            queue += [(item, depth + 1) for item in (part.values() if isinstance(part, dict) else part)]
