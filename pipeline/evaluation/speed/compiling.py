"""What a new machine waits for: processor seconds of compiling, and a first and a second bake."""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from pipeline.evaluation.speed.processes import CommandLine
from pipeline.progress import Progress, silent

# a first config, and one of other terms, nodes in s, terms in |w| and window reach
_FIRST = '[surface]\nrecipe = { kind = "blazed", period_um = 2.5, height_um = 0.25 }\n'
_NEXT = """\
[surface]
recipe = { kind = "elaphe", height_um = 0.8, size_um = 40 }
[coherence]
sigma_um = 6
[accuracy]
delta_e = 0.5
"""
# as configs/elaphe.toml and configs/xenopeltis.toml
_FIRST_BAKE = """\
[surface]
recipe = { kind = "elaphe", across_um = 1.144, height_um = 0.37, seed = 1 }
[render]
lights = [{ theta_deg = 0 }, { theta_deg = 30, phi_deg = 180 }]
"""
_SECOND_BAKE = """\
[surface]
recipe = { kind = "xenopeltis", across_um = 0.55, along_um = 1.55, height_um = 0.3, seed = 1 }
[render]
lights = [{ theta_deg = 0 }, { theta_deg = 20 }]
"""


@dataclass(frozen=True)
class Compiling:
    """Costs on a machine whose kernel cache is empty.

    first_s, next_s: processor seconds that compiling adds to the first `run --until table`, and to the next of other
    terms, nodes and reach. first_bake_s, second_bake_s: seconds of a whole first run, kernels compiled within it, and
    of a second surface's.
    """

    first_s: float
    next_s: float
    first_bake_s: float
    second_bake_s: float


def measure(command_line: CommandLine, progress: Progress = silent) -> Compiling:
    """Costs of compiling: what a run takes with cold kernels beyond what the same run takes with warm ones.

    Raises RunFailedError.
    """
    with tempfile.TemporaryDirectory() as folder:
        cache, done = Path(folder) / "cache", iter(range(1, 9))

        def config(name: str, text: str) -> Path:
            path = Path(folder) / f"{name}.toml"
            path.write_text(f'name = "{name}"\n{text}', encoding="utf-8")
            return path

        def cpu_s(path: Path) -> float:
            spent = command_line.run(path, cache, until="table").cpu_s
            progress("compiling", next(done) / 8.0)
            return spent

        def forget_kernels() -> None:
            shutil.rmtree(cache / "diffract-bake" / "kernels", ignore_errors=True)

        first, other = config("first", _FIRST), config("next", _NEXT)

        def cold_s(path: Path) -> float:
            forget_kernels()
            return cpu_s(path)

        # all other caches are filled before; what else the machine does only adds
        cpu_s(first)
        cold = min(cold_s(first), cold_s(first))
        warm = min(cpu_s(first), cpu_s(first))
        cold_next = cpu_s(other)
        warm_next = min(cpu_s(other), cpu_s(other))
        forget_kernels()
        bakes = [
            command_line.run(config(name, text), cache).seconds
            for name, text in (("elaphe", _FIRST_BAKE), ("xenopeltis", _SECOND_BAKE))
        ]
    return Compiling(cold - warm, max(cold_next - warm_next, 0.0), *bakes)
