"""The stage "bundle": table, maps and validation -> the folder that renderers read."""

from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from pipeline import layouts
from pipeline.config.models import Config
from pipeline.errors import DamagedError
from pipeline.progress import Progress
from pipeline.resources import Need, largest
from pipeline.stages.foreseen import Foreseen, LayoutSizes, base, heap, spare
from pipeline.stages.layout import Layout
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.stages.validate import REPORT
from pipeline.store.store import Artifact

_CONTENT = "content"


def _parameters(config: Config) -> dict[str, Any]:
    from pipeline.bundle import entries

    return {"config": entries.resolved(config), "sources": _sources_digest(config.table.layout)}


@cache
def _sources_digest(layout: str) -> str:
    """Computes the SHA-256 of all text that is shipped in bundles of a layout: evaluator, shaders and templates."""
    from pipeline.bundle import readme

    common, own = files("pipeline.bundle"), files(layouts.LAYOUTS[layout].bundle)
    sources = [
        common.joinpath("evaluator.py"),
        own.joinpath("look_up.py"),
        common.joinpath("templates", "README.md.in"),
        own.joinpath("templates", "layout.md.in"),
        readme.BRDF,
        layouts.bundled(layout).shader,
    ]
    return sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    from pipeline.bundle import publish

    table = layouts.of(config.table).prepare(config, inputs)
    report = inputs["validate"].folder / REPORT
    name = publish.write(config, table, inputs.artifacts, report, folder / _CONTENT, progress)
    return {"name": name}


def place(artifact: Artifact, out: Path) -> Path:
    """Copies the bundle of an artifact into a folder; a bundle of the same name is kept.

    artifact: of this stage. out: the folder, made where it is missing.
    Returns the bundle's folder, `out/<name>-<version>+<digest>`.
    Raises DamagedError where that folder exists and its files have changed; StorageError where a file cannot be
    written.
    """
    from pipeline.bundle import publish

    name = artifact.measured("name", str)
    if Path(name).name != name:
        raise DamagedError(f"{artifact.folder}: expected the name of a bundle, got {name!r}; remove this folder")
    return publish.place(artifact.folder / _CONTENT, out, name)


def need(foreseen: Foreseen, sizes: LayoutSizes) -> Need:
    """Computes memory and time of this stage: the table and its textures."""
    held = foreseen.held(transform=sizes.transform_bytes, reference=foreseen.reference.nbytes)
    kept = {**spare(sizes.freed_bytes, sizes.study.buffer), **heap(sizes.transform_bytes, sizes.table_bytes)}
    table = {"table": sizes.table_bytes, "textures": sizes.stored_bytes}
    arrays = largest(foreseen.reading(**table), {**table, **sizes.prepared.arrays})
    return Need({**base("bundle"), **kept, **held, **arrays}, 5e-8 * sizes.table_bytes)


def stage_of(layout: Layout) -> Stage:
    """Returns the bundle stage of a layout; its inputs are all stages before, because the manifest describes each."""
    inputs = ("surface", layout.transform.name, "table", "textures", "render", "validate")
    return Stage("bundle", 8, inputs, _parameters, _produce, work=lambda _config: "tables, maps and report")
