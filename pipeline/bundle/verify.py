"""Verification: a bundle's files are those that were published, and agree with its manifest.

Nothing is opened but plain files within the folder, and nothing is read that is larger than a bundle's file can be.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.bundle import checksums, contents
from pipeline.bundle.checksums import SUMS
from pipeline.bundle.document import MANIFEST
from pipeline.bundle.manifest import Manifest
from pipeline.errors import DamagedError
from pipeline.report import exr
from pipeline.store import digest, files

if TYPE_CHECKING:
    from pipeline.bundle.evaluator import BundleTables

# the names that `publish` gives
_NAMED = re.compile(r"([A-Za-z0-9][A-Za-z0-9_.-]*)\+([0-9a-f]{12})")
# of a file that is no image of the manifest, and of all of these
_MOST_BYTES, _MOST_BYTES_OF_ALL = 2**26, 2**29
_BYTES_OF_A_TEXEL = 16


def open_bundle(folder: Path) -> "BundleTables":
    """Reads a bundle into memory. The code that runs is this project's evaluator, not the bundle's copy.

    folder: of the bundle.
    Raises DamagedError where the bundle has faults.
    """
    from pipeline.bundle.evaluator import BundleTables

    faults = verify(folder)
    if faults:
        raise DamagedError(f"{folder}: {summary(faults)}. Fetch the bundle again, or publish it again")
    return BundleTables(folder)


def verify(folder: Path) -> list[str]:
    """Verifies a bundle. Reads no file outside its folder.

    Returns one line for each fault; an empty list where there is none. A folder may have been renamed, see `renamed`.
    """
    if not folder.is_dir():
        return [f"{folder}: no such folder"]
    try:
        return _faults(folder)
    except OSError as error:
        return [f"{error.filename or folder} cannot be read: {error.strerror}"]


def renamed(folder: Path) -> str | None:
    """Returns the digest of a bundle without faults whose folder's name does not carry it; None where it does."""
    # a link such as "latest" may lead to a bundle, so the name is that of the folder itself
    return None if _NAMED.fullmatch(folder.resolve().name) else checksums.of_sums(folder)


def summary(faults: list[str]) -> str:
    """Joins the first three faults to one line."""
    return "; ".join(faults[:3]) + (f" and {len(faults) - 3} more" if len(faults) > 3 else "")


def _faults(folder: Path) -> list[str]:
    try:
        sums, odd = checksums.parse(checksums.read(folder))
    except DamagedError as error:
        return [str(error)]
    sizes, faults = files.listing(folder, [*sums, SUMS])
    faults += odd
    if MANIFEST not in sums:
        faults.append(f"{SUMS} does not name {MANIFEST}")
    faults += [f"{name} is missing" for name in sums if name not in sizes]
    faults += [f"{name} was added" for name in sizes if name not in sums and name != SUMS]
    manifest: Manifest | None = None
    of_manifest: list[str] = []
    listed = {name: size for name, size in sizes.items() if name in sums}
    if MANIFEST in listed and listed[MANIFEST] <= _MOST_BYTES and digest.of_file(folder / MANIFEST) == sums[MANIFEST]:
        manifest, of_manifest = contents.read(folder)
    too_large = _too_large(folder, manifest, listed)
    changed = [name for name in listed if name not in too_large and digest.of_file(folder / name) != sums[name]]
    faults += [f"{name} was changed" for name in changed]
    faults += [f"{name} has {listed[name]} bytes, which is not the size of a bundle's file" for name in too_large]
    faults += _name_faults(folder, manifest) + of_manifest
    if manifest is None:
        return faults
    return faults + contents.faults(folder, manifest, listed.keys() - set(changed) - too_large)


def _too_large(folder: Path, manifest: Manifest | None, sizes: Mapping[str, int]) -> set[str]:
    """Finds files that are larger than they can be in a bundle, which are not read."""
    entries = () if manifest is None else (*manifest.tables, *manifest.maps)
    most = {entry.file: entry.width * entry.height * _BYTES_OF_A_TEXEL + _MOST_BYTES for entry in entries}
    found = {name for name, size in sizes.items() if size > most.get(name, _MOST_BYTES)}
    others = [name for name in sizes if name not in most and name not in found]
    if sum(sizes[name] for name in others) > _MOST_BYTES_OF_ALL:
        found |= set(others)
    # a large file without the structure of an image is sparse, or no image
    large = {name for name in most.keys() & sizes.keys() if sizes[name] > _MOST_BYTES}
    return found | {name for name in large if not _is_image(folder / name)}


def _is_image(path: Path) -> bool:
    try:
        exr.structure(path)
    except DamagedError:
        return False
    return True


def _name_faults(folder: Path, manifest: Manifest | None) -> list[str]:
    """Compares the folder's name with content and manifest, unless it was renamed and carries no digest."""
    called = folder.resolve().name
    carried = _NAMED.fullmatch(called)
    if carried is None:
        return []
    faults, expected = [], checksums.of_sums(folder)
    if carried[2] != expected:
        faults.append(f"the folder is named {called}, but its content's digest is {expected} ({SUMS})")
    if manifest is not None and carried[1] != f"{manifest.name}-{manifest.version}":
        faults.append(f"{MANIFEST}: describes {manifest.name}-{manifest.version}, but the folder is named {called}")
    return faults
