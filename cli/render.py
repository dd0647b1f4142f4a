"""`render`: BRDF maps to look at."""

from pathlib import Path

import click

from cli import console, sources
from pipeline import config as configs


@click.command("render")
@click.argument("config_path", metavar="CONFIG", type=click.Path(path_type=Path))
@click.option("--theta", type=click.FloatRange(0, 90, max_open=True), help="Light's angle from the normal, degrees.")
@click.option("--phi", type=float, default=0.0, show_default=True, help="Light's azimuth from +x, degrees.")
@click.option("--size", type=click.IntRange(16, 4096), help="Pixels along one side.")
@click.option("--exposure", type=click.FloatRange(0, min_open=True), help="Exposure of the PNG, RU.")
@click.option("--exact", is_flag=True, help="By the exact reference instead of the table.")
@console.out_option
@console.store_option
@console.json_option
def render_command(
    config_path: Path,
    theta: float | None,
    phi: float,
    size: int | None,
    exposure: float | None,
    exact: bool,
    out: Path,
    store_root: Path | None,
    as_json: bool,
) -> None:
    """Render BRDF maps of CONFIG: its own lights, or one given by --theta and --phi.

    A map shows every view of one light: pixel (x, y) is the direction (sin t cos p, sin t sin p), +y up. Files go
    to OUT/NAME as EXR (linear XYZ, 1 RU) and PNG.
    """
    from pipeline import images
    from pipeline.config import Direction
    from pipeline.evaluate import Map, render_map
    from pipeline.optics.colour_error import pixels
    from pipeline.stages import render
    from pipeline.store import writing

    config = configs.load(config_path)
    lights = config.render.lights if theta is None else [Direction(theta_deg=theta, phi_deg=phi)]
    views = Map(size or config.render.size, render.map_radius(config))
    folder, made = out / config.name, []
    with console.showing_progress() as progress:
        evaluate = sources.config_evaluator(config, exact, store_root, progress)
        for light in lights:
            image = render_map(evaluate, render.light_direction(light), views)
            sources.refuse_unreached(image, f"the light {light.theta_deg:g}°, {light.phi_deg:g}°", str(config_path))
            name = render.map_name(light) + ("_exact" if exact else "")
            exr, png = folder / f"{name}.exr", folder / f"{name}.png"
            with writing(folder):
                folder.mkdir(parents=True, exist_ok=True)
                images.write_xyz(exr, image)
                images.write_png(png, pixels(image, exposure or config.render.exposure_ru))
            made += [str(exr), str(png)]
    if as_json:
        console.print_json({"files": made})
    else:
        click.echo("\n".join(made))
