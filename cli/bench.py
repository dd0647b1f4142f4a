"""`bench`: run time against error, numerical stability, and the literature's figures."""

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cli import console, sources

if TYPE_CHECKING:
    from pipeline.evaluation.check import Check
    from pipeline.evaluation.figures.bench import FigureResults
    from pipeline.evaluation.scenes.bench import SceneResults
    from pipeline.evaluation.speed.bench import SpeedResults
    from pipeline.evaluation.speed.growth import GrowthCurve
    from pipeline.evaluation.speed.stage_costs import StageCost
    from pipeline.evaluation.speed.suite import Point, SurfaceSpeed
    from pipeline.evaluation.stability.bench import StabilityResults

    Results = SpeedResults | StabilityResults | FigureResults | SceneResults

# starts the tool in a process of its own; -P: nothing is imported from the working folder
COMMAND_LINE = (sys.executable, "-P", "-c", "from cli.entry import process; process()")


def _out_option(default: str, files: str) -> Callable[..., Any]:
    path = click.Path(path_type=Path, file_okay=False)
    return click.option("--out", type=path, default=Path(default), show_default=True, help=f"Folder for {files}.")


@click.group("bench")
def bench_command() -> None:
    """Measure the tool: its speed, its numerical stability, and its figures compared with the literature's."""


@bench_command.command("speed")
@click.argument("config_paths", metavar="[CONFIG]...", type=click.Path(path_type=Path), nargs=-1)
@_out_option("out/speed", "speed.json, and speed and curve as .csv and .png")
@click.option("--quick", is_flag=True, help="Smaller maps and samples, no large scans; processes only for one bake.")
@console.store_option
@console.json_option
def speed_command(
    config_paths: tuple[Path, ...], out: Path, quick: bool, store_root: Path | None, as_json: bool
) -> None:
    """Time CONFIGs' surfaces here, error against seconds and bytes.

    The paper's tables over their parameters, the polar table over its own, the same polar table by FINUFFT and both
    in plain numpy, each with its mean CIELAB error at 7500 RU; the stages' shares of the device's peak and
    bandwidth, which are measured in the same run; the stack's transforms by the kernel, pyFFTW and scipy; the gain
    of each constant of the kernels; seconds and memory of each stage from 512 x 512 to 8192 x 8192 samples; and the
    cost of compiling. Without CONFIGs: three synthetic surfaces.
    """
    from pipeline.evaluation.speed import bench
    from pipeline.store import scratch

    scratch.require_folder(out)
    with nullcontext(config_paths) if config_paths else bench.built_in() as paths:
        configs = [(sources.load(path), path) for path in paths]
        with console.showing_progress() as progress:
            store = console.open_store(store_root)
            found = bench.run(configs, quick, store, COMMAND_LINE, progress, console.note)
    if written := _write(found, out, as_json):
        _print_speed(found)
        for path in written:
            console.say(path)


@bench_command.command("scene")
@click.argument("config_paths", metavar="[CONFIG]...", type=click.Path(path_type=Path), nargs=-1)
@_out_option("out/scene", "scene.json")
@console.json_option
def scene_command(config_paths: tuple[Path, ...], out: Path, as_json: bool) -> None:
    """Measure what a scene saves of CONFIGs' bakes, and that it changes no value.

    Kernels' time, bytes and error of a fixed normal light and of a laser line at 45 degrees on a screen of 60 x 60
    degrees, beside the full bake's; and the tiles that are baked when a scene changes. Without CONFIGs: three
    synthetic surfaces.
    """
    from pipeline.evaluation.scenes import bench
    from pipeline.evaluation.speed.bench import built_in
    from pipeline.store import scratch

    scratch.require_folder(out)
    with nullcontext(config_paths) if config_paths else built_in() as paths:
        configs = [(sources.load(path), path) for path in paths]
        with console.showing_progress() as progress:
            found = bench.run(configs, progress, console.note)
    if written := _write(found, out, as_json):
        _print_scene(found)
        for path in written:
            console.say(path)


@bench_command.command("stability")
@click.option("--quick", is_flag=True, help="A part of the sweep that takes seconds.")
@_out_option("out/stability", "stability.json, stability.csv and stability.png")
@console.json_option
def stability_command(quick: bool, out: Path, as_json: bool) -> None:
    """Compare every algorithm with plain sums over samples, from 1 nm to 10 um of height.

    Surfaces, pitches, sizes, windows and directions at their extremes, in float32 and float64, Taylor and Chebyshev.
    Each test case meets the tolerance of its algorithm or is refused with a reason. Exit code 4 where one does
    neither.
    """
    from pipeline.errors import AccuracyError
    from pipeline.evaluation.stability import bench
    from pipeline.store import scratch

    scratch.require_folder(out)
    with console.showing_progress() as progress:
        found = bench.run(quick, progress)
    if written := _write(found, out, as_json):
        _print_stability(found)
        for path in written:
            console.say(path)
    if found.faults:
        raise AccuracyError(*found.faults)


@bench_command.command("figures")
@click.option("--elaphe", type=click.Path(path_type=Path), help="A config to replace Elaphe [default: synthetic].")
@click.option(
    "--xenopeltis", type=click.Path(path_type=Path), help="A config to replace Xenopeltis [default: synthetic]."
)
@click.option("--quick", is_flag=True, help="Smaller maps, fewer points.")
@_out_option("out/figures", "index.html, a page for each figure, and figures.json")
@console.store_option
@console.json_option
def figures_command(
    elaphe: Path | None, xenopeltis: Path | None, quick: bool, out: Path, store_root: Path | None, as_json: bool
) -> None:
    """Make a page for each figure and table of the literature.

    Every method of the literature side by side, with what was expected, what was measured and the verdict. It needs
    no file: snakes are synthetic where no config of a scan is given.
    """
    from pipeline.evaluation.figures import bench
    from pipeline.store import scratch

    scratch.require_folder(out)
    given = {"elaphe": elaphe, "xenopeltis": xenopeltis}
    configs = {role: (sources.load(path), str(path)) for role, path in given.items() if path}
    with console.showing_progress() as progress:
        found = bench.run(configs, quick, console.open_store(store_root), progress, console.note)
    if _write(found, out, as_json):
        _print_figures(found)
        console.say(str(out / "index.html"))


def _write(found: "Results", out: Path, as_json: bool) -> list[str]:
    """Write the results; print them as JSON, or return the files' names so that text can be printed."""
    from pipeline.evaluation import results

    written = [str(path) for path in results.write(out, found.files())]
    if as_json:
        console.print_json({**found.document(), "files": written})
        return []
    return written


def _print_rows(rows: Iterable[Any], columns: dict[str, Callable[[Any], str]]) -> None:
    """Print a table; columns: text of a row's cell by the column's name."""
    console.print_table(list(columns), [[text(row) for text in columns.values()] for row in rows])


def _print_checks(checks: "Sequence[Check]") -> None:
    _print_rows(
        checks,
        {
            "check": lambda check: check.id,
            "measured": lambda check: check.measured or "-",
            "expected": lambda check: check.expected or "-",
            "verdict": lambda check: check.verdict,
            "source": lambda check: check.source,
            "of": lambda check: f"{check.what}: {check.remark}" if check.remark else check.what,
        },
    )


def _print_scene(found: "SceneResults") -> None:
    """The cost of every table, and the checks."""
    for surface in found.surfaces:
        console.say("")
        console.say(surface.name)
        _print_rows(
            surface.costs.items(),
            {
                "table": lambda row: row[0],
                "kernels": lambda row: _ms(row[1].kernel_s),
                "bytes": lambda row: f"{row[1].bytes / 1e6:.2f} MB",
                "tiles": lambda row: f"{row[1].tiles} of {row[1].of_tiles}",
                "saved": lambda row: "" if row[1].savings is None else _saved(row[1].savings),
            },
        )
    console.say("")
    _print_checks(found.checks)


def _saved(savings: Any) -> str:
    """Shares that a scene saves, by name."""
    return ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in vars(savings).items())


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.1f} ms"


def _print_speed(found: "SpeedResults") -> None:
    """The device, every table, the stages' shares, and the criteria."""
    machine = found.machine
    console.say(
        f"{machine.device}, {machine.compute_units} compute units: {machine.single_flops / 1e9:.0f} GFLOP/s single, "
        f"{machine.double_flops / 1e9:.0f} double, {machine.bandwidth / 1e9:.1f} GB/s, measured in this run"
    )
    blocks = ", ".join(f"{name} {value}" for name, value in machine.blocks.items())
    console.say(f"vectors of {machine.vector_width} floats; the kernels' blocks for them: {blocks}")
    for surface in found.surfaces:
        _print_surface(surface, found)
    if found.constants:
        console.say("")
        _print_rows(
            found.constants,
            {
                "kernels' constant": lambda constant: constant.name,
                "value": lambda constant: str(constant.value),
                "time": lambda constant: _ms(constant.seconds),
                "other": lambda constant: str(constant.other_value),
                "time ": lambda constant: _ms(constant.other_s),
                "gain": lambda constant: f"{100.0 * (1.0 - constant.seconds / constant.other_s):.0f} %",
            },
        )
    _print_curve(found.curve)
    console.say("")
    console.say("Criteria")
    _print_checks(found.checks)


def _print_curve(curve: "GrowthCurve") -> None:
    """A row for each size, and one for each file that was read."""
    console.say("")
    console.say("gaussian recipes to the certified table, a process each; peak memory measured / predicted")
    _print_rows(
        curve.sizes,
        {
            "samples": lambda size: f"{size.side}^2, {size.size_um:g} um",
            "windows": lambda size: f"{size.windows} of sigma {size.sigma_um:g} um",
            "surface": lambda size: _stage_cost(size.cost.stage("surface")),
            "power spectrum": lambda size: _stage_cost(size.cost.stage("power_spectrum")),
            "table": lambda size: _stage_cost(size.cost.stage("table")),
            "from process start": lambda size: f"{size.cost.seconds:.3g} s",
            "grows as samples to the": lambda size: "" if size.growth is None else f"{size.growth:.2f}",
        },
    )
    for reading in curve.readings:
        cost = reading.cost.stage("surface")
        console.say(
            f"surface from .{reading.format} of {reading.side}^2 float32: {_stage_cost(cost)}, "
            f"and {cost.children_bytes / 2**20:.0f} MiB of the process that parses it"
        )
    if curve.fault:
        console.say(f"note: the rest of the curve is missing: {curve.fault}")


def _stage_cost(cost: "StageCost") -> str:
    return f"{cost.seconds:.3g} s, {cost.peak_bytes / 2**20:.0f} / {cost.predicted_bytes / 2**20:.0f} MiB"


def _print_surface(surface: "SurfaceSpeed", found: "SpeedResults") -> None:
    from pipeline.evaluation.speed.machine import share

    ny, nx = surface.samples
    console.say("")
    console.say(
        f"{surface.name}: {nx} x {ny} samples, sigma {surface.sigma_um:g} um, {surface.terms} terms; "
        f"errors over a map of {surface.map_size} x {surface.map_size}"
    )
    _print_rows(
        surface.points,
        {
            "table": lambda point: point.method,
            "grid": _grid,
            "time": lambda point: f"{point.seconds:.3g} s" + (" (scaled)" if point.scaled else ""),
            "bytes": lambda point: f"{point.bytes / 1e6:.1f} MB",
            "mean dE": lambda point: f"{point.error.mean:.3g}",
            "99th %": lambda point: f"{point.error.percentile_99:.3g}",
            "max": lambda point: f"{point.error.maximum:.3g}",
        },
    )
    console.say("")
    _print_rows(
        [share(timed, found.machine) for timed in surface.timed],
        {
            "stage": lambda reached: reached.stage,
            "time": lambda reached: _ms(reached.seconds),
            "of FMA peak": lambda reached: f"{100 * reached.peak_share:.1f} % ({reached.precision})",
            "of bandwidth": lambda reached: f"{100 * reached.bandwidth_share:.1f} %",
            "bound by": lambda reached: reached.bound,
        },
    )
    console.say("")
    # the ratio to the kernel's time, and the largest difference from the kernel's coefficients
    _print_rows(
        surface.transforms,
        {
            "the stack's transforms": lambda of: f"{of.terms} terms, {of.precision}",
            "kernel": lambda of: f"{1e3 * of.kernel_s:.0f} ms",
            "pyFFTW": lambda of: f"{1e3 * of.fftw_s:.0f} ms, {of.fftw_s / of.kernel_s:.1f} x",
            "differs": lambda of: f"{of.fftw_difference:.0e}",
            "scipy": lambda of: f"{1e3 * of.scipy_s:.0f} ms, {of.scipy_s / of.kernel_s:.1f} x",
            "differs ": lambda of: f"{of.scipy_difference:.0e}",
        },
    )
    for name, key in (("FINUFFT", "nufft"), ("plain numpy", "numpy")):
        if agreement := surface.agreement[key]:
            console.say(
                f"{name} and the kernels, on the polar table's samples: median difference {agreement.median:.1e}, "
                f"99th percentile {agreement.percentile_99:.1e}"
            )
    if surface.nufft_upsampling is not None:
        console.say(
            "FINUFFT: type 2 on the low-passed patch under the window, 1e-5, single, upsampling "
            f"{surface.nufft_upsampling:g}; FFTs count once, the rest is scaled by points"
        )
    for text in surface.notes:
        console.say(f"note: {text}")


def _grid(point: "Point") -> str:
    settings = point.settings
    if "rings" not in settings:
        return f"{settings['resolution']:.0f}^2, {settings['step_nm']:g} nm"
    textures = f", {settings['textures']} textures" if "textures" in settings else ""
    return f"{settings['rings']} x {settings['azimuths']}{textures}"


def _print_stability(found: "StabilityResults") -> None:
    """A row for each family of cases, and the criterion."""
    rows = []
    for family in dict.fromkeys(outcome.case.family for outcome in found.outcomes):
        here = [outcome for outcome in found.outcomes if outcome.case.family == family]
        counts = Counter(outcome.verdict for outcome in here)
        shares = [o.check.value / o.tolerance for o in here if o.verdict != "refused" and o.check.value is not None]
        worst = f"{100.0 * max(shares):.2g} %" if shares else ""
        rows.append([family, *(str(counts[verdict]) for verdict in ("holds", "refused", "misses")), worst])
    console.print_table(["family", "holds", "refused", "misses", "worst error, of its tolerance"], rows)
    for check in found.checks:
        console.say(f"{check.what}: {check.measured}, expected {check.expected}: {check.verdict}")
    console.say("(worst error of |P|^2 over the larger of it and a thousandth of its mean)")


def _print_figures(found: "FigureResults") -> None:
    """A row for each page, then every statement that does not hold."""
    rows = []
    for each in found.made:
        counts = Counter(check.verdict for check in each.page.checks)
        verdicts = [str(counts[verdict]) for verdict in ("holds", "misses", "reported")]
        rows.append([each.page.name, *verdicts, f"{each.seconds:.0f} s"])
    console.print_table(["page", "holds", "misses", "reported", "time"], rows)
    for each in found.made:
        for check in each.page.checks:
            if check.verdict == "misses":
                console.say(f"{each.page.name}: {check.what}: expected {check.expected}, measured {check.measured}")
