"""Methods at work on a surface: their maps at normal incidence, with what they cost."""

from dataclasses import dataclass

from pipeline.bench.timing import timed
from pipeline.evaluate import Map
from pipeline.figures.exact_maps import NORMAL, directions
from pipeline.figures.figure import Surface
from pipeline.methods.catalogue import METHODS
from pipeline.methods.method import Method, prepare
from pipeline.optics.geometry import Array

EXACT_NAME, OURS, PAPER = "exact", "polar table", "D14 look-up"


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
