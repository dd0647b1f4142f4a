"""`render`: BRDF maps of any light."""

from pathlib import Path

import click

from cli import console, sources


@click.command("render")
@click.argument("config_path", metavar="CONFIG", type=click.Path(path_type=Path))
@click.option("--theta", type=console.FiniteNumber(0, 90), help="Angle of the light to the normal, deg.")
@click.option("--phi", type=console.FiniteNumber(-360, 361), help="Azimuth of the light from +x, deg [default: 0].")
@click.option("--size", type=click.IntRange(16, 4096), help="Pixels per side.")
@click.option("--exposure", type=console.FiniteNumber(1e-9), help="Exposure of the PNG, RU.")
@click.option("--exact", is_flag=True, help="Use the exact reference instead of the table.")
@console.out_option
@console.store_option
@console.memory_option
@console.json_option
def render_command(
    config_path: Path,
    theta: float | None,
    phi: float | None,
    size: int | None,
    exposure: float | None,
    exact: bool,
    out: Path,
    store_root: Path | None,
    as_json: bool,
) -> None:
    """Render BRDF maps of CONFIG for its own lights, or for one given by --theta and --phi.

    A map shows all views under one light: pixel (x, y) is the direction (sin t cos p, sin t sin p), +y up. Files are
    written to OUT/NAME as EXR (linear XYZ) and PNG.
    """
    from pipeline.optics.colour import pixels
    from pipeline.report import images
    from pipeline.scene.lights import Direction
    from pipeline.scene.maps import map_radius
    from pipeline.stages import render
    from pipeline.store import scratch
    from pipeline.store.store import writing
    from pipeline.tables.evaluate import Map, render_map

    if theta is None and phi is not None:
        raise click.UsageError("--phi needs --theta: give both angles of the light")
    config = sources.load(config_path)
    lights = config.render.lights if theta is None else [Direction(theta_deg=theta, phi_deg=phi or 0.0)]
    folder, unit, made = out / config.name, config.radiometry.unit, []
    with console.showing_progress() as progress:
        evaluate = sources.config_evaluator(config, exact, store_root, progress)
        pixels_of = [Map(size or config.render.size, map_radius(config.scene, light)) for light in lights]
        shown = [
            render_map(evaluate, render.light_direction(light), views)
            for light, views in zip(lights, pixels_of, strict=True)
        ]
    for light, image in zip(lights, shown, strict=True):
        named = f"the light {light.theta_deg:g}°, {light.phi_deg:g}°"
        sources.refuse_unreached(image, named, str(config_path))
        image[...] = sources.without_negative(image, f"pixels of {named}")
    with writing(folder), scratch.replacing(folder) as temporary:
        for light, image in zip(lights, shown, strict=True):
            name = render.map_name(light) + ("_exact" if exact else "")
            images.write_xyz(temporary / f"{name}.exr", image)
            images.write_png(temporary / f"{name}.png", pixels(image / unit, exposure or config.render.exposure_ru))
            made += [str(folder / f"{name}.exr"), str(folder / f"{name}.png")]
    if as_json:
        console.print_json({"files": made})
    else:
        for path in made:
            console.say(path)
