"""`publish` and `verify`: write bundles for renderers, and check them."""

from pathlib import Path

import click

from cli import console, sources


@click.command("publish")
@click.argument("config_path", metavar="CONFIG", type=click.Path(path_type=Path))
@console.out_option
@console.store_option
@console.memory_option
@console.json_option
def publish_command(config_path: Path, out: Path, store_root: Path | None, as_json: bool) -> None:
    """Write the bundle of CONFIG to OUT/NAME/NAME-VERSION+DIGEST, and bake what is missing.

    The bundle holds the tables as EXR, a manifest, a one-page numpy evaluator, maps, report and SHA256SUMS. Equal
    content has the same digest; an existing bundle is never overwritten.
    """
    from pipeline.stages import bundle, run

    config, store = sources.load(config_path), console.open_store(store_root)
    with console.showing_progress() as progress:
        artifacts = run.execute(
            config, run.plan(config, store), store, progress, console.step_reporter(config, store)
        )
        placed = bundle.place(store.open("bundle", artifacts["bundle"].key), out / config.name)
    if as_json:
        console.print_json({"bundle": str(placed)})
    else:
        console.say(str(placed))


@click.command("verify")
@click.argument("bundle", type=click.Path(path_type=Path, exists=True, file_okay=False))
@console.json_option
def verify_command(bundle: Path, as_json: bool) -> None:
    """Check that BUNDLE has not changed since its publication: every file, the manifest, the texels of the tables.

    A renamed folder is accepted where its files match SHA256SUMS.
    """
    from pipeline.bundle.verify import renamed, verify
    from pipeline.errors import DamagedError

    faults = verify(bundle)
    digest = None if faults else renamed(bundle)
    if as_json:
        found = {} if digest is None else {"renamed": True, "digest": digest}
        console.print_json({"bundle": str(bundle), "faults": faults, **found})
    if faults:
        raise DamagedError(*(f"{bundle}: {fault}" for fault in faults))
    if not as_json and digest is None:
        console.say(f"{bundle}: unchanged")
    elif not as_json:
        console.say(
            f"{bundle}: all files match SHA256SUMS; the folder was renamed, so that its name no longer carries the "
            f"digest {digest}"
        )
