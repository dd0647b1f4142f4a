"""Verify: is a bundle what it was when it was published, and does it hold what its manifest says?"""

from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from pipeline.bundle import checksums
from pipeline.bundle.checksums import SUMS
from pipeline.bundle.manifest import MANIFEST, Image, Manifest, PolarGridEntry
from pipeline.errors import DamagedError
from pipeline.report import images
from pipeline.store import digest

if TYPE_CHECKING:
    from pipeline.bundle.evaluator import BundleTables


def open_bundle(folder: Path) -> "BundleTables":
    """Read a bundle into memory. Raises DamagedError if it has faults.

    The code that runs is this project's evaluator, never the bundle's copy.
    """
    from pipeline.bundle.evaluator import BundleTables

    faults = verify(folder)
    if faults:
        raise DamagedError(f"{folder}: {summary(faults)}. Fetch the bundle again, or publish it again")
    return BundleTables(folder)


def verify(folder: Path) -> list[str]:
    """One line for every fault of a bundle; none where it is whole. Reads nothing outside the folder."""
    if not folder.is_dir():
        return [f"{folder}: no such folder"]
    found, faults = _files(folder)
    if SUMS not in found:
        return [*faults, f"{SUMS} is missing: nothing can be checked"]
    try:
        sums, odd = checksums.parse((folder / SUMS).read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        return [*faults, f"{SUMS} is not UTF-8 text"]
    changed = [name for name in sums if name in found and digest.of_file(folder / name) != sums[name]]
    faults += odd
    faults += [f"{name} is missing" for name in sums if name not in found]
    faults += [f"{name} was added" for name in sorted(found - sums.keys() - {SUMS})]
    faults += [f"{name} was changed" for name in changed]
    unharmed = (found & sums.keys()) - set(changed)
    return faults + _name_faults(folder) + _manifest_faults(folder, unharmed)


def summary(faults: list[str]) -> str:
    """The first faults in one line."""
    return "; ".join(faults[:3]) + (f" and {len(faults) - 3} more" if len(faults) > 3 else "")


def _files(folder: Path) -> tuple[set[str], list[str]]:
    """The plain files of a bundle, and a line for everything else: a link could lead outside."""
    found, faults = set(), []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            faults.append(f"{name} is not a plain file")
        elif path.is_file():
            found.add(name)
    return found, faults


def _name_faults(folder: Path) -> list[str]:
    # a link "latest" to a bundle is fine, so the name is that of the folder itself
    name, _, shown = folder.resolve().name.rpartition("+")
    expected = checksums.of_sums(folder)
    if name and shown == expected:
        return []
    return [f"the folder is named {folder.resolve().name}, but its content's digest is {expected} ({SUMS})"]


def _manifest_faults(folder: Path, unharmed: set[str]) -> list[str]:
    """Faults of manifest.json and of what it says about the images; only unharmed files are opened."""
    if MANIFEST not in unharmed:
        return []
    try:
        manifest = Manifest.model_validate_json((folder / MANIFEST).read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        return [f"{MANIFEST} is not UTF-8 text"]
    except ValidationError as error:
        return [f"{MANIFEST}: {'.'.join(str(key) for key in e['loc'])}: {e['msg']}" for e in error.errors()]
    faults = _consistency_faults(folder, manifest)
    for image in (*manifest.tables, *manifest.maps):
        faults += _image_faults(folder, image, unharmed)
    return faults


def _consistency_faults(folder: Path, manifest: Manifest) -> list[str]:
    """What the manifest says twice must agree."""
    faults = []
    called = f"{manifest.name}-{manifest.version}"
    if folder.resolve().name.rpartition("+")[0] != called:
        faults.append(f"{MANIFEST}: is of {called}, but the folder is named {folder.resolve().name}")
    if [table.index for table in manifest.tables] != list(range(len(manifest.tables))):
        faults.append(f"{MANIFEST}: tables: expected index = 0, 1, ... in order")
    if isinstance(manifest.grid, PolarGridEntry) and not _basis_fits(manifest.grid, len(manifest.tables)):
        faults.append(f"{MANIFEST}: grid: {len(manifest.tables)} tables do not hold what basis and w_terms ask for")
    for table in manifest.tables:
        if table.layout != manifest.grid.layout:
            faults.append(f"{MANIFEST}: {table.file} is not of the grid's layout")
        if (table.width, table.height) != (manifest.grid.width, manifest.grid.height):
            faults.append(f"{MANIFEST}: {table.file} is not of the grid's size")
        if table.pixel_type != manifest.precision or set(table.channels) != set(images.RGBA):
            faults.append(f"{MANIFEST}: {table.file} is not RGBA of precision {manifest.precision}")
    return faults


def _basis_fits(grid: PolarGridEntry, images: int) -> bool:
    """Whether the basis is (outputs, 3, w_terms) for the outputs that the images hold."""
    if grid.basis is None:
        return 4 * images == 3 * grid.w_terms
    shapes = {(len(output), *(len(channel) for channel in output)) for output in grid.basis}
    return len(grid.basis) == 4 * images and shapes == {(3, *3 * (grid.w_terms,))}


def _image_faults(folder: Path, image: Image, unharmed: set[str]) -> list[str]:
    """Where an EXR is not what the manifest says; one that is missing or changed was told before."""
    if image.file not in unharmed:
        return [] if (folder / image.file).exists() else [f"{MANIFEST}: names {image.file}, which is missing"]
    try:
        found = images.describe(folder / image.file)
    except RuntimeError:
        return [f"{image.file} cannot be read as EXR"]
    expected = {key: getattr(image, key) for key in found}
    return [
        f"{image.file}: {key} is {found[key]}, but {MANIFEST} says {expected[key]}"
        for key in found
        if found[key] != expected[key]
    ]
