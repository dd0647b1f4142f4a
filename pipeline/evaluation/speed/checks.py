"""The acceptance criteria of the bench as checks."""

from collections.abc import Iterator

from pipeline.evaluation.check import Check, Relation
from pipeline.evaluation.speed.machine import Machine, share
from pipeline.evaluation.speed.paper import RESOLUTION, STEP_NM
from pipeline.evaluation.speed.processes import Compiling
from pipeline.evaluation.speed.suite import (
    MAIN,
    NUFFT,
    NUMPY_POLAR,
    PAPER,
    POLAR,
    TEXTURES,
    SurfaceSpeed,
    settings_of,
)

_GIB = 2.0**30
# of the mean error, by the number of textures
_TEXTURE_BOUNDS = {3: 0.2, 2: 0.9}
# as many as the paper's 501 x 501
_TEXELS = 252_000


def of_surface(found: SurfaceSpeed, machine: Machine) -> list[Check]:
    """Return the criteria of one surface."""

    def check(
        number: int,
        name: str,
        what: str,
        value: float | None,
        relation: Relation,
        bound: float,
        unit: str = "",
        remark: str = "",
    ) -> Check:
        """A criterion's check, its number as the source."""
        return Check(
            f"{found.name}.speed.{name}", what, value, relation, bound, None, unit, f"criterion {number}", remark
        )

    def errors() -> Iterator[Check]:
        """Error of the polar table, alone and beside that of the paper's layout at as many texels."""
        polar = min(
            (p for p in found.points if p.method == POLAR and p.texels <= _TEXELS), key=lambda p: p.error.mean
        )
        grid = " x ".join(f"{polar.settings[axis]:g}" for axis in ("rings", "azimuths"))
        where = f"{grid} texels, map of {found.map_size}^2, maximum {polar.error.maximum:.2g}"
        yield check(1, "mean_error", "mean dE at 7500 RU", polar.error.mean, "<=", 0.08, "", where)
        yield check(1, "percentile_99", "99th percentile of dE", polar.error.percentile_99, "<=", 0.5, "", where)
        paper = found.point(PAPER, resolution=RESOLUTION, step_nm=STEP_NM)
        ratio = paper.error.mean / polar.error.mean if paper else None
        remark = f"{paper.error.mean:.3g} / {paper.error.percentile_99:.3g}" if paper else ""
        yield check(1, "paper_error", "error of the paper's layout over ours", ratio, ">=", 25.0, "x", remark)
        for count, bound in _TEXTURE_BOUNDS.items():
            stored = found.point(TEXTURES, **settings_of(MAIN), textures=count)
            remark = f"99th percentile {stored.error.percentile_99:.3g}" if stored else ""
            mean = stored.error.mean if stored else None
            yield check(1, f"textures_{count}", f"mean dE in {count} RGBA16F", mean, "<=", bound, "", remark)

    def times() -> Iterator[Check]:
        """Stack, power spectrum and table beside other algorithms for the same table; a second light."""
        total = found.stages.total
        for name, what, method, bound in (
            ("finufft", "FINUFFT's time over ours", NUFFT, 50.0),
            ("plain_numpy", "plain numpy's time over ours", NUMPY_POLAR, 500.0),
        ):
            other = found.point(method, **settings_of(MAIN))
            remark = f"{other.seconds:.3g} s / {total:.3g} s" if other else ""
            ratio = other.seconds / total if other else None
            yield check(2, name, what, ratio, ">=", bound, "x", remark)
        for reached in (share(timed, machine) for timed in found.timed):
            if reached.stage in ("power spectrum", "apply_operator"):
                name, what = reached.stage.replace(" ", "_"), f"{reached.stage}'s share of its bound"
                remark = f"of {reached.bound}, {1e3 * reached.seconds:.3g} ms"
                yield check(2, name, what, reached.bound_share, ">=", 0.4, "", remark)
        second = found.second_light_s
        remark = "" if second is None else f"{second:.3g} s / {total:.3g} s"
        part = None if second is None else second / total
        yield check(3, "second_light", "a second illuminant's share", part, "<", 1 / 3, "", remark)
        bound, remark = 4.0 * total + 2.0, found.whole_run_fault or "4 times its kernels + 2 s"
        yield check(6, "whole_run", "run --until table, warm", found.whole_run_s, "<=", bound, "s", remark)

    return [*errors(), *times(), _memory(f"{found.name}.speed.memory", "peak memory", found.memory_bytes, 1.0)]


def of_large_scan(peak_bytes: int | None) -> Check:
    """Return the criterion of a scan of 4096 x 4096 samples."""
    return _memory("large_scan.speed.memory", "peak memory, 4096^2 samples, 64 terms", peak_bytes, 3.0)


def _memory(name: str, what: str, peak_bytes: int | None, bound: float) -> Check:
    value = None if peak_bytes is None else peak_bytes / _GIB
    return Check(name, what, value, "<", bound, unit="GiB", source="criterion 4")


def of_compiling(costs: Compiling | None, fault: str = "") -> list[Check]:
    """Return the criteria of a new machine. fault: why there are no costs."""
    asked = (
        ("first_s", "compiling for the first config", 3.0, "s CPU", "run --until table, kernels cold less warm"),
        ("next_s", "compiling for the next config", 1.0, "s CPU", "other terms, nodes, terms in |w| and reach"),
        ("first_bake_s", "first bake, kernels cold", 20.0, "s", "configs/elaphe.toml, two lights, with its bundle"),
        ("second_bake_s", "second bake", 8.0, "s", "configs/xenopeltis.toml, two lights, with its bundle"),
    )
    return [
        Check(
            f"new_machine.speed.{key.removesuffix('_s')}",
            what,
            getattr(costs, key, None),
            "<=",
            bound,
            None,
            unit,
            "criterion 7",
            fault or remark,
        )
        for key, what, bound, unit, remark in asked
    ]
