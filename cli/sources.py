"""Where commands take radiance from: a config's table, its exact reference, or a bundle."""

from pathlib import Path
from typing import Any

import click

from cli import console


def load(path: Path) -> Any:
    """The config in a file, with every fault that can be seen before work starts. Raises ConfigError."""
    from pipeline.config import read as config_file
    from pipeline.stages import config_check as preflight

    config = config_file.load(path)
    preflight.check(config, str(path))
    return config


def evaluator(source: Path, exact: bool, store_root: Path | None, progress: Any) -> Any:
    """XYZ of pairs of directions from SOURCE, a bundle's folder or a config."""
    if source.is_dir():
        if exact:
            raise click.UsageError("--exact needs a config: a bundle holds tables, not the surface")
        from pipeline.bundle.verify import open_bundle

        return open_bundle(source).xyz
    return config_evaluator(load(source), exact, store_root, progress)


def config_evaluator(config: Any, exact: bool, store_root: Path | None, progress: Any) -> Any:
    """XYZ of pairs of directions from a config, baking what is missing."""
    from pipeline.stages import run

    store = console.open_store(store_root)
    until = "surface" if exact else "table"
    artifacts = run.execute(config, run.plan(config, store, until), store, progress, console.warner(config, store))
    artifact = store.open(until, artifacts[until].key)
    if exact:
        from pipeline.accuracy.exact import reference_evaluator
        from pipeline.stages import surface

        return reference_evaluator(surface.load(artifact), config, progress)
    from pipeline import layouts
    from pipeline.tables.evaluate import table_evaluator

    return table_evaluator(layouts.of(config.table).load(artifact), config.radiometry, progress)


def spectral_evaluator(source: Path, exact: bool, store_root: Path | None, progress: Any) -> Any:
    """|P|^2 of pairs of directions at wavelengths in nm, from a config's power spectrum or its exact reference."""
    if source.is_dir():
        raise click.UsageError("--wavelengths needs a config: a bundle's tables are integrated over wavelengths")
    config = load(source)
    if not exact and getattr(config.table, "form", None) != "spectral":
        raise click.UsageError('--wavelengths needs table.form = "spectral" in the config, or --exact')
    from pipeline.accuracy.exact import reference_of
    from pipeline.optics.geometry import uvw
    from pipeline.stages import run, surface
    from pipeline.stages.polar import power_spectrum
    from pipeline.tables.polar import spectral

    store = console.open_store(store_root)
    until = "surface" if exact else "power_spectrum"
    artifacts = run.execute(config, run.plan(config, store, until), store, progress, console.warner(config, store))
    artifact = store.open(until, artifacts[until].key)
    if exact:
        reference = reference_of(surface.load(artifact), config, progress)
        return lambda wi, wr, lambda_nm: reference.power(uvw(wi, wr), lambda_nm)
    table = spectral.build(power_spectrum.load(artifact))
    return lambda wi, wr, lambda_nm: spectral.look_up(table, uvw(wi, wr), lambda_nm)


def refuse_unreached(xyz: Any, what: str, source: str) -> None:
    """Tables made for a scene do not know the rest: NaN becomes a message."""
    import numpy as np

    from pipeline.errors import InputError

    unreached = int(np.sum(~np.isfinite(xyz).all(axis=-1)))
    if unreached:
        raise InputError(
            f"{source}: {unreached} of the directions of {what} are outside the [scene] that it was baked for; leave "
            "[scene] out to bake all directions"
        )
