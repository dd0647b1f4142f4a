"""Pictures of the validation report."""

import numpy as np

from pipeline.accuracy import plots
from pipeline.accuracy.checks import MAP_RADIUS, MAP_SIZE, MapCheck
from pipeline.tables.evaluate import Map


def _check(seed: int, brightness: float) -> MapCheck:
    rng, shape = np.random.default_rng(seed), (MAP_SIZE, MAP_SIZE)
    table, reference = (brightness * rng.random((*shape, 3)) for _ in range(2))
    return MapCheck(Map(MAP_SIZE, MAP_RADIUS), table, reference, rng.random(shape), [], [])


def test_a_comparison_does_not_depend_on_those_drawn_before() -> None:
    """All share one figure, which is filled for each."""
    plots._comparison.cache_clear()
    alone = plots.map_comparison(_check(1, 0.1), 1.0, 1000.0, "light 0°, 0°")
    other = plots.map_comparison(_check(2, 3.0), 7500.0, 1.0, "light 30°, 180°")
    assert other != alone
    assert plots.map_comparison(_check(1, 0.1), 1.0, 1000.0, "light 0°, 0°") == alone
