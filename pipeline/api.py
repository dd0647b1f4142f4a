"""The public API: load_scan, bake and Bundle, which `from pipeline import ...` gives."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline import resources
from pipeline.config import read
from pipeline.config.models import Config
from pipeline.errors import AccuracyError, InputError
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

# tolerance of a direction's length: far above the rounding of float32, and too small to be seen
_UNIT = 1e-4


def load_scan(path: str | Path, **keys: Any) -> HeightField:
    """Reads a scan file and conditions it as a config's [surface] does.

    path: a file of any format that docs/usage.md lists.
    keys: those of [surface], with its units and defaults: channel, pitch_um (um, one number or (x, y)), height_unit,
        height_range_um (um), override_file_units, level, clip_percentile ((low, high), percent), mask, no_data,
        max_hole_share.

    Returns the height field: heights_um, float64 (ny, nx), um, x growing with the column and y up with the row;
    pitch_um, (x, y), um. Rows and columns at the edges that were not measured are cropped, other holes are filled,
    and a UserWarning tells their share; the surface is levelled, by a plane unless `level` says otherwise, and
    centred.

    Raises ConfigError for wrong keys; InputError where the file cannot be read or trusted, or lacks a unit (the
    message names the key to give).
    """
    import warnings

    from pipeline.surface import load
    from pipeline.surface.conditioning import condition

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such scan file; check the path")
    section = {"path": str(path), **keys}
    surface = read.parse({"name": "scan", "surface": section}, str(path), Path.cwd()).surface
    field, record = load.load_scan(surface)
    for warning in record.warnings:
        warnings.warn(f"{record.file}: {warning}", stacklevel=2)
    return condition(field, surface.levelling, surface.clip_percentile)[0]


@dataclass(frozen=True)
class Baked:
    """The files that a bake wrote, and the errors of its table against the exact sum.

    name: the config's. bundle: the bundle's folder. report: an HTML page.
    maps: for each light, its BRDF map as an EXR (linear XYZ) and as a PNG.
    measured_error: errors of the table, as in manifest.json.
    certificate: errors of the table on random directions that its planning did not use, as in manifest.json.
    """

    name: str
    bundle: Path
    report: Path
    maps: tuple[Path, ...]
    measured_error: Mapping[str, Any]
    certificate: Mapping[str, Any]


def bake(
    config: str | Path | Config,
    *,
    out: str | Path = "out",
    store: str | Path | None = None,
    memory: int | str | None = None,
    progress: Progress = silent,
) -> Baked:
    """Runs all stages of a config, as `diffract-bake run` does: surface, table, maps, validation, bundle.

    config: path of a TOML file, whose relative file names start from its folder; or a Config
        (pipeline.config.models), whose names start from the working folder.
    out: folder for results, which land in out/NAME.
    store: folder of cached artifacts, by default $DIFFRACT_BAKE_STORE or the user's cache folder. A stage is computed
        again only where its inputs have changed.
    memory: the most memory that a stage may need, bytes or a text like "4GiB", by default what the machine has left.
    progress: called with the name of a step and its completed share, 0 to 1.

    Returns the paths of the results and the measured errors.

    Raises a class of pipeline.errors: ConfigError with every fault; InputError for a scan that cannot be trusted;
    AccuracyError for an error budget out of reach, or one that the maps miss (the results are written nevertheless);
    ResourceError for a stage that needs more memory than is allowed;
    DeviceError without a working OpenCL device; DamagedError for a damaged artifact; StorageError where a file cannot
    be written.
    """
    from pipeline.stages import bake as baking
    from pipeline.stages import config_check, run
    from pipeline.store import scratch
    from pipeline.store.store import Store, users_folder

    if isinstance(config, Config):
        # relations between sections, and file names, are checked where a document is parsed
        source = f"config {config.name}"
        config = read.parse(config.model_dump(exclude_unset=True), source, Path.cwd())
    else:
        source = str(config)
        config = read.load(Path(config))
    config_check.check(config, source)
    folder = Path(out) / config.name
    scratch.require_folder(folder)
    opened = Store(users_folder() if store is None else Path(store))
    with resources.allowing(resources.bytes_of(memory) if isinstance(memory, str) else memory):
        made, bundle = baking.make(config, run.plan(config, opened), opened, folder, progress)
    if made.missed_budget is not None:
        raise AccuracyError(made.missed_budget)
    *maps, report = made.files
    return Baked(
        name=config.name,
        bundle=bundle,
        report=report,
        maps=tuple(maps),
        measured_error=made.artifacts["validate"].summary,
        certificate=made.artifacts["textures"].summary["certificate"],
    )


class Bundle:
    """A published bundle, verified and held in memory."""

    def __init__(self, path: str | Path) -> None:
        """Opens a bundle and verifies every file.

        path: the bundle's folder.

        Raises DamagedError where a file has changed since the publication.
        """
        from pipeline.bundle.verify import open_bundle

        self.path = Path(path)
        self._bundle = open_bundle(self.path)

    @property
    def manifest(self) -> dict[str, Any]:
        """The content of manifest.json, which docs/schemas/manifest.json describes."""
        return self._bundle.manifest

    def xyz(self, wi: ArrayLike, wr: ArrayLike) -> NDArray[np.float64]:
        """Looks up the reflected colour for pairs of directions.

        wi, wr: unit vectors (n, 3) towards the light and the view, away from the surface, with z its normal; one of
            them may be a single direction, (3,).

        Returns linear CIE XYZ (n, 3), in the unit that `manifest["units"]["XYZ"]` states: a BRDF times
        cos(theta_i), 1/sr, or RU. It is 0 at and below the horizon and never negative; NaN for directions outside the
        [scene] for which the bundle was baked.

        Raises ValueError for other shapes, and for vectors that are not of length 1.
        """
        light, view = np.broadcast_arrays(_directions(wi), _directions(wr))
        return self._bundle.xyz(light, view)

    def verify(self) -> list[str]:
        """Verifies the files of the bundle's folder again.

        Returns one line for each fault; an empty list where nothing has changed since the publication.
        """
        from pipeline.bundle.verify import verify

        return verify(self.path)


def _directions(vectors: ArrayLike) -> NDArray[np.float64]:
    found = np.atleast_2d(np.asarray(vectors, dtype=np.float64))
    if found.ndim != 2 or found.shape[1] != 3:
        raise ValueError(f"expected directions (n, 3), got {np.shape(vectors)}")
    # NaN fails every comparison
    if not np.all(np.abs(np.linalg.norm(found, axis=1) - 1.0) <= _UNIT):
        raise ValueError("expected unit vectors, got other lengths")
    return found
