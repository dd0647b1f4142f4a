"""Verification of a bundle's content: the manifest fits its schema and itself, and describes the images."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from pipeline.bundle import document
from pipeline.bundle.document import MANIFEST
from pipeline.bundle.manifest import Image, Manifest, MapImage, PolarGridEntry, TableImage, TaylorGridEntry
from pipeline.errors import DamagedError
from pipeline.optics.scene import Scene
from pipeline.report import exr, images
from pipeline.report.exr import Structure
from pipeline.tables.planning.plan import rho_max
from pipeline.tables.taylor import grid
from pipeline.tables.taylor.table import reachable_nodes

# zlib shrinks zeros a thousandfold; tables and maps shrink to half, and further where a scene leaves texels out
_MOST_GROWTH, _GROWS_BELOW = 100, 2**27
_MOST_SCHEMA_FAULTS = 20
# another machine may round the sine of a scene's angle differently
_SINE_ROUNDS = 1e-9


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
    if isinstance(manifest.grid, PolarGridEntry) and not _basis_fits(manifest.grid, len(manifest.tables)):
        found.append(
            f"{MANIFEST}: grid: {len(manifest.tables)} tables do not hold the outputs that basis and w_terms need"
        )
    for table in manifest.tables:
        if table.layout != manifest.grid.layout:
            found.append(f"{MANIFEST}: {table.file} is not of the grid's layout")
        if (table.width, table.height) != (manifest.grid.width, manifest.grid.height):
            found.append(f"{MANIFEST}: {table.file} is not of the grid's size")
        if table.pixel_type != manifest.precision or set(table.channels) != set(images.RGBA):
            found.append(f"{MANIFEST}: {table.file} is not RGBA of precision {manifest.precision}")
    return found + _scene_faults(manifest)


def _basis_fits(grid: PolarGridEntry, images: int) -> bool:
    """Tells whether the basis is (outputs, 3, w_terms) for the outputs that the images hold."""
    if grid.basis is None:
        return 4 * images == 3 * grid.w_terms
    shapes = {(len(output), *(len(channel) for channel in output)) for output in grid.basis}
    return len(grid.basis) == 4 * images and shapes == {(3, *3 * (grid.w_terms,))}


def _scene(manifest: Manifest) -> Scene | None:
    """Returns the scene of the config in the manifest. Raises ValidationError where it is none."""
    found: Scene | None = TypeAdapter(Scene | None).validate_python(manifest.provenance.config.get("scene"))
    return found


def _scene_faults(manifest: Manifest) -> list[str]:
    """Lists contradictions between the scene and the directions that the table holds."""
    try:
        scene = _scene(manifest)
    except ValidationError:
        return [f"{MANIFEST}: provenance.config.scene is not the [scene] of a config"]
    if isinstance(manifest.grid, PolarGridEntry):
        expected = rho_max(scene)
        if abs(manifest.grid.rho_max - expected) > _SINE_ROUNDS:
            return [f"{MANIFEST}: grid.rho_max is {manifest.grid.rho_max:g}, but the scene reaches {expected:g}"]
    return []


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
    tables = {table.file: table for table in manifest.tables}
    reached = _reached(manifest.grid, _scene(manifest)) if isinstance(manifest.grid, TaylorGridEntry) else None
    found = []
    for name in structures:
        try:
            channels = images.decode(folder / name)
        except DamagedError as error:
            found.append(f"{name} {error}")
            continue
        if name in tables:
            found += _texel_faults(tables[name], channels, reached)
    return found


def _reached(entry: TaylorGridEntry, scene: Scene | None) -> NDArray[np.bool_]:
    """Computes the nodes of a Taylor table that its scene needs, bool (v, u)."""
    if scene is not None:
        views = scene.views.model_copy(update={"theta_max_deg": scene.views.theta_max_deg * (1.0 - _SINE_ROUNDS)})
        scene = scene.model_copy(update={"views": views})
    return reachable_nodes(grid.nodes(entry.width, entry.power), scene)


def _texel_faults(
    entry: TableImage, channels: dict[str, NDArray[Any]], reached: NDArray[np.bool_] | None
) -> list[str]:
    """Lists impossible texels of a table.

    channels: (rows, columns) by name. reached: nodes that a Taylor table must have, bool (rows, columns).
    """
    if not all(np.isfinite(plane).all() for plane in channels.values()):
        return [f"{entry.file}: a texel is not a finite number"]
    if reached is None:
        return []
    computed = channels["A"] == 1.0
    if not np.all(computed | (channels["A"] == 0.0)):
        return [f"{entry.file}: A is neither 0 nor 1"]
    if np.any(reached & ~computed):
        return [f"{entry.file}: A says that a texel was not computed, but the scene reaches it"]
    return []
