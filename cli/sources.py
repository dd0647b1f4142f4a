"""Sources of radiance for commands: the table of a config, its exact reference, or a bundle."""

from pathlib import Path
from typing import Any

import click

from cli import console


def load(path: Path) -> Any:
    """Loads a config and checks all that can be checked before a bake. Raises ConfigError with all faults."""
    from pipeline.config import read as config_file

    config = config_file.load(path)
    check(config, path)
    return config


def check(config: Any, path: Path) -> None:
    """Checks what the models of a config cannot check alone. Raises ConfigError with all faults."""
    from pipeline.stages import config_check

    config_check.check(config, str(path))


def evaluator(source: Path, exact: bool, store_root: Path | None, progress: Any) -> Any:
    """Returns a function (wi, wr) -> XYZ, (n, 3) each, from SOURCE, a bundle's folder or a config.

    Values of a table may be negative, and are NaN outside its scene.

    exact: whether the exact reference is used; only a config has one. Raises click.UsageError for a bundle.
    """
    if source.is_dir():
        if exact:
            raise click.UsageError("--exact needs a config: a bundle holds tables, not the surface")
        from pipeline.bundle.verify import open_bundle

        return open_bundle(source).signed
    return config_evaluator(load(source), exact, store_root, progress)


def config_evaluator(config: Any, exact: bool, store_root: Path | None, progress: Any) -> Any:
    """Returns a function (wi, wr) -> XYZ, (n, 3) each, of a config, and bakes what it needs."""
    if exact:
        (artifact,) = _artifacts(config, ("surface",), store_root, progress)
        from pipeline.accuracy.exact import reference_evaluator
        from pipeline.stages import surface

        return reference_evaluator(surface.load(artifact), config, progress)
    from pipeline import layouts
    from pipeline.stages.stage import Inputs
    from pipeline.tables.evaluate import interpolator

    table, textures = _artifacts(config, ("table", "textures"), store_root, progress)
    inputs = Inputs({"table": table, "textures": textures})
    return interpolator(layouts.of(config.table).stored_of(inputs), config.radiometry, progress)


def spectral_evaluator(source: Path, exact: bool, store_root: Path | None, progress: Any) -> Any:
    """Returns a function (wi, wr, lambda_nm) -> |P|^2, (n, 3), (n, 3), (L,) -> (n, L), of a config's power spectrum.

    exact: whether the exact reference is used instead. Raises click.UsageError for a bundle, or another table.form.
    """
    if source.is_dir():
        raise click.UsageError("--wavelengths needs a config: a bundle's tables are integrated over wavelengths")
    config = load(source)
    if not exact and not config.table.holds_wavelengths:
        raise click.UsageError('--wavelengths needs table.form = "spectral" in the config, or --exact')
    from pipeline import layouts
    from pipeline.accuracy.exact import reference_of
    from pipeline.optics.geometry import uvw
    from pipeline.stages import surface

    layout = layouts.of(config.table)
    (artifact,) = _artifacts(config, ("surface" if exact else layout.transform.name,), store_root, progress)
    if exact:
        reference = reference_of(surface.load(artifact), config, progress)
        return lambda wi, wr, lambda_nm: reference.power(uvw(wi, wr), lambda_nm)
    assert layout.at_wavelengths is not None
    power = layout.at_wavelengths(artifact)
    return lambda wi, wr, lambda_nm: power(uvw(wi, wr), lambda_nm)


def _artifacts(config: Any, stages: tuple[str, ...], store_root: Path | None, progress: Any) -> list[Any]:
    """Bakes a config up to the last of these stages and returns their artifacts, checked."""
    from pipeline.stages import run

    store = console.open_store(store_root)
    steps = run.plan(config, store, stages[-1])
    artifacts = run.execute(config, steps, store, progress, console.warning_reporter(config, store))
    return [store.open(stage, artifacts[stage].key) for stage in stages]


def without_negative(xyz: Any, what: str) -> Any:
    """Sets negative values of XYZ (..., 3) to 0, and notes how many of `what` this concerns."""
    import numpy as np

    from pipeline.tables.evaluate import never_negative

    negative = int(np.sum(np.any(xyz < 0.0, axis=-1)))
    if negative:
        console.note(f"{negative} of {xyz[..., 0].size} {what} were negative between texels, now 0")
    return never_negative(xyz)


def refuse_unreached(xyz: Any, what: str, source: str) -> None:
    """Raises InputError where values are NaN, for directions outside the scene of a table.

    xyz: (..., n). what: name of the directions. source: name of the config or bundle.
    """
    import numpy as np

    from pipeline.errors import InputError

    unreached = int(np.sum(~np.isfinite(xyz).all(axis=-1)))
    if unreached:
        raise InputError(
            f"{source}: {unreached} of the directions of {what} are outside the [scene] for which it was baked; "
            "leave [scene] out to bake all directions"
        )
