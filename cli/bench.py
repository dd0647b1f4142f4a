"""`bench`: the paper-sized bake, timed."""

from dataclasses import asdict
from pathlib import Path

import click

from cli import console, sources


@click.command("bench")
@click.argument("config_path", metavar="CONFIG", type=click.Path(path_type=Path))
@console.store_option
@console.json_option
def bench_command(config_path: Path, store_root: Path | None, as_json: bool) -> None:
    """Time CONFIG's stack and table here, beside plain numpy and the device's own peak.

    Plain numpy is eq. 8-12 of Dhillon et al. 2014 as printed, run on a few nodes and scaled by their number. Peak
    is measured in the same run by chains of fused multiply-adds.
    """
    from pipeline import bench, run
    from pipeline.stages import surface

    config, store = sources.load(config_path), console.open_store(store_root)
    with console.showing_progress() as progress:
        artifacts = run.execute(config, run.plan(config, store, "surface"), store, progress)
        field = surface.load(store.open("surface", artifacts["surface"].key))
        result = bench.paper_bake(config, field, progress)
    if as_json:
        console.print_json(asdict(result))
        return
    n = config.table.resolution
    click.echo(
        f"{config.name}: {n} x {n} nodes ({result.nodes} reachable), {result.wavelengths} wavelengths, "
        f"N = {result.order}, {result.taps} coefficients a node, on {result.device}"
    )
    rows = [
        ["stack (pyFFTW)", f"{result.stack_s:.3f} s", ""],
        [
            "table (kernel)",
            f"{result.table_s:.3f} s",
            _rate(result.floating_point_operations / result.table_s),
        ],
        [
            "device peak",
            "",
            f"{_rate(result.peak_flops)}: the kernel reaches {100 * result.table_share:.0f} %",
        ],
        ["plain numpy", f"{result.numpy_s:.0f} s", f"from {result.sample_nodes} nodes, scaled by work"],
        ["speed-up", f"{result.speedup:.0f} x", "stack and table together"],
        ["agreement", f"{result.agreement:.1e}", "kernel against numpy, share of the largest I_p"],
    ]
    console.print_table(["what", "value", ""], rows)


def _rate(flops: float) -> str:
    return f"{flops / 1e9:.0f} GFLOP/s (double)"
