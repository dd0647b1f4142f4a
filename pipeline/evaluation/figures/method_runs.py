"""Methods at work on a surface: their maps at normal incidence, with what they cost."""

from dataclasses import dataclass

from pipeline.accuracy.checks import MAP_RADIUS
from pipeline.arrays import Array
from pipeline.evaluation.figures.exact_maps import NORMAL, directions, views_of
from pipeline.evaluation.figures.figure import Bench, Surface
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.method import Method, prepare
from pipeline.evaluation.speed.timing import timed
from pipeline.tables.evaluate import Map

EXACT_NAME, OURS, PAPER = "exact", "polar table", "D14 look-up"
# enough to compile what a method runs on the device
_WARM_UP = Map(11, MAP_RADIUS)


@dataclass(frozen=True)
class Run:
    """A method made ready, XYZ of its map (views, 3), and the seconds of either."""

    name: str
    method: Method
    xyz: Array
    prepare_s: float
    map_s: float

    @property
    def total_s(self) -> float:
        return self.prepare_s + self.map_s


def run(name: str, surface: Surface, views: Map) -> Run:
    """A method of the catalogue, from the height field to the map at normal incidence."""
    prepared = prepare(METHODS[name], surface.field, surface.config)
    wi, wr = directions(views, NORMAL)
    xyz, map_s = timed(lambda: prepared.method.xyz(wi, wr))
    return Run(name, prepared.method, xyz, prepared.seconds, map_s)


def on_elaphe(bench: Bench, name: str) -> Run:
    """A method of the catalogue on the bench's Elaphe, its kernels compiled beforehand; made once for all pages."""
    if name not in bench.runs:
        run(name, bench.elaphe, _WARM_UP)
        bench.runs[name] = run(name, bench.elaphe, views_of(bench))
    return bench.runs[name]
