"""What every stage is: a pure function from config sections and input artifacts to one artifact."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kernels import source
from pipeline.config.models import Config
from pipeline.progress import Progress
from pipeline.stages.session import Session
from pipeline.store import digest
from pipeline.store.store import Artifact

Summary = dict[str, Any]


@dataclass(frozen=True)
class Inputs:
    """The artifacts that a stage reads, by stage, and the objects that stages of this run have in memory."""

    artifacts: Mapping[str, Artifact]
    session: Session = field(default_factory=Session)

    def __getitem__(self, stage: str) -> Artifact:
        return self.artifacts[stage]

    def summary(self, stage: str) -> Summary:
        """What a stage recorded of its artifact."""
        found: Summary = self.artifacts[stage].summary
        return found


@dataclass(frozen=True)
class Stage:
    """One stage.

    version: raised whenever the same parameters would give another artifact.
    inputs: names of the stages whose artifacts it reads.
    parameters: everything it reads from the config, as JSON; with the input keys, it addresses the artifact.
    produce: writes the artifact's files into a folder and returns its summary (JSON).
    uses_device: whether it launches kernels.
    """

    name: str
    version: int
    inputs: tuple[str, ...]
    parameters: Callable[[Config], dict[str, Any]]
    produce: Callable[[Config, Inputs, Path, Progress], Summary]
    uses_device: bool = False

    def key(self, config: Config, input_keys: Mapping[str, str]) -> str:
        """The artifact's address."""
        return digest.of_json(
            {
                "stage": self.name,
                "version": self.version,
                "parameters": self.parameters(config),
                "inputs": {name: input_keys[name] for name in self.inputs},
            }
        )


def kernel_digest(*names: str) -> str:
    """Computes the digest of the sources of kernels, given by their files' names, with the files that they include."""
    return digest.of_json(source.text(*names))


def file_or_name(name: str) -> dict[str, str]:
    """A value that may name a CSV file, by the file's content."""
    if name.lower().endswith(".csv"):
        return {"sha256": digest.of_file(Path(name))}
    return {"name": name}


def light_parameters(config: Config) -> dict[str, Any]:
    """The [spectrum] section, an illuminant's CSV by its content."""
    section = config.light.model_dump(mode="json")
    if isinstance(config.light.illuminant, str):
        section["illuminant"] = file_or_name(config.light.illuminant)
    return section


def material_parameters(config: Config) -> dict[str, Any]:
    """The [material] section as far as the model chosen reads it, a metal's CSV by its content."""
    section = config.material.model_dump(mode="json")
    section["metal"] = file_or_name(config.material.metal) if config.material.fresnel == "conductor" else None
    if config.material.fresnel in ("none", "conductor"):
        section["ior"] = None
    return section
