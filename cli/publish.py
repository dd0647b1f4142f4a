"""`publish` and `verify`: bundles for renderers, and their check."""

from pathlib import Path

import click

from cli import console, sources


@click.command("publish")
@click.argument("config_path", metavar="CONFIG", type=click.Path(path_type=Path))
@console.out_option
@console.store_option
@console.json_option
def publish_command(config_path: Path, out: Path, store_root: Path | None, as_json: bool) -> None:
    """Write CONFIG's bundle to OUT/NAME/NAME-VERSION+DIGEST, baking what is missing.

    The bundle holds the tables as EXR, a manifest, a one-page numpy evaluator, maps, report and SHA256SUMS. The same
    content gives the same digest; a standing bundle is never overwritten.
    """
    from pipeline.stages import bundle, run

    config, store = sources.load(config_path), console.open_store(store_root)
    with console.showing_progress() as progress:
        artifacts = run.execute(config, run.plan(config, store), store, progress, console.teller(config, store))
        placed = bundle.place(store.open("bundle", artifacts["bundle"].key), out / config.name)
    if as_json:
        console.print_json({"bundle": str(placed)})
    else:
        click.echo(str(placed))


@click.command("verify")
@click.argument("bundle", type=click.Path(path_type=Path, exists=True, file_okay=False))
@console.json_option
def verify_command(bundle: Path, as_json: bool) -> None:
    """Check that BUNDLE is what was published: every file, the manifest, the tables' sizes."""
    from pipeline.bundle.verify import verify
    from pipeline.errors import DamagedError

    faults = verify(bundle)
    if as_json:
        console.print_json({"bundle": str(bundle), "faults": faults})
    if faults:
        raise DamagedError("\n".join(f"{bundle}: {fault}" for fault in faults))
    if not as_json:
        click.echo(f"{bundle}: unharmed")
