"""A polar table baked by the stages, on directions that its certificate never saw."""

from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pipeline import layouts
from pipeline.accuracy.exact import reference_evaluator
from pipeline.arrays import Array
from pipeline.config.models import Accuracy, Config
from pipeline.evaluation.stability.cell import SEED, Cell
from pipeline.evaluation.stability.reading import NO_DIGITS
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.colour import delta_e
from pipeline.optics.random_directions import random_pairs
from pipeline.stages import run, surface
from pipeline.store.store import Store
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Mirror
from pipeline.surface.source import SurfaceSource
from pipeline.tables.evaluate import table_evaluator

TABLE_DELTA_E = 0.5


def _config(cell: Cell, heights: Path) -> Config:
    """What a table cell is baked and certified under, its surface in a file; a file of one height is refused."""
    if cell.kind == "flat":
        (ny, nx), (px, py) = cell.shape, cell.pitch_um
        section = SurfaceSource(recipe=Mirror(kind="mirror", size_um=(nx * px, ny * py), pitch_um=cell.pitch_um))
    else:
        section = SurfaceSource(path=str(heights), height_unit="um", pitch_um=cell.pitch_um, level="none")
    coherence, accuracy = Coherence(sigma_um=cell.sigma_um), Accuracy(delta_e=TABLE_DELTA_E)
    return Config(name="stress", surface=section, coherence=coherence, accuracy=accuracy)


def table_error(cell: Cell, field: HeightField) -> float:
    """Mean CIELAB error of a baked polar table on fresh directions; NO_DIGITS where a look-up is not finite.

    Raises AccuracyError where the plan or the certificate refuses.
    """
    with TemporaryDirectory() as folder:
        heights = Path(folder) / "heights.npy"
        np.save(heights, field.heights_um)
        config, store = _config(cell, heights), Store(Path(folder) / "store")
        made = run.execute(config, run.plan(config, store, "table"), store)
        baked = layouts.of(config.table).load(store.open("table", made["table"].key))
        field = surface.load(store.open("surface", made["surface"].key))
    evaluate = table_evaluator(baked, config.radiometry)
    wi, wr = random_pairs(None, 1000, SEED)
    found = evaluate(wi, wr)
    if not (np.all(np.isfinite(found)) and np.all(np.isfinite(evaluate(*_extreme_pairs())))):
        return NO_DIGITS
    return float(np.mean(delta_e(found, reference_evaluator(field, config)(wi, wr), config.accuracy.exposure_ru)))


def _extreme_pairs() -> tuple[Array, Array]:
    """Normal, mirror and retro-reflecting pairs up to a millionth of a radian above the surface."""
    theta = np.array([0.0, 0.5, 1.5, pi / 2 - 1e-6])
    phi = np.array([0.0, pi / 2, 3.0, -2.0])
    wi = geometry.direction(np.repeat(theta, 2), np.repeat(phi, 2))
    there_and_back = np.tile([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]], (len(theta), 1))
    return wi, wi * there_and_back
