"""`store`: list, check and remove cached artifacts."""

from pathlib import Path

import click

from cli import console

_MIB = 2**20


@click.group("store")
def store_command() -> None:
    """List, check and remove the cached artifacts that runs share."""


@store_command.command("list")
@console.store_option
@console.json_option
def list_command(store_root: Path | None, as_json: bool) -> None:
    """List the artifacts and the tiles of tables: stage, name, size and address."""
    store = console.open_store(store_root)
    found = [
        {"stage": a.stage, "name": a.record.get("name", ""), "bytes": a.bytes, "key": a.key}
        for a in store.artifacts()
    ]
    found += [
        {"stage": "tiles", "name": f"{len(tiles.files)} tiles", "bytes": tiles.bytes, "key": tiles.key}
        for tiles in store.tile_folders()
    ]
    if as_json:
        console.print_json({"root": str(store.root), "artifacts": found})
        return
    rows = [[f["stage"], f["name"], f"{f['bytes'] / _MIB:.1f}", f["key"][:12]] for f in found]
    console.print_table(["stage", "name", "MiB", "key"], rows)
    console.say(f"{len(found)} artifacts, {sum(f['bytes'] for f in found) / _MIB:.0f} MiB in {store.root}")


@store_command.command("check")
@console.store_option
@console.json_option
def check_command(store_root: Path | None, as_json: bool) -> None:
    """Compare every file with its recorded digest; exit code 6 where one differs."""
    from pipeline.errors import DamagedError

    store = console.open_store(store_root)
    faults = store.check()
    if as_json:
        console.print_json({"root": str(store.root), "faults": faults})
    if faults:
        raise DamagedError(*faults)
    if not as_json:
        console.say(f"{len(store.artifacts())} artifacts in {store.root}: unchanged")


@store_command.command("collect")
@click.option(
    "--unused-days",
    type=console.FiniteNumber(0),
    help="Also remove artifacts unused for this many days.",
)
@console.store_option
@console.json_option
def collect_command(unused_days: float | None, store_root: Path | None, as_json: bool) -> None:
    """Remove what is damaged, temporary folders of killed runs, and optionally what was long unused."""
    store = console.open_store(store_root)
    removed, freed = store.collect(unused_days)
    if as_json:
        console.print_json({"root": str(store.root), "removed": removed, "bytes": freed})
    else:
        console.say(f"removed {removed} folders, {freed / _MIB:.0f} MiB, from {store.root}")
