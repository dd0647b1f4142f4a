"""All measurements of one surface."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.accuracy.checks import MAP_SIZE, RelativeError, relative_error
from pipeline.arrays import Array
from pipeline.bundle.polar import storage
from pipeline.bundle.polar.storage import Stored
from pipeline.config.models import Config
from pipeline.errors import AccuracyError
from pipeline.evaluation import plain_numpy
from pipeline.evaluation.speed import highlight, memory, nufft, polar_bake, setting, transforms
from pipeline.evaluation.speed.highlight import MirrorTruth, PlannedTable
from pipeline.evaluation.speed.machine import Timed
from pipeline.evaluation.speed.nufft import NufftRun
from pipeline.evaluation.speed.paper import RESOLUTION, STEP_NM, Paper
from pipeline.evaluation.speed.polar_bake import Stages, TimedBake
from pipeline.evaluation.speed.processes import Spent
from pipeline.evaluation.speed.timing import best_of, timed
from pipeline.evaluation.speed.transforms import Transforms
from pipeline.evaluation.speed.truth import MapTruth
from pipeline.optics.colour import ColourError
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar.compression import compress, most_textures, whole
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.table import PolarTable

PAPER, POLAR, TEXTURES = "paper's tables", "polar table", "polar table as RGBA16F"
NUFFT = "polar table by FINUFFT"
NUMPY_PAPER, NUMPY_POLAR = "paper's tables in plain numpy", "polar table in plain numpy"
# a grid of 251 k points, whose table is timed: E and integral are computed at all of them
MAIN = PolarLayout(rings=140, azimuths=1792)
# 249 k texels after thinning, nearly as many as the paper's 501 x 501; and as many points for a grating, whose light
# lies on a line of the plane, where fewer azimuths do
EQUAL = PolarLayout(rings=172, azimuths=2304)
GRATING = PolarLayout(rings=300, azimuths=832, w_terms=12)
# of the mirror: darker samples are compared in absolute terms
_FLOOR = 1e-7
_SEED = 3
_GRATING_STRETCH = 0.5


@dataclass(frozen=True)
class Effort:
    """Extent of the measurements.

    map_size: pixels of the map's side. paper: (resolution, step in nm) of the paper's tables. polar: layouts of polar
    tables. textures: numbers of textures, of the layout EQUAL. bakes: of the layout MAIN, before and after the other
    algorithms. repeats: of everything else. numpy_nodes: nodes that plain numpy computes. nufft_azimuths,
    nufft_repeats: those of FINUFFT. memory: whether peak memory is measured.
    """

    map_size: int
    paper: tuple[tuple[int, float], ...]
    polar: tuple[PolarLayout, ...]
    textures: tuple[int, ...]
    bakes: int
    repeats: int
    numpy_nodes: int
    nufft_azimuths: int
    nufft_repeats: int
    memory: bool


FULL = Effort(
    map_size=MAP_SIZE,
    paper=(
        *((resolution, STEP_NM) for resolution in (101, 151, 201, 301, 401, RESOLUTION, 701)),
        *((RESOLUTION, step) for step in (20.0, 10.0, 2.0)),
    ),
    polar=(
        *(PolarLayout(rings=r, azimuths=a) for r, a in ((50, 640), (70, 896), (100, 1280))),
        MAIN,
        EQUAL,
        GRATING,
        *(PolarLayout(rings=r, azimuths=a) for r, a in ((200, 2560), (280, 3584))),
    ),
    textures=(2, 3, 4, 6),
    bakes=25,
    repeats=5,
    numpy_nodes=8,
    nufft_azimuths=32,
    nufft_repeats=2,
    memory=True,
)
QUICK = replace(
    FULL,
    map_size=101,
    paper=((201, STEP_NM), (201, 20.0)),
    polar=(MAIN,),
    textures=(3,),
    bakes=5,
    repeats=2,
    numpy_nodes=2,
    nufft_azimuths=16,
    nufft_repeats=1,
    memory=False,
)


@dataclass(frozen=True)
class Point:
    """One table by one algorithm: its cost, and the error of its map.

    method: one of the names above. settings: resolution and step_nm, or rings, azimuths and w_terms and, where
    compressed, textures. texels: of the thinned grid. seconds: from the height field to the table. bytes: of the
    table as float32, or of its textures. scaled: whether the seconds are those of a sample, scaled by its size.
    mirror_error: largest relative error of X, Y or Z in the mirror directions of lights at 0 to 85 degrees, of
    textures.
    """

    method: str
    settings: dict[str, float]
    texels: int
    seconds: float
    bytes: int
    error: ColourError
    scaled: bool = False
    mirror_error: float | None = None


@dataclass(frozen=True)
class SurfaceSpeed:
    """The measurements of a surface.

    samples: (ny, nx). terms, nodes, w_terms: of the polar table of layout MAIN, as are stages and second_light_s.
    timed: work and seconds of stages and kernels. agreement: difference of "nufft" and "numpy" from the kernels, of
    samples over max(sample, 1e-7 of the mirror). memory_bytes: the peak of a process that bakes that table. notes:
    omissions with their reasons. planned: the table of the planner. whole_run: a process from its start to the
    table, kernels warm; whole_run_fault: why it was not measured.
    """

    name: str
    samples: tuple[int, int]
    sigma_um: float
    map_size: int
    terms: int
    nodes: int
    w_terms: int
    points: list[Point]
    stages: Stages
    second_light_s: float | None
    timed: list[Timed]
    transforms: list[Transforms]
    agreement: dict[str, RelativeError | None]
    nufft_upsampling: float | None
    memory_bytes: int | None
    notes: list[str]
    planned: PlannedTable
    whole_run: Spent | None = None
    whole_run_fault: str = ""

    def point(self, method: str, **settings: float) -> Point | None:
        """Return the point of a method at given settings, where it was measured."""
        return next((p for p in self.points if p.method == method and p.settings == settings), None)


def settings_of(layout: PolarLayout) -> dict[str, float]:
    """Return the numbers of a layout that are given, not chosen."""
    given = layout.model_dump(include={"rings", "azimuths", "w_terms"})
    return {key: value for key, value in given.items() if value != "auto"}


def _kept(table: PolarTable, nbytes: int) -> int:
    """Return the bytes that are stored of a table with all azimuths in memory."""
    return nbytes * table.tiles.texels // table.grid.texels


def run(config: Config, field: HeightField, effort: Effort, progress: Progress = silent) -> SurfaceSpeed:
    """Measure one surface. The sections scene, table and accuracy of its config are not used."""
    return _Suite(config, field, effort, progress).run()


class _Suite:
    """One surface's measurements, in order; points and notes as they come."""

    def __init__(self, config: Config, field: HeightField, effort: Effort, progress: Progress) -> None:
        self._config, self._field, self._effort, self._progress = config, field, effort, progress
        self._truth = MapTruth(field, config, effort.map_size, progress)
        self._mirrors = MirrorTruth(field, config, progress)
        self._main = setting.make(field, config, MAIN)
        self._points: list[Point] = []
        self._notes: list[str] = []

    def run(self) -> SurfaceSpeed:
        effort, main = self._effort, self._main
        baked = polar_bake.bake(main, effort.bakes)
        samples = main.samples(baked.made)
        numpy_pair_s, numpy_agrees = self._numpy(baked, samples)
        found, nufft_agrees = self._nufft(samples)
        baked = polar_bake.best(baked, polar_bake.bake(main, effort.bakes))
        self._polar(baked, found, numpy_pair_s)
        self._textures()
        timed = [*polar_bake.stages(main, baked), *self._paper()]
        measured = transforms.measure(main, effort.repeats)
        self._progress("the stack's transforms", 1.0)
        return SurfaceSpeed(
            name=self._config.name,
            samples=self._field.shape,
            sigma_um=main.bake.sigma_um,
            map_size=effort.map_size,
            terms=main.plan.terms,
            nodes=main.plan.s_nodes,
            w_terms=main.plan.w_terms,
            points=self._points,
            stages=baked.stages,
            second_light_s=baked.second_light_s,
            timed=timed,
            transforms=measured,
            agreement={"nufft": nufft_agrees, "numpy": numpy_agrees},
            nufft_upsampling=found.upsampling if found else None,
            memory_bytes=memory.peak_bytes(self._field, self._config, MAIN) if effort.memory else None,
            notes=self._notes,
            planned=highlight.planned(self._field, self._config, self._truth, self._mirrors.reference),
        )

    def _numpy(self, baked: TimedBake, samples: Array) -> tuple[float, RelativeError]:
        """Seconds of plain numpy for a (texel, wavelength) pair, and its difference from the table's samples."""
        main, rng = self._main, np.random.default_rng(_SEED)
        rings = np.linspace(1, main.plan.rings.count - 1, self._effort.numpy_nodes).astype(int)
        azimuths = rng.integers(main.plan.azimuths.count, size=len(rings))
        rho, phi = main.plan.rings.rho()[rings], main.plan.azimuths.phi()[azimuths]
        uv = np.stack([rho * np.cos(phi), rho * np.sin(phi)], axis=-1)
        # shared by all azimuths of a ring, so not timed
        series = [main.series(ring) for ring in rings]
        coefficients = plain_numpy.complex_coefficients(baked.built)

        def texels() -> Array:
            each = zip(rings, uv, series, strict=True)
            return np.stack(
                [plain_numpy.polar_texel(baked.built, coefficients, main.rule_of_ring(r), at, j) for r, at, j in each]
            )

        found, seconds = best_of(2, texels)
        pairs = int(np.sum(main.rules.count[rings]))
        self._progress("plain numpy", 1.0)
        return seconds / pairs, relative_error(samples[rings, :, :, azimuths], found, _FLOOR)

    def _nufft(self, samples: Array) -> tuple[NufftRun | None, RelativeError | None]:
        if not nufft.available():
            self._notes.append("FINUFFT is not installed (the extra `bench`), so there is nothing by it")
            return None, None
        azimuths, half = self._effort.nufft_azimuths, self._main.plan.azimuths.count // 2
        found = nufft.run(self._main, azimuths, self._effort.nufft_repeats)
        same = np.concatenate([samples[..., :azimuths], samples[..., half : half + azimuths]], axis=-1)
        self._progress("FINUFFT", 1.0)
        return found, relative_error(found.samples.astype(np.float64), same, _FLOOR)

    def _polar(self, baked: TimedBake, by_nufft: NufftRun | None, numpy_pair_s: float) -> None:
        """Polar tables over their grid; FINUFFT and plain numpy make the same tables with the same errors."""
        grating = self._main.plan.azimuths.stretch < _GRATING_STRETCH
        layouts = [layout for layout in self._effort.polar if layout != GRATING or grating]
        for i, layout in enumerate(layouts):
            chosen, made = self._main, baked
            if layout != MAIN:
                chosen = setting.make(self._field, self._config, layout)
                made = polar_bake.bake(chosen, self._effort.repeats)
            pairs = int(np.sum(chosen.rules.count)) * chosen.plan.azimuths.count
            size, error = _kept(made.table, made.table.values.nbytes), self._truth.error(made.table)
            point = Point(POLAR, settings_of(layout), chosen.plan.texels, made.stages.total, size, error)
            self._points += [point, replace(point, method=NUMPY_POLAR, seconds=numpy_pair_s * pairs, scaled=True)]
            if by_nufft:
                self._points.append(replace(point, method=NUFFT, seconds=by_nufft.seconds(chosen), scaled=True))
            self._progress("polar tables", (i + 1) / len(layouts))

    def _textures(self) -> None:
        """The polar table in few RGBA textures of half floats."""
        chosen = setting.make(self._field, self._config, EQUAL)
        baked = polar_bake.bake(chosen, self._effort.repeats)
        most = most_textures(baked.table)
        for count in sorted({min(count, most) for count in self._effort.textures}):

            def store(count: int = count) -> Stored:
                whole_or_less = whole(baked.table) if count == most else compress(baked.table, count, None)
                return storage.store(whole_or_less, "half")

            stored, seconds = timed(store)
            settings, error = {**settings_of(EQUAL), "textures": count}, self._truth.error(stored.textures)
            total, size = baked.stages.total + seconds, _kept(baked.table, stored.values.nbytes)
            point = Point(TEXTURES, settings, chosen.plan.texels, total, size, error)
            self._points.append(replace(point, mirror_error=self._mirrors.largest_error(stored.textures)))
        self._progress("textures", 1.0)

    def _paper(self) -> list[Timed]:
        """The paper's tables over their resolution and step, by the kernel and by plain numpy; the largest's work."""
        try:
            paper = Paper(self._field, self._config, self._effort.repeats)
        except AccuracyError as error:
            self._notes.append(f"no tables of the paper's: {error}")
            return []
        numpy_pair_s, agreement = paper.numpy_pair_s(self._effort.numpy_nodes)
        self._notes.append(f"the paper's kernel and plain numpy differ by {agreement:.0e} of the largest I_p")
        work: list[Timed] = []
        for i, (resolution, step_nm) in enumerate(self._effort.paper):
            made = paper.table(resolution, step_nm)
            if (resolution, step_nm) == max(self._effort.paper):
                work.append(paper.stage(made))
            settings, size = {"resolution": float(resolution), "step_nm": step_nm}, made.table.values.nbytes
            point = Point(PAPER, settings, resolution**2, made.seconds, size, self._truth.error(made.table))
            numpy_s = numpy_pair_s * made.pairs
            self._points += [point, replace(point, method=NUMPY_PAPER, seconds=numpy_s, scaled=True)]
            self._progress("the paper's tables", (i + 1) / len(self._effort.paper))
        return work
