"""Every method by its name. Modules are imported when their method is made."""

from importlib import import_module

from pipeline.config.models import Config
from pipeline.evaluation.methods.method import Maker, Method
from pipeline.surface.heightfield import HeightField

EXACT, OURS = "exact", "polar table"
PAPER_REFERENCE, PAPER = "D14 reference", "D14 look-up"
FLSS, NMM, PQ = "FLSS", "NMM", "PQ"
STAM, BUMPS, GEMS = "Stam Gaussian", "Stam bumps", "GPU Gems"


def _maker(module: str, name: str) -> Maker:
    def make(field: HeightField, config: Config) -> Method:
        method: Method = getattr(import_module(f"pipeline.evaluation.methods.{module}"), name)(field, config)
        return method

    return make


# this project's own first, then from the nearest relative to the farthest
METHODS: dict[str, Maker] = {
    EXACT: _maker("exact", "Exact"),
    OURS: _maker("polar_table", "PolarTableMethod"),
    PAPER_REFERENCE: _maker("paper_reference", "PaperReference"),
    PAPER: _maker("paper_look_up", "PaperLookUp"),
    FLSS: _maker("flss", "Flss"),
    NMM: _maker("nmm", "Nmm"),
    PQ: _maker("pq", "Pq"),
    STAM: _maker("stam_gaussian", "StamGaussian"),
    BUMPS: _maker("stam_bumps", "StamBumps"),
    GEMS: _maker("gems", "Gems"),
}
