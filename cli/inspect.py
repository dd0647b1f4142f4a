"""`inspect`: the content of a scan, a config or a bundle."""

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import click

from cli import console


@click.command("inspect")
@click.argument("source", type=click.Path(path_type=Path, exists=True), required=False)
@click.option("--channel", help="Channel of a scan file [default: the height channel].")
@click.option(
    "--schema",
    type=click.Choice(["config", "manifest"]),
    help="Print the JSON Schema of configs, or of a bundle's manifest.json, instead of a SOURCE.",
)
@click.option("--formats", is_flag=True, help="List the formats of scan files that can be read, instead of a SOURCE.")
@click.option(
    "--picture",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write a PNG of the (u, v) and |w| that the [scene] of a config visits.",
)
@console.json_option
def inspect_command(
    source: Path | None,
    channel: str | None,
    schema: str | None,
    formats: bool,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Print the content of SOURCE: a scan file, a config or a bundle's folder. Bakes nothing.

    With --schema and no SOURCE: print the JSON Schema of a config or of manifest.json, for programs, and for editors
    that complete and check documents.
    """
    if formats:
        if source is not None or channel is not None or schema is not None:
            raise click.UsageError("--formats takes no SOURCE, no --channel and no --schema")
        _print_formats(as_json)
        return
    if schema is not None:
        if source is not None or channel is not None:
            raise click.UsageError("--schema takes no SOURCE and no --channel")
        console.print_json(_schema(schema))
        return
    if source is None:
        raise click.UsageError("Missing argument 'SOURCE'; or --schema for the keys of a document")
    found = _found(source, channel, picture)
    if as_json:
        console.print_json(found)
        return
    for key, value in found.items():
        console.say(f"{key:<16} {value if isinstance(value, str) else json.dumps(value)}")


def _found(source: Path, channel: str | None, picture: Path | None) -> dict[str, Any]:
    """Returns the content of a bundle, a config or a scan."""
    if picture is not None and source.suffix != ".toml":
        raise click.UsageError("--picture needs a config with a [scene]")
    if source.is_dir():
        return _bundle(source)
    return _config(source, picture) if source.suffix == ".toml" else _scan(source, channel)


def _print_formats(as_json: bool) -> None:
    from pipeline.surface.readers.formats import READ

    if as_json:
        console.print_json([asdict(entry) for entry in READ])
        return
    for entry in READ:
        console.say(f"{entry.name:<32} {' '.join(entry.suffixes):<28} {entry.reader}")


def _schema(document: str) -> dict[str, Any]:
    from pipeline.config import schema

    if document == "config":
        from pipeline.config.models import Config

        return schema.of(Config, "Config of diffract-bake", "validation")
    from pipeline.bundle.manifest import Manifest

    return schema.of(Manifest, "manifest.json of a diffract-bake bundle", "serialization")


def _bundle(folder: Path) -> dict[str, Any]:
    from pipeline.bundle import document
    from pipeline.errors import DamagedError

    try:
        return document.read(folder)
    except DamagedError as error:
        raise DamagedError(f"{folder}: not a bundle: {error}") from None


def _config(path: Path, picture: Path | None) -> dict[str, Any]:
    """Returns a config with its defaults, and what its scene visits; draws that where a picture is named."""
    from pipeline.config import read as config_file

    config = config_file.load(path)
    resolved: dict[str, Any] = config.model_dump(mode="json")
    if config.scene is None:
        if picture is not None:
            raise click.UsageError(f"--picture needs a config with a [scene], and {path} has none")
        return resolved
    from pipeline.scene.summary import summary

    if picture is not None:
        from pipeline.accuracy.plots import visited_directions
        from pipeline.store.store import writing

        drawn = visited_directions(config.scene)
        with writing(picture.parent):
            picture.write_bytes(drawn)
    return {**resolved, "visited": summary(config.scene)}


def _scan(path: Path, channel: str | None) -> dict[str, Any]:
    import numpy as np

    from pipeline.surface.holes import measured_part
    from pipeline.surface.load import refusals
    from pipeline.surface.readers import read_scan

    scan = read_scan(path, channel)
    found = {field.name: getattr(scan, field.name) for field in fields(scan) if field.name not in ("heights", "mask")}
    rows, columns = scan.heights.shape
    measured = measured_part(scan)
    valid = measured.heights[np.isfinite(measured.heights)]
    needs = {
        "surface.pitch_um": scan.pitch_um is None,
        "surface.height_range_um": scan.um_per_unit is None and scan.full_code is not None,
        "surface.height_unit": scan.um_per_unit is None and scan.full_code is None,
    }
    return {
        "file": path.name,
        **found,
        "samples": f"{columns} x {rows}",
        "holes": round(measured.share * scan.heights.size),
        "not measured": [str(entry) for entry in measured.unmeasured],
        "cropped": dict(zip(("bottom", "top", "left", "right"), measured.cropped, strict=True)),
        "mask covers": measured.masked_share,
        "lowest": float(valid.min()) if valid.size else None,
        "highest": float(valid.max()) if valid.size else None,
        "warnings": [*scan.warnings, *measured.warnings, *refusals(path.name, scan, measured)],
        "config needs": [key for key, needed in needs.items() if needed],
    }
