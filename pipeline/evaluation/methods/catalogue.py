"""Every method by its name."""

from collections.abc import Callable

from pipeline.config.models import Config
from pipeline.evaluation.methods.flss import Flss, Pq
from pipeline.evaluation.methods.gems import Gems
from pipeline.evaluation.methods.method import Method
from pipeline.evaluation.methods.nmm import Nmm
from pipeline.evaluation.methods.own_methods import Exact, PolarTableMethod
from pipeline.evaluation.methods.paper_shaders import PaperLookUp, PaperReference
from pipeline.evaluation.methods.stam_bumps import StamBumps
from pipeline.evaluation.methods.stam_gaussian import StamGaussian
from pipeline.surface.heightfield import HeightField

EXACT, OURS = "exact", "polar table"
PAPER_REFERENCE, PAPER = "D14 reference", "D14 look-up"
FLSS, NMM, PQ = "FLSS", "NMM", "PQ"
STAM, BUMPS, GEMS = "Stam Gaussian", "Stam bumps", "GPU Gems"

# this project's own first, then from the nearest relative to the farthest
METHODS: dict[str, Callable[[HeightField, Config], Method]] = {
    EXACT: Exact,
    OURS: PolarTableMethod,
    PAPER_REFERENCE: PaperReference,
    PAPER: PaperLookUp,
    FLSS: Flss,
    NMM: Nmm,
    PQ: Pq,
    STAM: StamGaussian,
    BUMPS: StamBumps,
    GEMS: Gems,
}
