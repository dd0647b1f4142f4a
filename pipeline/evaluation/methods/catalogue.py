"""Every method by its name. Modules are imported when their method is made."""

from importlib import import_module

from pipeline.config.models import Config
from pipeline.evaluation.methods.method import Maker, Method
from pipeline.surface.heightfield import HeightField


def _maker(module: str, name: str) -> Maker:
    def make(field: HeightField, config: Config) -> Method:
        method: Method = getattr(import_module(f"pipeline.evaluation.methods.{module}"), name)(field, config)
        return method

    return make


METHODS: dict[str, Maker] = {
    "FLSS": _maker("flss", "Flss"),
    "NMM": _maker("nmm", "Nmm"),
    "PQ": _maker("pq", "Pq"),
    "D14 reference": _maker("paper_reference", "PaperReference"),
    "D14 look-up": _maker("paper_look_up", "PaperLookUp"),
    "Stam bumps": _maker("stam_bumps", "StamBumps"),
    "Stam Gaussian": _maker("stam_gaussian", "StamGaussian"),
    "GPU Gems": _maker("gems", "Gems"),
    "exact": _maker("exact", "Exact"),
    "polar table": _maker("polar_table", "PolarTableMethod"),
}
