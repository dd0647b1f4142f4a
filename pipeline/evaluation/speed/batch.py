"""The cost of several configs that share a surface, over that of one: the surface and its |P|^2 are computed once."""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.evaluation.speed import processes
from pipeline.evaluation.speed.processes import Spent
from pipeline.progress import Progress, silent
from pipeline.store import scratch

# illuminant and keys of [material] of each config
_LIKE_ONE = ("D65", 'fresnel = "schlick"')
_OTHERS = (
    ("A", 'fresnel = "schlick"'),
    ("D50", "ior = 1.33"),
    ("D55", "shadowing = false"),
    ("D75", 'fresnel = "none"'),
    ("C", 'fresnel = "dielectric"'),
    ("E", 'normalisation = "relative"'),
    ("D65", 'fresnel = "conductor"'),
    ("A", 'fresnel = "dielectric"'),
    ("D50", 'fresnel = "none"'),
)


@dataclass(frozen=True)
class BatchCost:
    """Time of one config, and of all configs of its surface in one run, the first included.

    configs: number of all. one, all: of these runs, from an empty store with compiled kernels.
    """

    configs: int
    one: Spent
    all: Spent

    @property
    def ratio(self) -> float:
        """Seconds of all configs over those of one."""
        return self.all.seconds / self.one.seconds

    @property
    def cpu_ratio(self) -> float:
        """Processor seconds of all configs over those of one: other processes change them less."""
        return self.all.cpu_s / self.one.cpu_s


def measure(command_line: Sequence[str], surface: str, progress: Progress = silent) -> BatchCost:
    """Run one config, and that one with nine more, which differ from it in illuminant and material.

    command_line: the words that start the tool. surface: the sections that all share, as TOML.
    Raises RunFailedError.
    """
    sections = [
        f'{surface}[spectrum]\nilluminant = "{illuminant}"\n[material]\n{keys}\n'
        for illuminant, keys in (_LIKE_ONE, *_OTHERS)
    ]
    with scratch.temporary() as folder:
        paths = [processes.write_config(folder, f"config{i}", text) for i, text in enumerate(sections)]
        # compiles the kernels
        processes.run(command_line, paths[:1])
        progress("configs of one surface", 0.2)
        one = processes.run(command_line, paths[:1])
        progress("configs of one surface", 0.4)
        return BatchCost(len(paths), one, processes.run(command_line, paths))
