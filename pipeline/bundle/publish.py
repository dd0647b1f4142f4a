"""Publication: the files of a bundle are written, and the folder gets a name made from the digest of its content."""

import errno
import shutil
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Literal

from pipeline import layouts
from pipeline.bundle import checksums, entries, material, readme
from pipeline.bundle.document import MANIFEST
from pipeline.bundle.layout import Prepared, TableImage
from pipeline.bundle.manifest import SCHEMA_VERSION, Manifest, MapImage
from pipeline.config.models import Config
from pipeline.errors import DamagedError
from pipeline.progress import Progress, silent
from pipeline.report import images
from pipeline.store import scratch
from pipeline.store.files import differences
from pipeline.store.store import Artifact, writing

EVALUATOR, README = "evaluate.py", "README.md"
TABLES, MAPS = "tables", "maps"
REPORT: Literal["report.html"] = "report.html"
_TEMPORARY = ".publishing-"
# the lines of the evaluator that a bundle's own replaces: the unit, and the look-ups of all layouts
_UNIT = "X,Y,Z are in the unit that manifest.json states."
_ANY_LOOK_UP = "\nfrom pipeline.layouts import textures\n"
_SCRIPT = '\n\nif __name__ == "__main__":\n'
# as pipeline.report.images.write_xyz names them
MAP_CHANNELS = ("brdf.X", "brdf.Y", "brdf.Z")


def write(
    config: Config,
    table: Prepared,
    inputs: Mapping[str, Artifact],
    report: Path,
    folder: Path,
    progress: Progress = silent,
) -> str:
    """Writes all files of a bundle into a new folder.

    config: the config. table: the layout's part. inputs: the artifacts of all stages before, by stage.
    report: the page of the stage "validate". folder: made here.
    progress: called with a step's name and its completed share, 0 to 1.
    Returns the bundle's name, `<name>-<version>+<digest>`; the same content gives the same name.
    """
    folder.mkdir()
    shutil.copyfile(report, folder / REPORT)
    _write(config, table, inputs, folder, progress)
    digest = checksums.write(folder)
    progress("bundle", 1.0)
    return f"{config.name}-{config.publish.version}+{digest}"


def place(content: Path, out: Path, name: str) -> Path:
    """Copies a bundle to `out/name`, where it appears by one rename.

    content: folder with the files. out: made where it is missing. name: of the bundle.
    Returns the folder; an existing bundle of this name is compared with it and kept.
    Raises DamagedError where its files have changed; StorageError where a file cannot be written.
    """
    target = out / name
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        scratch.remove_abandoned(out, _TEMPORARY)
        if target.exists():
            _require_same(target, content)
            return target
        folder = scratch.make(out, _TEMPORARY)
        try:
            _copy(content, folder)
            _move(folder, target, content)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    return target


def _require_same(bundle: Path, content: Path) -> None:
    faults = differences(bundle, content)
    if faults:
        from pipeline.bundle.verify import summary

        raise DamagedError(
            f"{bundle}: expected the bundle of this content, which was published before, but its files have changed: "
            f"{summary(faults)}. Move it away and publish again"
        )


def _copy(content: Path, folder: Path) -> None:
    """Copies all files below a folder; shutil.copytree would raise its own error and not the system's."""
    for source in sorted(content.rglob("*")):
        target = folder / source.relative_to(content)
        if source.is_dir():
            target.mkdir()
        else:
            shutil.copyfile(source, target)


def _move(folder: Path, target: Path, content: Path) -> None:
    """Renames a finished bundle to its place; if another process was faster, its bundle is compared and kept."""
    try:
        folder.rename(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
        _require_same(target, content)


def _write(config: Config, table: Prepared, inputs: Mapping[str, Artifact], folder: Path, progress: Progress) -> None:
    """Writes every file except report and SHA256SUMS."""
    tables = _write_tables(table, folder, progress)
    maps = _copy_maps(inputs["render"], folder)
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
        conventions={**entries.CONVENTIONS, "RU": entries.RU[config.material.normalisation], **table.conventions},
        units=entries.units(config, table.holds),
        evaluation=table.evaluation,
        grid=table.grid,
        colour=entries.colour(config, inputs),
        material=described,
        precision=config.publish.precision,
        tables=tables,
        maps=maps,
        report=REPORT,
        coverage=entries.coverage(config, inputs, table.rho_max),
        domain=entries.domain(config, inputs),
        plan=table.plan,
        certificate=table.certificate,
        measured_error=inputs["validate"].summary,
        storage_loss=table.loss,
        surface=inputs["surface"].summary,
        provenance=entries.provenance(config, {name: artifact.key for name, artifact in inputs.items()}),
    )
    _write_text(folder / MANIFEST, page.text())
    _write_text(folder / README, readme.text(page, table))
    unit = entries.XYZ_UNIT[config.material.normalisation]
    _write_text(folder / EVALUATOR, evaluator(page.grid.layout).replace(_UNIT, f"X,Y,Z are in {unit}."))


def evaluator(layout: str) -> str:
    """Composes evaluate.py, which runs without this project: the common text and the look-up of one layout.

    The names that a look_up.py uses are those that evaluator.py imports and defines.
    """
    look_up = files(layouts.LAYOUTS[layout].bundle).joinpath("look_up.py").read_text(encoding="utf-8")
    # two blank lines end the imports
    own = look_up.partition("\n\n\n")[2]
    common = files("pipeline.bundle").joinpath("evaluator.py").read_text(encoding="utf-8")
    before, _, after = common.replace(_ANY_LOOK_UP, "").partition(_SCRIPT)
    return f"{before}\n\n{own}{_SCRIPT}{after}"


def _write_tables(table: Prepared, folder: Path, progress: Progress) -> list[TableImage]:
    """Writes the table's images, and returns their entries in the manifest."""
    (folder / TABLES).mkdir()
    written = []
    for image, pixels in table.images:
        images.write_rgba(folder / image.file, pixels)
        written.append(image)
        progress("bundle", 0.9 * len(written) / table.count)
    return written


def _copy_maps(render: Artifact, folder: Path) -> list[MapImage]:
    """Copies the maps of the stage "render" to maps/, and returns their entries in the manifest."""
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
                negative_share=found["negative_share"],
                clipped_share=found["clipped_share"],
            )
        )
    return copied


def _write_text(path: Path, text: str) -> None:
    # the same line ends on every system give the same digest
    path.write_text(text, encoding="utf-8", newline="\n")
