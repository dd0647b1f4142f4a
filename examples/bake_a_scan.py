"""Bakes the example scan of configs/ with the API.

    python examples/bake_a_scan.py FOLDER

It takes seconds, because the maps are small and the error budget is wide. configs/scan.toml explains every key.
"""

import sys
from pathlib import Path

from pipeline import bake, load_scan
from pipeline.config.models import Config
from pipeline.errors import BakeError

SCAN = Path(__file__).resolve().parents[1] / "configs" / "example_scan.txt"


def main(folder: Path) -> None:
    # clips spikes of dust, six times as high as the relief
    cleaning = {"level": "plane", "clip_percentile": (0.05, 99.9)}
    field = load_scan(SCAN, **cleaning)
    rows, columns = field.shape
    print(f"{SCAN.name}: {columns} x {rows} samples, {2e3 * field.half_range_um:.0f} nm from lowest to highest")

    # the keys of a TOML config
    config = Config.model_validate(
        {
            "name": "example",
            "surface": {"path": str(SCAN), **cleaning},
            "coherence": {"sigma_um": 4.0},
            "accuracy": {"delta_e": 1.0},
            "render": {"size": 64},
        }
    )
    baked = bake(config, out=folder)
    budget = baked.measured_error["budget"]
    print(f"mean CIELAB {budget['measured']:.2g} at {budget['exposure_ru']:g} RU, allowed {budget['delta_e']:g}")
    for path in (*baked.maps, baked.report, baked.bundle):
        print(path)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python bake_a_scan.py FOLDER")
    try:
        main(Path(sys.argv[1]))
    except BakeError as error:
        sys.exit(str(error))
