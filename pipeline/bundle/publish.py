"""Publish: artifacts -> a folder that stands alone, named by its content and never overwritten."""

import errno
import json
import shutil
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from pipeline.bundle import checksums, entries, layouts, material, readme
from pipeline.bundle.manifest import MANIFEST, SCHEMA_VERSION, Manifest, MapImage, TableImage
from pipeline.bundle.prepared import Prepared
from pipeline.bundle.verify import summary, verify
from pipeline.config.models import Config
from pipeline.errors import DamagedError
from pipeline.progress import Progress, silent
from pipeline.report import images
from pipeline.stages.validate import REPORT
from pipeline.store import scratch
from pipeline.store.store import Artifact, writing

EVALUATOR, README = "evaluate.py", "README.md"
TABLES, MAPS = "tables", "maps"
_BESIDE = ".publishing-"
# as pipeline.report.images.write_xyz names them
MAP_CHANNELS = ("brdf.X", "brdf.Y", "brdf.Z")


def publish(config: Config, inputs: Mapping[str, Artifact], out: Path, progress: Progress = silent) -> Path:
    """Writes the bundle `<name>-<version>+<digest>` under `out` and returns its folder.

    inputs: the artifacts of all stages of the config, by stage. The digest is over content, so the same
    content gives the same folder and a second time nothing is written. The folder appears by one rename.
    Raises AccuracyError where what is to be stored would not keep its digits or its budget, DamagedError where the
    folder stands already and is not what it was, StorageError where the disk refuses.
    """
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        scratch.remove_abandoned(out, _BESIDE)
        folder = scratch.make(out, _BESIDE)
        try:
            _write(config, inputs, folder, progress)
            digest = checksums.write(folder)
            target = out / f"{config.name}-{config.publish.version}+{digest}"
            _place(folder, target)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    progress("publish", 1.0)
    return target


def published(config: Config, keys: Mapping[str, str], out: Path) -> Path | None:
    """The bundle under `out` that was published from artifacts of these keys by this config, if it stands.

    Raises DamagedError where it stands and is not what it was.
    """
    expected = entries.provenance(config, keys).model_dump(mode="json")
    for page in sorted(out.glob(f"{config.name}-{config.publish.version}+*/{MANIFEST}")):
        try:
            found = json.loads(page.read_text(encoding="utf-8"))["provenance"]
        except (OSError, ValueError, KeyError, TypeError):
            continue
        if found == expected:
            _require_unharmed(page.parent)
            return page.parent
    return None


def _require_unharmed(bundle: Path) -> None:
    faults = verify(bundle)
    if faults:
        raise DamagedError(
            f"{bundle}: this content was published before, and the folder is not what it was: "
            f"{summary(faults)}. Move it away and publish again"
        )


def _place(folder: Path, target: Path) -> None:
    """Moves a finished bundle to its name; one that stands there already stays, if it is unharmed."""
    try:
        # a rename would replace an empty folder
        if not target.exists():
            folder.rename(target)
            return
    except OSError as error:
        # somebody else published the same content meanwhile
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
    _require_unharmed(target)


def _write(config: Config, inputs: Mapping[str, Artifact], folder: Path, progress: Progress) -> None:
    """Every file but SHA256SUMS."""
    table = layouts.prepare(config, inputs)
    tables = _write_tables(table, folder, progress)
    maps = _copy_maps(inputs["render"], folder)
    report = inputs["validate"].folder / REPORT
    if report.is_file():
        shutil.copyfile(report, folder / REPORT)
    found = material.medium(config)
    described = material.entry(config)
    if found is not None and described.reflectance_table is not None:
        _write_text(folder / material.REFLECTANCE, material.reflectance_csv(found))
    page = Manifest(
        schema_version=SCHEMA_VERSION,
        name=config.name,
        version=config.publish.version,
        licence=config.publish.licence or "not stated",
        made_by=entries.made_by(inputs),
        conventions={**entries.CONVENTIONS, **table.conventions},
        units=entries.units(config, table.holds),
        evaluation=table.evaluation,
        grid=table.grid,
        colour=entries.colour(config, inputs),
        material=described,
        precision=config.publish.precision,
        tables=tables,
        maps=maps,
        report=REPORT if report.is_file() else None,
        coverage=entries.coverage(config, inputs),
        domain=entries.domain(config, inputs),
        plan=table.plan,
        certificate=table.certificate,
        measured_error=inputs["validate"].summary,
        storage_loss=table.loss,
        surface=inputs["surface"].summary,
        provenance=entries.provenance(config, {name: artifact.key for name, artifact in inputs.items()}),
    )
    _write_text(folder / MANIFEST, page.text())
    _write_text(folder / README, readme.text(page, table.constants))
    source = files("pipeline.bundle").joinpath("evaluator.py").read_text(encoding="utf-8")
    _write_text(folder / EVALUATOR, source)


def _write_tables(table: Prepared, folder: Path, progress: Progress) -> list[TableImage]:
    """The table's images, and their entries."""
    (folder / TABLES).mkdir()
    written = []
    for image, pixels in table.images:
        images.write_rgba(folder / image.file, pixels)
        written.append(image)
        progress("publish", 0.9 * len(written) / table.count)
    return written


def _copy_maps(render: Artifact, folder: Path) -> list[MapImage]:
    """The render artifact's maps under maps/, and their entries."""
    (folder / MAPS).mkdir()
    copied = []
    for found in render.summary["maps"]:
        for name in (found["exr"], found["png"]):
            shutil.copyfile(render.folder / name, folder / MAPS / name)
        copied.append(
            MapImage(
                file=f"{MAPS}/{found['exr']}",
                width=render.summary["size"],
                height=render.summary["size"],
                channels=list(MAP_CHANNELS),
                pixel_type="float",
                theta_deg=found["theta_deg"],
                phi_deg=found["phi_deg"],
                png=f"{MAPS}/{found['png']}",
                exposure_ru=render.summary["exposure_ru"],
            )
        )
    return copied


def _write_text(path: Path, text: str) -> None:
    # one line end everywhere, so that the digest does not depend on the system
    path.write_text(text, encoding="utf-8", newline="\n")
