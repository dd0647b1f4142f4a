"""Peak memory of a bake, stack to table, in a process of its own.

As a script it is that process; its arguments are a file of heights, their pitch along x and y, a config and a layout
as JSON.
"""

import subprocess
import sys

import numpy as np

from pipeline import resources
from pipeline.config.models import Config
from pipeline.evaluation.speed import setting
from pipeline.store import scratch
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Mirror
from pipeline.surface.source import SurfaceSource
from pipeline.tables.polar.layout import PolarLayout

# a large scan: as fine as a snake's, and so tall that it needs 64 terms
LARGE_SIDE = 4096
_LARGE_PITCH_UM, _LARGE_HALF_RANGE_UM = 65.0 / 1332, 1.35
_SEED = 5


def peak_bytes(field: HeightField, config: Config, layout: PolarLayout) -> int:
    """Return the peak memory, bytes, of a fresh process that makes stack, power spectrum and table of a surface."""
    with scratch.temporary() as folder:
        heights = folder / "heights.npy"
        np.save(heights, field.heights_um)
        # -P: nothing is imported from the working folder
        module = [sys.executable, "-P", "-m", "pipeline.evaluation.speed.memory"]
        command = [*module, str(heights), *map(str, field.pitch_um)]
        models = [model.model_dump_json() for model in (config, layout)]
        finished = subprocess.run([*command, *models], capture_output=True, text=True, check=True)
    return int(finished.stdout)


def large_scan() -> tuple[HeightField, Config]:
    """Return a rough surface of 4096 x 4096 samples that needs 64 terms, and its config."""
    half = _LARGE_HALF_RANGE_UM
    heights = np.random.default_rng(_SEED).uniform(-half, half, (LARGE_SIDE, LARGE_SIDE))
    config = Config(name="large", surface=SurfaceSource(recipe=Mirror(kind="mirror")))
    return HeightField(heights, (_LARGE_PITCH_UM, _LARGE_PITCH_UM)), config


def _bake(arguments: list[str]) -> int:
    """Make a table and return the peak memory of this process, bytes."""
    heights, pitch_x, pitch_y, config, layout = arguments
    field = HeightField(np.load(heights), (float(pitch_x), float(pitch_y)))
    models = Config.model_validate_json(config), PolarLayout.model_validate_json(layout)
    made, chosen = setting.first_bake(field, *models)
    chosen.table(made)
    return resources.peak_bytes()


if __name__ == "__main__":
    print(_bake(sys.argv[1:]))
