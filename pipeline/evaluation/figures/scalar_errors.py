"""First orders of gratings by coupled waves and by the scalar model, over a grid of cases."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from math import pi
from multiprocessing import get_context

import numpy as np

from pipeline.accuracy import scalar_domain
from pipeline.arrays import Array
from pipeline.evaluation.figures import coupled_wave
from pipeline.evaluation.figures.coupled_wave import Profile
from pipeline.optics import fresnel, geometry, gratings
from pipeline.progress import Progress

# aluminium at 633 nm (Rakic 1995); the default material's ior, its k a regularisation
METAL, DIELECTRIC = "aluminium", "n = 1.5"
INDICES = {METAL: 1.37 + 7.62j, DIELECTRIC: 1.5 + 1e-6j}
# u = lambda / period: where a blaze rising towards +x sends light that travels towards +x
_ORDER = 1
# of processes: one thread of BLAS each, because small matrices lose far more to threads than they gain; and no import
# from the working folder
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "PYTHONSAFEPATH": "1"}


def cosine(x: Array) -> Array:
    """Return a sinusoid between 0 and 1."""
    return np.asarray(0.5 - 0.5 * np.cos(2.0 * pi * x))


def sawtooth(x: Array) -> Array:
    """Return a blaze that rises towards +x from 0 to 1."""
    return x


@dataclass(frozen=True)
class Shape:
    """A profile.

    columns: of the coarser staircase, whose layers a symmetric profile halves. quoted: errors of its class. power:
    |c_1|^2 at s = k w and depths from crest to valley.
    """

    profile: Profile
    columns: int
    quoted: tuple[tuple[float, ...], ...]
    power: Callable[[Array, Array], Array]


SHAPES = {
    "sinusoid": Shape(cosine, 24, scalar_domain.SMOOTH, lambda s, depth: gratings.sinusoid(_ORDER, s, 0.5 * depth)),
    "blaze": Shape(sawtooth, 16, scalar_domain.EDGED, lambda s, depth: gratings.blaze(_ORDER, s, depth)),
}


@dataclass(frozen=True)
class GratingCase:
    """One grating of many depths."""

    shape: str
    material: str
    theta_deg: float
    period: float

    @property
    def wi(self) -> Array:
        """Direction to the light (3,), which travels towards +x."""
        theta = np.radians(self.theta_deg)
        return np.array([-np.sin(theta), 0.0, np.cos(theta)])


@dataclass(frozen=True)
class Efficiencies:
    """First order (depths,), of what the flat surface reflects: rigorous, ours, and |c_1|^2 alone."""

    te: Array
    tm: Array
    scalar: Array
    bare: Array

    @property
    def rigorous(self) -> Array:
        """Of unpolarised light."""
        return 0.5 * (self.te + self.tm)

    @property
    def error(self) -> Array:
        """Ours minus the rigorous one, of unpolarised light."""
        return self.scalar - self.rigorous

    @property
    def bare_error(self) -> Array:
        """|c_1|^2 alone minus the rigorous one."""
        return self.bare - self.rigorous


def scalar(case: GratingCase, depths: Array) -> tuple[Array, Array]:
    """Return R(half angle) |c_1|^2 G / w^2 over R(ti), the BRDF of the order's lobe, and |c_1|^2, (depths,) each."""
    wi = case.wi
    wr = gratings.view_of_order(wi, float(_ORDER), 1.0 / case.period)
    bare = SHAPES[case.shape].power(2.0 * pi * geometry.uvw(wi, wr)[2], depths)
    index = INDICES[case.material]
    reflected = fresnel.reflectance(geometry.cos_half(wi, wr), index) / fresnel.reflectance(wi[2], index)
    return reflected * gratings.efficiency(bare, wi, wr), bare


def solve(case: GratingCase, depths: Array) -> Efficiencies:
    """Solve one case, rigorously and by the scalar model."""
    index, theta, shape = INDICES[case.material], float(np.radians(case.theta_deg)), SHAPES[case.shape]
    grating = coupled_wave.RigorousGrating(shape.profile, case.period, theta, index)
    found = coupled_wave.both_polarisations(grating, depths, shape.columns, _ORDER)
    te, tm = found / fresnel.reflectance(np.cos(theta), index)
    return Efficiencies(te, tm, *scalar(case, depths))


@contextmanager
def _environment_of_processes() -> Iterator[None]:
    """Processes started here have variables that this process, which has read its own, is not affected by."""
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    os.environ.update(_ENVIRONMENT)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def sweep(cases: Sequence[GratingCase], depths: Array, progress: Progress) -> dict[GratingCase, Efficiencies]:
    """Solve all cases in parallel processes, the longest first."""
    longest_first = sorted(cases, key=lambda case: -case.period)
    found = {}
    with _environment_of_processes(), ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        for done, result in enumerate(pool.map(solve, longest_first, [depths] * len(longest_first))):
            found[longest_first[done]] = result
            progress("coupled waves", (done + 1) / len(longest_first))
    return found


@dataclass(frozen=True)
class Sweep:
    """Results of a grid of cases, arrays over depth (rows) and period."""

    periods: Sequence[float]
    depths: Sequence[float]
    thetas_deg: Sequence[float]
    results: dict[GratingCase, Efficiencies]

    def cases(self) -> list[GratingCase]:
        """Return every shape and material in every light and period."""
        return [GratingCase(*each) for each in product(SHAPES, INDICES, self.thetas_deg, self.periods)]

    def grid(self, shape: str, material: str, theta_deg: float, what: str) -> Array:
        """Return one of the efficiencies, or the error, (depths, periods)."""
        cases = [GratingCase(shape, material, theta_deg, period) for period in self.periods]
        return np.stack([getattr(self.results[case], what) for case in cases], axis=1)

    def by_class(self, shape: str, what: str) -> Array:
        """Return the largest magnitude of an error over materials and lights, in the shape of the quoted table.

        It is that of periods from each of the table's on, and of depths up to each of them.
        """
        depths = np.array(self.depths)
        return np.array(
            [
                [
                    max(
                        (
                            np.max(np.abs(getattr(each, what))[depths <= depth], initial=0.0)
                            for case, each in self.results.items()
                            if case.shape == shape and case.period >= period
                        ),
                        default=0.0,
                    )
                    for depth in scalar_domain.DEPTHS
                ]
                for period in scalar_domain.PERIODS
            ]
        )
