"""The public API: a scan, a bake, a bundle. `from pipeline import Bundle, bake, load_scan`."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.config import read
from pipeline.config.models import Config
from pipeline.errors import AccuracyError, InputError
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

# of a direction's length: far above float32's rounding, far below what would be seen
_UNIT = 1e-4


def load_scan(path: str | Path, **keys: Any) -> HeightField:
    """Reads a scan file and cleans it as a config's [surface] does.

    path: a file of any format that docs/usage.md lists.
    keys: those of [surface], with its units and defaults: channel, pitch_um (um, one number or (x, y)), height_unit,
        height_range_um (um), override_file_units, level, clip_percentile ((low, high), percent).

    Returns the height field: heights_um, float64 (ny, nx), um, x growing with the column and y up with the row;
    pitch_um, (x, y), um. Holes are filled, the surface is levelled (by a plane unless told otherwise) and centred.

    Raises ConfigError for keys that are wrong; InputError where the file cannot be read or trusted, or lacks a unit
    (it names the key to give).
    """
    from pipeline.surface import load
    from pipeline.surface.conditioning import condition

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such scan file")
    section = {"path": str(path), **keys}
    surface = read.parse({"name": "scan", "surface": section}, str(path), Path.cwd()).surface
    field, _ = load.load_scan(surface)
    return condition(field, surface.levelling, surface.clip_percentile)[0]


@dataclass(frozen=True)
class Baked:
    """What a bake wrote, and how far its table is from the exact sum.

    name: the config's. bundle: the bundle's folder. report: one page with everything. maps: BRDF maps of the
    config's lights, an EXR (linear XYZ at 1 RU) and a PNG each. measured_error: errors of the table, as in
    manifest.json. certificate: errors of the table on random directions, likewise.
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
    progress: Progress = silent,
) -> Baked:
    """Does all that a config asks, as `diffract-bake run` does: surface, table, maps, validation, bundle.

    config: path of a TOML file, whose relative file names start from its folder; or a Config
        (pipeline.config.models), whose names start from the working folder.
    out: folder for results, which land in out/NAME.
    store: folder of cached artifacts; $DIFFRACT_BAKE_STORE or the user's cache folder by default. Stages whose inputs
        have not changed are taken from there.
    progress: called with a step's name and the share of it that is done, 0 to 1.

    Returns where the results are, and the measured errors.

    Raises a class of pipeline.errors: ConfigError with every fault; InputError for a scan that cannot be trusted;
    AccuracyError for a budget out of reach, or one that the maps miss (results are written all the same);
    DeviceError without a working OpenCL device; DamagedError for what is no longer what it was; StorageError where
    nothing can be written.
    """
    from pipeline.stages import bake as baking
    from pipeline.stages import config_check
    from pipeline.store import scratch
    from pipeline.store.store import Store, users_folder

    if isinstance(config, Config):
        # what ties sections together, and names of files, are looked at where a document is read
        source = f"config {config.name}"
        config = read.parse(config.model_dump(exclude_unset=True), source, Path.cwd())
    else:
        source = str(config)
        config = read.load(Path(config))
    config_check.check(config, source)
    folder = Path(out) / config.name
    scratch.require_folder(folder)
    opened = Store(users_folder() if store is None else Path(store))
    made, bundle = baking.make(config, opened, folder, progress)
    if made.missed_budget is not None:
        raise AccuracyError(made.missed_budget)
    *maps, report = made.files
    return Baked(
        name=config.name,
        bundle=bundle,
        report=report,
        maps=tuple(maps),
        measured_error=made.artifacts["validate"].summary,
        certificate=made.artifacts["table"].summary["certificate"],
    )


class Bundle:
    """A published bundle, checked and in memory."""

    def __init__(self, path: str | Path) -> None:
        """Opens a bundle and checks every file of it.

        path: the bundle's folder.

        Raises DamagedError where it is not what was published.
        """
        from pipeline.bundle.verify import open_bundle

        self.path = Path(path)
        self._bundle = open_bundle(self.path)

    @property
    def manifest(self) -> dict[str, Any]:
        """manifest.json; docs/schemas/manifest.json says what it holds."""
        return self._bundle.manifest

    def xyz(self, wi: ArrayLike, wr: ArrayLike) -> NDArray[np.float64]:
        """Looks up the light that pairs of directions reflect.

        wi, wr: unit vectors (n, 3) towards the light and the view, away from the surface, z its normal; one of
            both may be a single direction, (3,), for all of the other.

        Returns linear CIE XYZ (n, 3) under 1 RU, where a perfect mirror in its own reflection has Y = 1; NaN for
        directions outside the [scene] that the bundle was baked for.

        Raises ValueError for other shapes, and for vectors that are not of length 1 or not above the horizon.
        """
        light, view = np.broadcast_arrays(_directions(wi), _directions(wr))
        return self._bundle.xyz(light, view)

    def verify(self) -> list[str]:
        """Checks the folder once more.

        Returns one line for every fault; none where it is what was published.
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
