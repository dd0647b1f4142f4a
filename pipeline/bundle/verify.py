"""Verification: a bundle's files are those that were published, and agree with its manifest."""

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

    Returns one line for each fault; an empty list where there is none.
    """
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
    intact = (found & sums.keys()) - set(changed)
    return faults + _name_faults(folder) + _manifest_faults(folder, intact)


def summary(faults: list[str]) -> str:
    """Joins the first three faults to one line."""
    return "; ".join(faults[:3]) + (f" and {len(faults) - 3} more" if len(faults) > 3 else "")


def _files(folder: Path) -> tuple[set[str], list[str]]:
    """Lists the plain files of a bundle, and a fault for everything else, since a link could lead outside."""
    found, faults = set(), []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            faults.append(f"{name} is not a plain file")
        elif path.is_file():
            found.add(name)
    return found, faults


def _name_faults(folder: Path) -> list[str]:
    # a link such as "latest" may lead to a bundle, so the name is that of the folder itself
    name, _, shown = folder.resolve().name.rpartition("+")
    expected = checksums.of_sums(folder)
    if name and shown == expected:
        return []
    return [f"the folder is named {folder.resolve().name}, but its content's digest is {expected} ({SUMS})"]


def _manifest_faults(folder: Path, intact: set[str]) -> list[str]:
    """Lists faults of manifest.json and of its statements about images; only intact files are opened."""
    if MANIFEST not in intact:
        return []
    try:
        manifest = Manifest.model_validate_json((folder / MANIFEST).read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        return [f"{MANIFEST} is not UTF-8 text"]
    except ValidationError as error:
        return [f"{MANIFEST}: {'.'.join(str(key) for key in e['loc'])}: {e['msg']}" for e in error.errors()]
    faults = _consistency_faults(folder, manifest)
    for image in (*manifest.tables, *manifest.maps):
        faults += _image_faults(folder, image, intact)
    return faults


def _consistency_faults(folder: Path, manifest: Manifest) -> list[str]:
    """Lists contradictions within the manifest, and between it and the folder's name."""
    faults = []
    called = f"{manifest.name}-{manifest.version}"
    if folder.resolve().name.rpartition("+")[0] != called:
        faults.append(f"{MANIFEST}: describes {called}, but the folder is named {folder.resolve().name}")
    if [table.index for table in manifest.tables] != list(range(len(manifest.tables))):
        faults.append(f"{MANIFEST}: tables: expected index = 0, 1, ... in order")
    if isinstance(manifest.grid, PolarGridEntry) and not _basis_fits(manifest.grid, len(manifest.tables)):
        faults.append(
            f"{MANIFEST}: grid: {len(manifest.tables)} tables do not hold the outputs that basis and w_terms need"
        )
    for table in manifest.tables:
        if table.layout != manifest.grid.layout:
            faults.append(f"{MANIFEST}: {table.file} is not of the grid's layout")
        if (table.width, table.height) != (manifest.grid.width, manifest.grid.height):
            faults.append(f"{MANIFEST}: {table.file} is not of the grid's size")
        if table.pixel_type != manifest.precision or set(table.channels) != set(images.RGBA):
            faults.append(f"{MANIFEST}: {table.file} is not RGBA of precision {manifest.precision}")
    return faults


def _basis_fits(grid: PolarGridEntry, images: int) -> bool:
    """Tells whether the basis is (outputs, 3, w_terms) for the outputs that the images hold."""
    if grid.basis is None:
        return 4 * images == 3 * grid.w_terms
    shapes = {(len(output), *(len(channel) for channel in output)) for output in grid.basis}
    return len(grid.basis) == 4 * images and shapes == {(3, *3 * (grid.w_terms,))}


def _image_faults(folder: Path, image: Image, intact: set[str]) -> list[str]:
    """Lists differences between an EXR and its entry in the manifest; changed files have a fault already."""
    if image.file not in intact:
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
