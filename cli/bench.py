"""`bench`: run time against error of every way to the same pictures."""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from cli import console, sources

# what comes with the tool, where no config is named: each recipe with its defaults
_BUILT_IN = ("elaphe", "xenopeltis", "blazed")
_PROCESS = "from cli.main import process; process()"
_WHOLE_RUNS = 6


@click.command("bench")
@click.argument("config_paths", metavar="[CONFIG]...", type=click.Path(path_type=Path), nargs=-1)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("out/bench"),
    show_default=True,
    help="Folder for bench.json, bench.csv and bench.png.",
)
@click.option("--quick", is_flag=True, help="Smaller maps and samples; no processes, no 4096 x 4096 scan.")
@console.store_option
@console.json_option
def bench_command(
    config_paths: tuple[Path, ...], out: Path, quick: bool, store_root: Path | None, as_json: bool
) -> None:
    """Time CONFIGs' surfaces here, error against seconds and bytes.

    The paper's tables over their parameters, the polar table over its own, the same polar table by FINUFFT and both
    in plain numpy, each with its mean CIELAB error at 7500 RU; the stages' shares of the device's peak and
    bandwidth, which are measured in the same run; the stack's transforms by the kernel, pyFFTW and scipy; what each
    constant of the kernels buys; and what compiling costs. Without CONFIGs: three synthetic surfaces.
    """
    from pipeline.evaluation.speed import criteria, files, machine
    from pipeline.evaluation.stability import judging, sweep
    from pipeline.store.store import writing

    store = console.open_store(store_root)
    with _paths(config_paths) as paths:
        configs = [sources.load(path) for path in paths]
        # better told now than after minutes of work
        with writing(out):
            out.mkdir(parents=True, exist_ok=True)
        console.note("device:")
        measured = machine.measure()
        found = []
        for config, path in zip(configs, paths, strict=True):
            console.note(f"{config.name}:")
            found.append(_surface(config, path, store, quick))
            measured = machine.best(measured, machine.measure())
        constants = [] if quick else _constants(configs[0], store)
    judged = [c for bench, whole_run_s in found for c in criteria.of_surface(bench, measured, whole_run_s)]
    judged += [*criteria.of_series(judging.criterion(judging.sweep(sweep.tall()))), _large_scan(quick)]
    judged += criteria.of_compiling(None if quick else _compiling())
    results = files.Results(measured, [bench for bench, _ in found], constants, judged)
    written = _write(results, out)
    if as_json:
        console.print_json({**files.document(results), "files": [str(path) for path in written]})
        return
    _tell(results)
    for path in written:
        click.echo(str(path))


@contextmanager
def _paths(given: tuple[Path, ...]) -> Iterator[tuple[Path, ...]]:
    """The configs given, or the built-in ones for as long as they are needed."""
    if given:
        yield given
        return
    with tempfile.TemporaryDirectory() as folder:
        paths = tuple(Path(folder) / f"{name}.toml" for name in _BUILT_IN)
        for name, path in zip(_BUILT_IN, paths, strict=True):
            path.write_text(f'name = "{name}"\n[surface]\nrecipe = {{ kind = "{name}" }}\n', encoding="utf-8")
        yield paths


def _surface(config: Any, path: Path, store: Any, quick: bool) -> tuple[Any, float | None]:
    """One surface's measurements, and the seconds of a whole run."""
    from pipeline.evaluation.speed import suite

    with console.showing_progress() as progress:
        field = _field(config, store, progress)
        effort = suite.QUICK if quick else suite.FULL
        found = suite.run(config, field, effort, progress)
        return found, None if quick else _whole_run(path, progress)


def _field(config: Any, store: Any, progress: Any) -> Any:
    """The height field of a config."""
    from pipeline.stages import run, surface

    artifacts = run.execute(config, run.plan(config, store, "surface"), store, progress)
    return surface.load(store.open("surface", artifacts["surface"].key))


def _constants(config: Any, store: Any) -> Any:
    """What each constant of the kernels buys on a surface."""
    from pipeline.evaluation.speed import constants, setting
    from pipeline.evaluation.speed.suite import FULL, MAIN

    console.note("constants of the kernels:")
    with console.showing_progress() as progress:
        of = setting.make(_field(config, store, progress), config, MAIN)
        return constants.measure(of, FULL.bakes, progress)


def _compiling() -> Any:
    """What a new machine waits for; None where a run failed."""
    from pipeline.evaluation.speed import compiling
    from pipeline.evaluation.speed.processes import RunFailedError

    console.note("a new machine:")
    try:
        with console.showing_progress() as progress:
            return compiling.measure(_command_line(), progress)
    except RunFailedError as error:
        console.warn(f"a run on a new kernel cache failed: {error}")
        return None


def _command_line() -> Any:
    from pipeline.evaluation.speed.processes import CommandLine

    return CommandLine((sys.executable, "-c", _PROCESS))


def _whole_run(path: Path, progress: Any) -> float | None:
    """Seconds of a fresh `run --until table` with an empty store and warm kernels; None where it fails.

    The first fills the kernel cache; the fastest of the others counts.
    """
    from pipeline.evaluation.speed.processes import RunFailedError

    seconds: list[float] = []
    try:
        for i in range(_WHOLE_RUNS):
            seconds.append(_command_line().run(path, until="table").seconds)
            progress("whole runs", (i + 1) / _WHOLE_RUNS)
    except RunFailedError as error:
        console.warn(f"{path}: run --until table failed: {error}")
        return None
    return min(seconds[1:])


def _large_scan(quick: bool) -> Any:
    from pipeline.evaluation.speed import criteria, memory
    from pipeline.evaluation.speed.suite import MAIN

    if quick:
        return criteria.of_large_scan(None)
    console.note(f"{memory.LARGE_SIDE} x {memory.LARGE_SIDE} samples, 64 terms:")
    return criteria.of_large_scan(memory.peak_bytes(*memory.large_scan(), MAIN))


def _write(results: Any, out: Path) -> list[Path]:
    """bench.json, bench.csv and bench.png in `out`, each taking its place whole."""
    from pipeline.evaluation.plots import bench_plots
    from pipeline.evaluation.speed import files, truth
    from pipeline.store import scratch
    from pipeline.store.store import writing

    contents = {
        "bench.json": files.json_text(results).encode(),
        "bench.csv": files.csv_text(results).encode(),
        "bench.png": bench_plots.error_against_cost(results.surfaces, truth.EXPOSURE_RU),
    }
    with writing(out), scratch.replacing(out) as beside:
        for name, content in contents.items():
            (beside / name).write_bytes(content)
    return [out / name for name in contents]


def _tell(results: Any) -> None:
    """The device, every table, the stages' shares, and the criteria."""
    machine = results.machine
    click.echo(
        f"{machine.device}, {machine.compute_units} compute units: {machine.single_flops / 1e9:.0f} GFLOP/s single, "
        f"{machine.double_flops / 1e9:.0f} double, {machine.bandwidth / 1e9:.1f} GB/s, measured in this run"
    )
    for surface in results.surfaces:
        _tell_surface(surface, machine)
    if results.constants:
        click.echo("")
        console.print_table(
            ["kernels' constant", "value", "time", "instead", "time", "buys"],
            [_constant_row(constant) for constant in results.constants],
        )
    click.echo("\nCriteria")
    console.print_table(
        ["surface", "no.", "what", "measured", "asked", "verdict", ""],
        [[c.surface, c.number, c.what, _measured(c), _asked(c), c.verdict, c.remark] for c in results.criteria],
    )


def _measured(criterion: Any) -> str:
    return "-" if criterion.measured is None else f"{criterion.measured:.3g} {criterion.unit}"


def _asked(criterion: Any) -> str:
    return "-" if criterion.limit is None else f"{criterion.sense} {criterion.limit:.3g} {criterion.unit}"


def _tell_surface(surface: Any, machine: Any) -> None:
    from pipeline.evaluation.speed.machine import share

    ny, nx = surface.samples
    click.echo(
        f"\n{surface.name}: {nx} x {ny} samples, sigma {surface.sigma_um:g} um, {surface.terms} terms; "
        f"errors over a map of {surface.map_size} x {surface.map_size}"
    )
    console.print_table(
        ["table", "grid", "time", "bytes", "mean dE", "99th %", "max"], [_point_row(p) for p in surface.points]
    )
    click.echo("")
    console.print_table(
        ["stage", "time", "of FMA peak", "of bandwidth", "bound by"],
        [
            [
                reached.stage,
                f"{1e3 * reached.seconds:.1f} ms",
                f"{100 * reached.peak_share:.1f} % ({reached.precision})",
                f"{100 * reached.bandwidth_share:.1f} %",
                reached.bound,
            ]
            for reached in (share(timed, machine) for timed in surface.timed)
        ],
    )
    click.echo("")
    console.print_table(
        ["the stack's transforms", "kernel", "pyFFTW", "", "differs", "scipy", "", "differs"],
        [_transforms_row(of) for of in surface.transforms],
    )
    for text in _remarks(surface):
        click.echo(text)


def _transforms_row(of: Any) -> list[str]:
    """Each route's time, its ratio to the kernel's, and its largest difference from the kernel's coefficients."""
    row = [f"{of.terms} terms, {of.precision}", f"{1e3 * of.kernel_s:.0f} ms"]
    for seconds, difference in ((of.fftw_s, of.fftw_difference), (of.scipy_s, of.scipy_difference)):
        row += [f"{1e3 * seconds:.0f} ms", f"{seconds / of.kernel_s:.1f} x", f"{difference:.0e}"]
    return row


def _constant_row(constant: Any) -> list[str]:
    """A constant's kernels with its value and with another, and the share of their time that it saves."""
    here, other = constant.seconds, constant.other_s
    return [
        constant.name,
        f"{constant.value}",
        f"{1e3 * here:.1f} ms",
        f"{constant.other_value}",
        f"{1e3 * other:.1f} ms",
        f"{100.0 * (1.0 - here / other):.0f} %",
    ]


def _point_row(point: Any) -> list[str]:
    settings = point.settings
    if "rings" in settings:
        grid = f"{settings['rings']} x {settings['azimuths']}"
    else:
        grid = f"{settings['resolution']:.0f}^2, {settings['step_nm']:g} nm"
    if "textures" in settings:
        grid += f", {settings['textures']} textures"
    seconds = f"{point.seconds:.3g} s" + (" (scaled)" if point.scaled else "")
    error = point.error
    numbers = (f"{value:.3g}" for value in (error.mean, error.percentile_99, error.maximum))
    return [point.method, grid, seconds, f"{point.bytes / 1e6:.1f} MB", *numbers]


def _remarks(surface: Any) -> list[str]:
    """How the ways to the same numbers agree, and what was left out."""
    lines = []
    for name, agreement in (("FINUFFT", surface.agreement.nufft), ("plain numpy", surface.agreement.numpy)):
        if agreement is not None:
            lines.append(
                f"{name} and the kernels, on the polar table's samples: median difference {agreement.median:.1e}, "
                f"99th percentile {agreement.percentile_99:.1e}"
            )
    if surface.nufft_upsampling is not None:
        lines.append(
            f"FINUFFT: type 2 on the low-passed patch under the window, 1e-5, single, upsampling "
            f"{surface.nufft_upsampling:g}; FFTs count once, the rest is scaled by points"
        )
    return [*lines, *(f"note: {text}" for text in surface.notes)]
