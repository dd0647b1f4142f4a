"""The order in which several configs are baked, and the objects that they share in memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.config.models import Config
from pipeline.stages import run
from pipeline.stages.run import Step
from pipeline.stages.session import Session
from pipeline.store.store import Store


@dataclass(frozen=True)
class Turn:
    """A config when it is to be baked.

    config: the config. steps: its plan. number: its place in the order, from 1. count: of all configs.
    session: the objects of the configs before it, of artifacts that it needs as well.
    """

    config: Config
    steps: list[Step]
    number: int
    count: int
    session: Session


def turns(planned: Sequence[tuple[Config, list[Step]]], store: Store) -> Iterator[Turn]:
    """Yields configs in an order in which those that share artifacts follow each other.

    Configs follow by name, except that those of one surface follow its first config, those of the same power spectrum
    or stack the first of these, and so on through the stages. The addresses of a stage's inputs are part of its own
    address, so a config shares nothing with those before that it does not share with the one right before. Objects
    that a config does not need are dropped when its turn comes. The exact reference and the curves of `validate` stay
    while configs share the transform of the surface, and while the stages of the next fit into memory beside them.

    planned: configs of different names, in any order, each with its plan. store: of their artifacts.
    """
    addresses = {config.name: [step.key for step in steps] for config, steps in planned}
    first: dict[str, str] = {}
    for name in sorted(addresses):
        for address in addresses[name]:
            first.setdefault(address, name)
    ordered = sorted(planned, key=lambda each: [*(first[a] for a in addresses[each[0].name]), each[0].name])
    session, before = Session(), ""
    for number, (config, steps) in enumerate(ordered, 1):
        transform = addresses[config.name][:2][-1]
        fits = run.fits(config, steps, store, session.derived_bytes)
        session.retain(addresses[config.name], derived=transform == before and fits)
        session.following = [later for later, _ in ordered[number:] if addresses[later.name][:2][-1] == transform]
        before = transform
        yield Turn(config, steps, number, len(ordered), session)
