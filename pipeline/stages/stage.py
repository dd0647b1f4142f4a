"""The definition of a stage: a pure function from config sections and input artifacts to one artifact."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from kernels import source
from pipeline.config.models import Config
from pipeline.progress import Progress
from pipeline.stages.session import Session, Sized
from pipeline.store import digest
from pipeline.store.store import Artifact

Summary = dict[str, Any]
_T = TypeVar("_T", bound=Sized)


@dataclass(frozen=True)
class Inputs:
    """The input of a stage.

    artifacts: those that it reads, by stage. session: the objects that the stages of this run share.
    address: of the artifact that it makes.
    """

    artifacts: Mapping[str, Artifact]
    session: Session = field(default_factory=Session)
    address: str = ""

    def __getitem__(self, stage: str) -> Artifact:
        return self.artifacts[stage]

    def keep(self, value: Sized) -> None:
        """Keeps the object that this stage writes, for the following stages."""
        self.session.keep(self.address, value)

    def shared(self, stage: str, load: Callable[[Artifact], _T]) -> _T:
        """Returns the object in a stage's artifact: from memory, or loaded where it is not there."""
        return self.session.get(self[stage].key, lambda: load(self[stage]))

    def summary(self, stage: str) -> Summary:
        """Returns the summary in the record of a stage's artifact."""
        found: Summary = self.artifacts[stage].summary
        return found


@dataclass(frozen=True)
class Stage:
    """One stage.

    name: of the stage and of its folder in the store.
    version: increased whenever the same parameters would give another artifact.
    inputs: names of the stages whose artifacts it reads.
    parameters: returns all values that the stage reads from the config, as JSON; they are part of the address.
    produce: writes the files of the artifact into a folder and returns its summary, as JSON.
    uses_device: whether it launches kernels.
    work: describes the work of the stage for a config, for a plan.
    """

    name: str
    version: int
    inputs: tuple[str, ...]
    parameters: Callable[[Config], dict[str, Any]]
    produce: Callable[[Config, Inputs, Path, Progress], Summary]
    uses_device: bool = False
    work: Callable[[Config], str] = lambda _config: ""

    def key(self, config: Config, input_keys: Mapping[str, str]) -> str:
        """Computes the address of the artifact, 64 hex digits, from the config and the addresses of all inputs."""
        return digest.of_json(
            {
                "stage": self.name,
                "version": self.version,
                "parameters": self.parameters(config),
                "inputs": {name: input_keys[name] for name in self.inputs},
            }
        )


def textures_work(config: Config) -> str:
    """Describes the stage "textures" of a config, for a plan."""
    return f"in {config.publish.precision}, {config.publish.textures}"


def kernel_digest(*names: str) -> str:
    """Computes the digest of the sources of kernels, by the names of their files, with the files they include."""
    return digest.of_json(source.text(*names))


def file_or_name(name: str) -> dict[str, str]:
    """Returns the digest of a CSV file, or the name itself where it names no file, as part of an address."""
    if name.lower().endswith(".csv"):
        return {"sha256": digest.of_source(Path(name))}
    return {"name": name}


def colour_parameters(config: Config) -> dict[str, Any]:
    """Returns the sections of which colours and their errors depend, as part of an address."""
    return {
        "spectrum": light_parameters(config),
        "material": material_parameters(config),
        "accuracy": config.accuracy.model_dump(mode="json"),
    }


def scene_parameters(config: Config) -> dict[str, Any] | None:
    """Returns the section [scene] as part of an address, with the digests of its files; None where there is none."""
    if config.scene is None:
        return None
    section = config.scene.model_dump(mode="json")
    for entry in (*section["lights"], section["mesh"] or {}):
        if "path" in entry:
            entry["path"] = {"sha256": digest.of_file(Path(entry["path"]))}
    return section


def light_parameters(config: Config) -> dict[str, Any]:
    """Returns the section [spectrum] as part of an address, with the digest of an illuminant's CSV."""
    section = config.light.model_dump(mode="json")
    if isinstance(config.light.illuminant, str):
        section["illuminant"] = file_or_name(config.light.illuminant)
    return section


def material_parameters(config: Config) -> dict[str, Any]:
    """Returns the keys of [material] that its model reads as part of an address, with the digest of a metal's CSV."""
    section = config.material.model_dump(mode="json")
    section["metal"] = file_or_name(config.material.metal) if config.material.fresnel == "conductor" else None
    if config.material.fresnel in ("none", "conductor"):
        section["ior"] = None
    return section
