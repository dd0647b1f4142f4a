"""Growth of cost with the scan: seconds and peak memory of each stage, from scan to certified table, over its size.

The surfaces are `gaussian` recipes of one pitch, as fine as a snake's scan. The window is the default one, four sigma
wide at most; a patch that does not hold it has a window as wide as itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from pipeline.config.models import Config
from pipeline.evaluation.speed import stage_costs
from pipeline.evaluation.speed.processes import RunFailedError
from pipeline.evaluation.speed.stage_costs import BakeCost
from pipeline.optics.coherence import Coherence
from pipeline.progress import Progress, silent
from pipeline.resources import MIB
from pipeline.store import scratch
from pipeline.surface import recipes, windows
from pipeline.surface.recipes.parameters import GaussianRandom
from pipeline.surface.source import SurfaceSource

SIDES = (512, 1024, 2048, 4096, 8192)
PITCH_UM = 25.0 / 512
STAGES = ("surface", "power_spectrum", "table")
FORMATS = ("npy", "tif")
COLUMNS = (
    *("side", "size_um", "sigma_um", "windows", "growth", "process_s"),
    *(f"{stage}_{of}" for stage in STAGES for of in ("s", "mib", "predicted_mib")),
)
# larger scans are baked once: they take long enough for a steady time
_REPEATED = 2048
# a scan file repeats a smaller patch, which is periodic
_TILE = 1024


@dataclass(frozen=True)
class ScanCost:
    """The cost of a scan of side x side samples.

    sigma_um, windows: width of the coherence window, and the number of those averaged. growth: exponent with which
    the seconds of all stages grow with samples since the next smaller size; None for the smallest.
    """

    side: int
    size_um: float
    sigma_um: float
    windows: int
    cost: BakeCost
    growth: float | None


@dataclass(frozen=True)
class Reading:
    """The cost of the surface stage of a scan file of side x side float32 samples, uncompressed."""

    format: str
    side: int
    cost: BakeCost

    @property
    def seconds(self) -> float:
        """Seconds of the surface stage."""
        return self.cost.stage("surface").seconds

    @property
    def peak_bytes(self) -> int:
        """The most memory that the process and the one that parses the file held, as if both did so at once."""
        surface = self.cost.stage("surface")
        return surface.peak_bytes + surface.children_bytes


@dataclass(frozen=True)
class GrowthCurve:
    """The costs of all sizes, in order, and of reading the largest. fault: why sizes or files are missing."""

    sizes: list[ScanCost]
    readings: list[Reading]
    fault: str = ""

    def size(self, side: int) -> ScanCost | None:
        """Return the size of a side, where it was measured."""
        return next((size for size in self.sizes if size.side == side), None)

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a size, for CSV and text."""
        return [_row(size) for size in self.sizes]


def measure(sides: Sequence[int], repeats: int, formats: Sequence[str], progress: Progress = silent) -> GrowthCurve:
    """Bake `gaussian` recipes of rising sides up to the table, each in a process of its own, and read the largest.

    repeats: bakes of each of up to 2048 x 2048 samples, of which the fastest counts: other processes only add.
    formats: of the files that hold a scan of the last side, some of `FORMATS`.
    """
    sizes: list[ScanCost] = []
    readings: list[Reading] = []
    total = sum(side**2 for side in sides)
    try:
        for side in sides:
            sizes.append(_measured(side, repeats if side <= _REPEATED else 1, sizes[-1] if sizes else None))
            progress("growth", sum(size.side**2 for size in sizes) / total)
        for kind in formats:
            readings.append(read(kind, sides[-1]))
    except RunFailedError as error:
        return GrowthCurve(sizes, readings, str(error))
    return GrowthCurve(sizes, readings)


def read(kind: str, side: int) -> Reading:
    """Run the surface stage of a scan file of a format, its heights in um. Raises RunFailedError."""
    with scratch.temporary() as folder:
        path = folder / f"scan.{kind}"
        _write(path, side)
        source = SurfaceSource(path=str(path), pitch_um=PITCH_UM, height_unit="um")
        return Reading(kind, side, stage_costs.measure(_config(side, source), "surface"))


def growth(before: BakeCost, before_side: int, after: BakeCost, after_side: int) -> float:
    """Return the exponent with which the seconds of all stages grow with the number of samples."""
    return log(after.stages_s / before.stages_s) / (2.0 * log(after_side / before_side))


def _config(side: int, surface: SurfaceSource) -> Config:
    default = Coherence().sigma_um
    sigma_um = min(default, side * PITCH_UM / windows.WIDTH_SIGMAS)
    return Config(name=f"gaussian{side}", surface=surface, coherence=Coherence(sigma_um=sigma_um))


def _recipe(side: int) -> GaussianRandom:
    return GaussianRandom(kind="gaussian", size_um=side * PITCH_UM, pitch_um=PITCH_UM)


def _measured(side: int, repeats: int, before: ScanCost | None) -> ScanCost:
    recipe = _recipe(side)
    config = _config(side, SurfaceSource(recipe=recipe))
    bakes = [stage_costs.measure(config, STAGES[-1]) for _ in range(repeats)]
    cost = min(bakes, key=lambda bake: bake.stages_s)
    count = windows.places(recipes.extent(recipe), config.coherence).count
    exponent = None if before is None else growth(before.cost, before.side, cost, side)
    return ScanCost(side, side * PITCH_UM, config.coherence.sigma_um, count, cost, exponent)


def _write(path: Path, side: int) -> None:
    tile = recipes.make(_recipe(min(side, _TILE))).heights_um.astype(np.float32)
    heights = np.tile(tile, (side // len(tile),) * 2)
    if path.suffix == ".npy":
        np.save(path, heights)
    else:
        Image.fromarray(heights).save(path)


def _row(size: ScanCost) -> dict[str, Any]:
    row: dict[str, Any] = {"side": size.side, "size_um": size.size_um, "sigma_um": size.sigma_um}
    row |= {"windows": size.windows, "process_s": size.cost.seconds, "growth": size.growth}
    for stage in size.cost.stages:
        row[f"{stage.stage}_s"] = stage.seconds
        row[f"{stage.stage}_mib"] = stage.peak_bytes / MIB
        row[f"{stage.stage}_predicted_mib"] = stage.predicted_bytes / MIB
    return row
