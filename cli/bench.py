"""`bench`: run time against error of every way to the same pictures."""

import subprocess
import sys
import tempfile
import time
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
    bandwidth, which are measured in the same run; and the stack's transforms by the kernel, pyFFTW and scipy.
    Without CONFIGs: three synthetic surfaces.
    """
    from pipeline.bench import criteria, files, machine
    from pipeline.store import writing
    from pipeline.stress import judging, sweep

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
    judged = [c for bench, whole_run_s in found for c in criteria.of_surface(bench, measured, whole_run_s)]
    judged += [*criteria.of_series(judging.criterion(judging.sweep(sweep.tall()))), _large_scan(quick)]
    results = files.Results(measured, [bench for bench, _ in found], judged)
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
    from pipeline import run
    from pipeline.bench import suite
    from pipeline.stages import surface

    with console.showing_progress() as progress:
        artifacts = run.execute(config, run.plan(config, store, "surface"), store, progress)
        field = surface.load(store.open("surface", artifacts["surface"].key))
        effort = suite.QUICK if quick else suite.FULL
        found = suite.run(config, field, effort, progress)
        return found, None if quick else _whole_run(path, progress)


def _whole_run(path: Path, progress: Any) -> float | None:
    """Seconds of a fresh `run --until table` with an empty store and warm kernels; None where it fails.

    The first fills the kernel cache; the fastest of the others counts.
    """
    seconds = []
    for i in range(_WHOLE_RUNS):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", _PROCESS, "run", str(path), "--until", "table"]
            started = time.perf_counter()
            done = subprocess.run(
                [*command, "--store", f"{folder}/store", "--out", f"{folder}/out"],
                capture_output=True,
                text=True,
                check=False,
            )
            seconds.append(time.perf_counter() - started)
        if done.returncode != 0:
            console.warn(f"{path}: run --until table failed: {done.stderr.strip().splitlines()[-1]}")
            return None
        progress("whole runs", (i + 1) / _WHOLE_RUNS)
    return min(seconds[1:])


def _large_scan(quick: bool) -> Any:
    from pipeline.bench import criteria, memory
    from pipeline.bench.suite import MAIN

    if quick:
        return criteria.of_large_scan(None)
    console.note(f"{memory.LARGE_SIDE} x {memory.LARGE_SIDE} samples, 64 terms:")
    return criteria.of_large_scan(memory.peak_bytes(*memory.large_scan(), MAIN))


def _write(results: Any, out: Path) -> list[Path]:
    """bench.json, bench.csv and bench.png in `out`, each taking its place whole."""
    from pipeline import scratch
    from pipeline.bench import files, truth
    from pipeline.report import bench_plots
    from pipeline.store import writing

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
    from pipeline.bench.machine import share

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
