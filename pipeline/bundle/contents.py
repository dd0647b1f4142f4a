"""Verification of a bundle's content: the manifest fits its schema and itself, and describes the images."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

from pipeline.bundle import document
from pipeline.bundle.document import MANIFEST
from pipeline.bundle.layout import Image, Pixels, TexelCheck
from pipeline.bundle.manifest import Manifest, MapImage
from pipeline.errors import DamagedError
from pipeline.report import exr, images
from pipeline.report.exr import Structure
from pipeline.scene.model import Scene

# zlib shrinks zeros a thousandfold; tables and maps shrink to half, and further where a scene leaves texels out
_MOST_GROWTH, _GROWS_BELOW = 100, 2**27
_MOST_SCHEMA_FAULTS = 20


def read(folder: Path) -> tuple[Manifest | None, list[str]]:
    """Reads the manifest of a bundle's folder. Returns it, None where it has faults, and the faults."""
    try:
        return Manifest.model_validate_json(document.read_text(folder)), []
    except DamagedError as error:
        return None, [str(error)]
    except ValidationError as error:
        # pydantic copies the offending values into its errors unless asked not to
        found = error.errors(include_url=False, include_input=False, include_context=False)
        faults = [f"{MANIFEST}: {'.'.join(str(key) for key in e['loc'])}: {e['msg']}" for e in found]
        if len(faults) > _MOST_SCHEMA_FAULTS:
            faults[_MOST_SCHEMA_FAULTS:] = [f"{MANIFEST}: {len(faults) - _MOST_SCHEMA_FAULTS} more faults"]
        return None, faults


def faults(folder: Path, manifest: Manifest, intact: Collection[str]) -> list[str]:
    """Lists contradictions within a manifest, and between it and the files that it names.

    intact: names of the files whose digests are right. No other is opened.
    """
    found = [*_contradictions(manifest), *_missing(manifest, folder)]
    entries = [entry for entry in (*manifest.tables, *manifest.maps) if entry.file in intact]
    structures: dict[str, Structure] = {}
    for entry in entries:
        try:
            structures[entry.file] = exr.structure(folder / entry.file)
        except DamagedError as error:
            found.append(f"{entry.file} {error}")
            continue
        found += _differences(entry, structures[entry.file])
    found += _growth_faults(list(structures.values()))
    for entry in manifest.maps:
        found += _png_faults(folder / entry.png, entry) if entry.png in intact else []
    # only images that are as large as stated are decoded
    return found or _pixel_faults(folder, manifest, structures)


def _contradictions(manifest: Manifest) -> list[str]:
    """Lists contradictions within the manifest."""
    found = []
    if [table.index for table in manifest.tables] != list(range(len(manifest.tables))):
        found.append(f"{MANIFEST}: tables: expected index = 0, 1, ... in order")
    names = [entry.file for entry in (*manifest.tables, *manifest.maps)]
    if len(set(names)) < len(names):
        found.append(f"{MANIFEST}: an image is named twice")
    for table in manifest.tables:
        if table.layout != manifest.grid.layout:
            found.append(f"{MANIFEST}: {table.file} is not of the grid's layout")
        if (table.width, table.height) != (manifest.grid.width, manifest.grid.height):
            found.append(f"{MANIFEST}: {table.file} is not of the grid's size")
        if table.pixel_type != manifest.precision or set(table.channels) != set(images.RGBA):
            found.append(f"{MANIFEST}: {table.file} is not RGBA of precision {manifest.precision}")
    return found + _grid_faults(manifest)


def _scene(manifest: Manifest) -> Scene | None:
    """Returns the scene of the config in the manifest. Raises ValidationError where it is none."""
    found: Scene | None = TypeAdapter(Scene | None).validate_python(manifest.provenance.config.get("scene"))
    return found


def _grid_faults(manifest: Manifest) -> list[str]:
    """Lists contradictions between the grid, the number of tables and the scene."""
    try:
        scene = _scene(manifest)
    except ValidationError:
        return [f"{MANIFEST}: provenance.config.scene is not the [scene] of a config"]
    return [f"{MANIFEST}: {fault}" for fault in manifest.grid.contradictions(len(manifest.tables), scene)]


def _missing(manifest: Manifest, folder: Path) -> list[str]:
    """Lists files that the manifest names and the folder lacks."""
    table = manifest.material.reflectance_table
    named = [entry.file for entry in (*manifest.tables, *manifest.maps)]
    named += [entry.png for entry in manifest.maps]
    named += [] if manifest.report is None else [manifest.report]
    named += [] if table is None else [table.file]
    return [f"{MANIFEST}: names {name}, which is missing" for name in named if not (folder / name).exists()]


def _differences(entry: Image, found: Structure) -> list[str]:
    """Lists differences between an EXR and its entry in the manifest."""
    pairs = {
        "width": (found.width, entry.width),
        "height": (found.height, entry.height),
        "channels": (list(found.channels), sorted(entry.channels)),
        "pixel_type": (found.pixel_type, entry.pixel_type),
    }
    return [
        f"{entry.file}: {key} is {value}, but {MANIFEST} says {stated}"
        for key, (value, stated) in pairs.items()
        if value != stated
    ]


def _growth_faults(found: list[Structure]) -> list[str]:
    """Refuses images that take far more memory than their files: they would not be a table's or a map's."""
    decoded, stored = sum(s.pixel_bytes for s in found), sum(s.file_bytes for s in found)
    if decoded <= max(_GROWS_BELOW, _MOST_GROWTH * stored):
        return []
    return [
        f"{stored} bytes of images would take {decoded} in memory, over {_MOST_GROWTH} times as much: not decoded"
    ]


def _png_faults(path: Path, entry: MapImage) -> list[str]:
    """Compares the size in the header of a map's picture with the manifest."""
    with path.open("rb") as stream:
        header = stream.read(24)
    size = entry.width.to_bytes(4, "big") + entry.height.to_bytes(4, "big")
    expected = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + size
    return [] if header == expected else [f"{entry.png} is no PNG of {entry.width} x {entry.height} pixels"]


def _pixel_faults(folder: Path, manifest: Manifest, structures: Collection[str]) -> list[str]:
    """Decodes all images, one by one, and lists tables whose texels are impossible."""
    tables = {table.file for table in manifest.tables}
    check = manifest.grid.texel_check(_scene(manifest))
    found = []
    for name in structures:
        try:
            channels = images.decode(folder / name)
        except DamagedError as error:
            found.append(f"{name} {error}")
            continue
        if name in tables:
            found += [f"{name}: {fault}" for fault in _texel_faults(channels, check)]
    return found


def _texel_faults(channels: dict[str, Pixels], check: TexelCheck) -> list[str]:
    """Lists impossible texels of a table; channels: (rows, columns) by name. check: that of its layout."""
    if not all(np.isfinite(plane).all() for plane in channels.values()):
        return ["a texel is not a finite number"]
    return check(channels)
