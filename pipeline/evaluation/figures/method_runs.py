"""Maps of a surface at normal incidence by every method, with their run times."""

from dataclasses import dataclass

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.evaluation.figures.maps import NORMAL, directions, views_of
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.method import Method
from pipeline.evaluation.speed.timing import timed
from pipeline.tables.evaluate import Map

# enough to compile what a method runs on the device
_WARM_UP = Map(11, MAP_RADIUS)


@dataclass(frozen=True)
class Run:
    """A prepared method, XYZ of its map (views, 3), and the seconds of either."""

    name: str
    method: Method
    xyz: Array
    prepare_s: float
    map_s: float

    @property
    def total_s(self) -> float:
        return self.prepare_s + self.map_s


def run(name: str, surface: BenchSurface, views: Map) -> Run:
    """Run a method of the catalogue, from the height field to the map at normal incidence."""
    method, prepare_s = timed(lambda: METHODS[name](surface.field, surface.config))
    wi, wr = directions(views, NORMAL)
    xyz, map_s = timed(lambda: method.xyz(wi, wr))
    return Run(name, method, xyz, prepare_s, map_s)


def on_elaphe(bench: Bench, name: str) -> Run:
    """Run a method on the bench's Elaphe, its kernels compiled beforehand; once for all pages."""
    if name not in bench.runs:
        run(name, bench.elaphe, _WARM_UP)
        bench.runs[name] = run(name, bench.elaphe, views_of(bench))
    return bench.runs[name]
